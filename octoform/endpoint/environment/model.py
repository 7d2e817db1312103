"""Serving environments as values: where one lies, whether it is whole, whether it is still what was built.

A serving environment is content-addressed by its lock and by the interpreter that carries it, so an environment is
never changed, only made or dropped. Light: no process is started and nothing heavy imported, because every plan
asks whether the environment drifted.

Every installed distribution lists its files with their digests (the RECORD of the wheel format). Two that list the
same file provide the same module: whichever was installed last has overwritten the other, and either one's removal
breaks both. That is how a graphical and a headless build of one library come to conflict.
"""

import hashlib
import io
import os
import posixpath
import re
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from octoform.base.digest import of_value, short
from octoform.base.files import head, read_json, stream
from octoform.base.shape import fits
from octoform.patterns import regex
from octoform.records import dataclass
from octoform.state.layout import Layout

MARKER = "octoform-complete.json"
_WHOLE = {"digest": str, "lock": str, "distributions": [str], "modules": ([str], None)}
FOLDER_NAME = regex(r"[0-9a-f]{12}")
_PIN = regex(r"^([A-Za-z0-9][A-Za-z0-9._-]*)==([^\s;\\]+)", re.MULTILINE)
_DIST_INFO = ".dist-info"
_RECORD = "RECORD"
_PREFIX = "sha256="
MAX_RECORD_BYTES = 8_000_000
"""Of one RECORD; a real one has some hundred kilobytes at most."""


@dataclass(frozen=True, slots=True)
class Environment:
    """A serving environment. ``digest`` is over lock and interpreter; ``lock`` is the digest of the lock's text."""

    python: Path
    digest: str
    path: Path
    lock: str


def locate(layout: Layout, lock_text: str) -> Environment:
    """Where the environment of this lock lies on this machine, built or not."""
    lock = of_value(lock_text)
    carrier = f"{sys.implementation.name}-{sys.version_info.major}.{sys.version_info.minor}"
    digest = of_value({"lock": lock, "python": carrier, "machine": f"{sys.platform}-{os.uname().machine}"})
    path = layout.environments / short(digest)
    return Environment(path / "bin" / "python", digest, path, lock)


def at(path: Path) -> Environment | None:
    """The complete environment in this folder by its marker, or None."""
    marker = _marker(path)
    if marker is None:
        return None
    return Environment(path / "bin" / "python", str(marker["digest"]), path, str(marker["lock"]))


def intact(environment: Environment) -> list[str]:
    """Plain reasons why the environment is not what was built; empty when it is.

    Compares the names and versions of the installed distributions, and the names of their modules, with those
    recorded at build time, so an upgrade or a lost package behind our back is seen; a file edited inside a package
    is not.
    """
    marker = _marker(environment.path)
    if marker is None or marker.get("digest") != environment.digest:
        return ["the serving environment is missing or was never completed"]
    # With the rights that start it: those of the user alone may be fewer.
    if not os.access(environment.python, os.X_OK, effective_ids=os.access in os.supports_effective_ids):
        return ["the interpreter of the serving environment is missing"]
    names = contents(environment.path)
    built = _by_name(marker["distributions"])
    present = _by_name(_distributions(names))
    lost = sorted(set(marker.get("modules") or ()) - set(names))
    reasons = [f"{name} is gone from the serving environment" for name in lost]
    if "modules" in marker and not set(present) - set(built):
        # What was installed is reported by its distribution, not by each of its modules.
        added = {name for name in names if not name.endswith(_DIST_INFO)} - set(marker["modules"] or ())
        reasons += [f"{name} was added to the serving environment" for name in sorted(added)]
    for name in sorted({*built, *present}):
        before, after = built.get(name), present.get(name)
        if before != after:
            reasons.append(_difference(name, before, after))
    if set(present) - set(built):
        # The last installed one overwrites a module that existed before.
        provided = conflicts(packages_of(environment.path)).items()
        reasons += [f"{module} is provided by both {' and '.join(names)}" for module, names in provided]
    return reasons


def packages_of(path: Path) -> Path:
    """The folder of an environment that holds its packages."""
    return path / "lib" / f"python{sys.version_info.major}.{sys.version_info.minor}" / "site-packages"


def installed(path: Path) -> list[str]:
    """Names of the ``*.dist-info`` folders (without the ending), sorted; empty when there is no environment."""
    return _distributions(contents(path))


