"""The records of the installed distributions of an environment: altered ones, and ones that two claim.

Every installed distribution lists its files with their digests (the RECORD of the wheel format). Two that list the
same file provide the same module: whichever was installed last has overwritten the other, and either one's removal
breaks both. That is how a graphical and a headless build of one library come to conflict. Light: standard library.
"""

import base64
import csv
import hashlib
import io
import posixpath
import re
from collections.abc import Iterator
from pathlib import Path

from octoform.base.files import head, stream

_RECORD = "RECORD"
_DIST_INFO = ".dist-info"
_PREFIX = "sha256="
MAX_BYTES = 8_000_000
"""Of one RECORD; a real one has some hundred kilobytes at most."""


def altered(folder: Path) -> list[str]:
    """Installed files that are missing, or not what their distribution states: ``distribution: file``, sorted.

    Reads every file once: a second for some hundred megabytes.
    """
    found = []
    for name, file, wanted in _listed(folder):
        if wanted.startswith(_PREFIX) and _digest(folder / file) != wanted.removeprefix(_PREFIX):
            found.append(f"{name}: {file}")
    return sorted(found)


def conflicts(folder: Path) -> dict[str, tuple[str, ...]]:
    """Module to the distributions that all provide it: that list a same file of it. Both sorted."""
    owners: dict[str, set[str]] = {}
    for name, file, _ in _listed(folder):
        owners.setdefault(file, set()).add(name)
    found: dict[str, set[str]] = {}
    for file, names in owners.items():
        if len(names) > 1:
            found.setdefault(file.partition("/")[0].removesuffix(".py"), set()).update(names)
    return {module: tuple(sorted(names)) for module, names in sorted(found.items())}


def providers(folder: Path) -> dict[str, frozenset[str]]:
    """Top-level module to the distributions that have files of it, by their normalised names."""
    found: dict[str, set[str]] = {}
    for name, file, _ in _listed(folder):
        module = file.partition("/")[0].partition(".")[0]
        found.setdefault(module, set()).add(name)
    return {module: frozenset(map(_normalised, names)) for module, names in found.items()}


def requirements(folder: Path) -> dict[str, frozenset[str]]:
    """Each installed distribution to those that it asks for, by their normalised names.

    One that it asks for under an extra (tests, documentation) counts where another installed one asks for that extra.
    """
    lines: dict[str, list[tuple[str, frozenset[str], str | None]]] = {}
    for metadata in folder.glob(f"*{_DIST_INFO}/METADATA"):
        try:
            text = head(metadata, MAX_BYTES, follow=True).decode("utf-8", "replace").partition("\n\n")[0]
        except OSError:  # that the environment is damaged shows elsewhere
            continue
        name = metadata.parent.name.removesuffix(_DIST_INFO).partition("-")[0]
        lines[_normalised(name)] = [_wanted(*found) for found in _REQUIRED.findall(text)]
    extras: set[tuple[str, str]] = set()
    while True:
        counted = {
            name: [row for row in rows if row[2] is None or (name, row[2]) in extras] for name, rows in lines.items()
        }
        asked = {(other, extra) for rows in counted.values() for other, named, _ in rows for extra in named}
        if asked <= extras:
            return {name: frozenset(other for other, _, _ in rows) for name, rows in counted.items()}
        extras |= asked


_REQUIRED = re.compile(r"(?m)^Requires-Dist:[ \t]*([A-Za-z0-9][A-Za-z0-9._-]*)[ \t]*(?:\[([^\]\n]*)\])?([^\n]*)$")
_EXTRA = re.compile(r"\bextra\s*==\s*['\"]([^'\"]+)['\"]")


def _wanted(name: str, extras: str, rest: str) -> tuple[str, frozenset[str], str | None]:
    """(distribution, its extras that are asked for, the extra under which it is), each in its one spelling."""
    under = _EXTRA.search(rest.partition(";")[2])
    named = frozenset(_normalised(each.strip()) for each in extras.split(",") if each.strip())
    return _normalised(name), named, _normalised(under[1]) if under else None


def _normalised(name: str) -> str:
    """A name in the one spelling by which names are compared (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).casefold()


def _listed(folder: Path) -> Iterator[tuple[str, str, str]]:
    """Distribution, file and digest of every file that counts: of a module, and no bytecode."""
    for record in sorted(folder.glob(f"*{_DIST_INFO}/{_RECORD}")):
        name = record.parent.name.removesuffix(_DIST_INFO).partition("-")[0].replace("_", "-")
        for file, digest in _rows(record):
            file = posixpath.normpath(file)
            parts = file.split("/")
            inside = parts[0] not in ("", ".", "..") and not parts[0].endswith(_DIST_INFO)
            if inside and "__pycache__" not in parts:
                yield name, file, digest


def _rows(record: Path) -> list[tuple[str, str]]:
    try:
        text = head(record, MAX_BYTES, follow=True).decode("utf-8", "replace")
        return [(row[0], row[1]) for row in csv.reader(io.StringIO(text)) if len(row) > 1]
    except (OSError, csv.Error):  # a distribution without a list is not checked; damage to it shows elsewhere
        return []


def _digest(path: Path) -> str | None:
    try:
        with stream(path) as file:
            found = hashlib.file_digest(file, "sha256").digest()
    except OSError:
        return None
    return base64.urlsafe_b64encode(found).rstrip(b"=").decode()
