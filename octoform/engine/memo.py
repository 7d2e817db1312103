"""The memo: what the last run compiled and found, kept by the digest of every byte that it rests on.

A plan with nothing to do must not parse a manifest, check schemas or import the libraries for that: on a small board
this is the difference between one second and ten. The memo is written by apply alone (a plan writes nothing) and is
never trusted when a byte, a file name, the program, the interpreter, the environment or the hardware moved; then the
long way is taken. Light: no import beyond the standard library's cheap parts.
"""

import json
import os
import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import octoform
from octoform import digest, host
from octoform.endpoint.observing import observe
from octoform.plan.encode import from_json, to_json
from octoform.plan.model import Plan
from octoform.state.layout import Layout
from octoform.state.revision import head_revision

FORMAT = 1
SETTINGS = ("OCTOFORM_SYSROOT",)
PACKAGE = Path(octoform.__file__).parent


def path_of(project: Path) -> Path:
    """Where the memo of a project folder lies."""
    return project / ".octoform" / "compiled.json"


def recall(project: Path, environ: Mapping[str, str]) -> Plan | None:
    """The remembered plan without work if everything it rests on is as it was; None means: take the long way."""
    memo = _read(path_of(project))
    if memo is None or not _same(memo, project, environ):
        return None
    plan = from_json(memo["plan"])
    if observe(Layout(project, plan.host)).reasons:
        return None
    revision = head_revision(project)
    return plan if revision == plan.revision else replace(plan, revision=revision, dirty=_dirty(project, memo))


def _read(path: Path) -> dict[str, Any] | None:
    """The memo, if it is a plain file of ours in the format of this version."""
    try:
        if path.is_symlink() or path.stat().st_uid != os.getuid():
            return None
        memo = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return None  # no memo, or a broken one: the long way tells what is wrong, if anything is
    return memo if isinstance(memo, dict) and memo.get("format") == FORMAT else None


def _same(memo: Mapping[str, Any], project: Path, environ: Mapping[str, str]) -> bool:
    if memo["program"] != program() or memo["environment"] != variables(memo["variables"], environ):
        return False
    if memo["files"] != digests(project, memo["files"]) or memo["names"] != names(project, memo["names"]):
        return False
    return bool(memo["hardware"] == host.fingerprint(host.root_from_environment(environ)).digest)


def program() -> dict[str, str]:
    """What runs: version, interpreter, and the package's own files by name, size and time."""
    entries = _listing(str(PACKAGE))
    build = digest.of_value(entries)
    return {"octoform": octoform.__version__, "python": sys.version, "executable": sys.executable, "build": build}


def _listing(folder: str) -> list[list[object]]:
    found: list[list[object]] = []
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda item: item.name):
            if entry.is_dir():
                found += _listing(entry.path) if entry.name != "__pycache__" else []
            else:
                facts = entry.stat()
                found.append([entry.name, facts.st_size, facts.st_mtime_ns])
    return found


def variables(chosen: Iterable[str], environ: Mapping[str, str]) -> dict[str, str]:
    """What a plan reads of the environment: octoform's own settings, and whether the manifest's variables are set.

    The values of the manifest's variables are in no key and may be secrets, so not even a digest of them is kept.
    """
    told = {name: "set" if environ.get(name) else "unset" for name in sorted(chosen)}
    return {**told, **{name: environ.get(name, "") for name in SETTINGS}}


def digests(project: Path, files: Iterable[str]) -> dict[str, str | None]:
    """Digest of each file, None where it cannot be read as a plain file."""
    return {name: _digest(project / name) for name in files}


def _digest(path: Path) -> str | None:
    try:
        return None if path.is_symlink() else digest.of_file(path)
    except OSError:
        return None


def names(project: Path, folders: Iterable[str]) -> dict[str, list[str]]:
    """Every file name below each folder, so that a new file is noticed."""
    out = {}
    for folder in folders:
        found = [
            str(Path(root, name).relative_to(project)) for root, _, files in os.walk(project / folder) for name in files
        ]
        out[folder] = sorted(name for name in found if "__pycache__" not in name)
    return out


def _dirty(project: Path, memo: Mapping[str, Any]) -> tuple[str, ...]:
    import subprocess  # only after a commit since the last apply

    command = ["git", "-C", str(project), "status", "--porcelain", "--", *memo["sources"]]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return tuple(sorted(line[3:] for line in done.stdout.splitlines()))


def document(
    plan: Plan, project: Path, sources: Iterable[str], chosen: Iterable[str], environ: Mapping[str, str]
) -> bytes:
    """The memo of a plan without work; ``sources`` are the files of manifest, specs, schemas and profiles."""
    folders = ["protocol", f"state/{plan.host}"]
    listed = names(project, folders)
    files = sorted(
        {*sources, *(name for group in listed.values() for name in group), f".octoform/{plan.host}/journal.jsonl"}
    )
    wanted = sorted(chosen)
    memo = {
        "format": FORMAT,
        "program": program(),
        "variables": wanted,
        "environment": variables(wanted, environ),
        "sources": sorted(sources),
        "files": digests(project, files),
        "names": listed,
        "hardware": host.fingerprint(host.root_from_environment(environ)).digest,
        "plan": to_json(plan),
    }
    return digest.canonical_json(memo)