def contents(path: Path) -> list[str]:
    """Every name in the folder that holds the packages, bytecode omitted; empty when there is no environment."""
    try:
        with os.scandir(packages_of(path)) as entries:
            return [entry.name for entry in entries if entry.name != "__pycache__"]
    except OSError:
        return []


def modules(path: Path) -> list[str]:
    """The names in that folder which can be imported or are read at the start, sorted."""
    return sorted(name for name in contents(path) if not name.endswith(_DIST_INFO))


def pins(lock_text: str) -> dict[str, str]:
    """Normalised distribution name to exact version, as the lock states."""
    return {normal(name): version for name, version in _PIN.findall(lock_text)}


def normal(name: str) -> str:
    """A distribution's name in the one form in which two spellings are equal (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def _distributions(names: list[str]) -> list[str]:
    return sorted(name.removesuffix(_DIST_INFO) for name in names if name.endswith(_DIST_INFO))


def _difference(name: str, before: str | None, after: str | None) -> str:
    if after is None:
        return f"{name} {before} is gone from the serving environment"
    if before is None:
        return f"{name} {after} was added to the serving environment"
    return f"{name} {before} -> {after} in the serving environment"


def _by_name(distributions: list[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for item in distributions:
        name, _, version = item.partition("-")
        found[normal(name)] = version
    return found


def _marker(path: Path) -> dict[str, Any] | None:
    try:
        value = read_json(path / MARKER)
    except (OSError, ValueError):
        return None
    return value if fits(value, _WHOLE) else None


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
    return {module: frozenset(map(normal, names)) for module, names in found.items()}


def requirements(folder: Path) -> dict[str, frozenset[str]]:
    """Each installed distribution to those that it asks for, by their normalised names.

    One that it asks for under an extra (tests, documentation) counts where another installed one asks for that extra.
    """
    lines: dict[str, list[tuple[str, frozenset[str], str | None]]] = {}
    for metadata in folder.glob(f"*{_DIST_INFO}/METADATA"):
        try:
            text = head(metadata, MAX_RECORD_BYTES, follow=True).decode("utf-8", "replace").partition("\n\n")[0]
        except OSError:  # that the environment is damaged shows elsewhere
            continue
        name = metadata.parent.name.removesuffix(_DIST_INFO).partition("-")[0]
        lines[normal(name)] = [_wanted(*found) for found in _REQUIRED.findall(text)]
    extras: set[tuple[str, str]] = set()
    while True:
        counted = {
            name: [row for row in rows if row[2] is None or (name, row[2]) in extras] for name, rows in lines.items()
        }
        asked = {(other, extra) for rows in counted.values() for other, named, _ in rows for extra in named}
        if asked <= extras:
            return {name: frozenset(other for other, _, _ in rows) for name, rows in counted.items()}
        extras |= asked


_REQUIRED = regex(r"(?m)^Requires-Dist:[ \t]*([A-Za-z0-9][A-Za-z0-9._-]*)[ \t]*(?:\[([^\]\n]*)\])?([^\n]*)$")
_EXTRA = regex(r"\bextra\s*==\s*['\"]([^'\"]+)['\"]")


def _wanted(name: str, extras: str, rest: str) -> tuple[str, frozenset[str], str | None]:
    """(distribution, its extras that are asked for, the extra under which it is), each in its one spelling."""
    under = _EXTRA.search(rest.partition(";")[2])
    named = frozenset(normal(each.strip()) for each in extras.split(",") if each.strip())
    return normal(name), named, normal(under[1]) if under else None


def recorded(folder: Path) -> set[str]:
    """The lines of sources in every RECORD: a file's name below ``folder``, its digest, its size."""
    found: set[str] = set()
    for record in folder.glob(f"*{_DIST_INFO}/{_RECORD}"):
        with suppress(OSError):  # nothing is known of its files
            text = head(record, MAX_RECORD_BYTES, follow=True).decode("utf-8", "replace")
            found.update(line for line in text.splitlines() if ".py," in line)
    return found


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
    import csv  # only a look at every file pays for it

    try:
        text = head(record, MAX_RECORD_BYTES, follow=True).decode("utf-8", "replace")
        return [(row[0], row[1]) for row in csv.reader(io.StringIO(text)) if len(row) > 1]
    except (OSError, csv.Error):  # a distribution without a list is not checked; damage to it shows elsewhere
        return []


def _digest(path: Path) -> str | None:
    import base64

    try:
        with stream(path) as file:
            found = hashlib.file_digest(file, "sha256").digest()
    except OSError:
        return None
    return base64.urlsafe_b64encode(found).rstrip(b"=").decode()
