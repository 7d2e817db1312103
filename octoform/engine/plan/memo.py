"""The memo: what the last run compiled and found, kept by the digest of every byte that it rests on.

A plan with nothing to do must not parse a manifest, check schemas or import the libraries for that: on a small board
this is the difference between one second and ten. The memo is written by apply alone (a plan writes nothing) and is
never trusted when a byte, a file name, the program, the interpreter, the environment or the hardware moved; then the
long way is taken. Light: no import beyond the standard library's cheap parts.
"""

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import octoform
from octoform import diagnostics, host
from octoform.base import digest, files
from octoform.diagnostics import Diagnostic
from octoform.endpoint.drift import observe
from octoform.endpoint.process.record import running_beside
from octoform.plan.model import Plan, from_json, to_json
from octoform.records import dataclass, replace
from octoform.state.git_access import head_revision, repository
from octoform.state.layout import Layout

FORMAT = 2
MANIFEST = "octopus.yaml"
LOCAL = ("journal.jsonl", "instances.json")
SETTINGS = ("OCTOFORM_SYSROOT",)
PACKAGE = Path(octoform.__file__).parent
_UNREAD = ("__pycache__", "pages")
"""Folders of the package whose files no plan is made from; there are as many pages of codes as other files."""


def path_of(project: Path) -> Path:
    """Where the memo of a project folder lies."""
    return project / ".octoform" / "compiled.json"


@dataclass(frozen=True, slots=True)
class Remembered:
    """A plan without work, and its diagnostics whenever it is shown."""

    plan: Plan
    diagnostics: tuple[Diagnostic, ...] = ()


def recall(project: Path, environ: Mapping[str, str]) -> Remembered | None:
    """The remembered plan without work if everything it rests on is as it was; None means: take the long way."""
    memo = _read(path_of(project))
    if memo is None or not _same(memo, project, environ):
        return None
    plan = _current(memo, project)
    found = tuple(map(diagnostics.from_json, memo["diagnostics"]))
    return Remembered(plan, found) if plan is not None else None


def _current(memo: Mapping[str, Any], project: Path) -> Plan | None:
    """The plan, with git's present answer; None where the endpoint is not as it was left, or git does not answer."""
    plan = from_json(memo["plan"])
    layout = Layout(project, plan.host)
    if observe(layout).reasons or running_beside(layout):
        return None
    revision = head_revision(project)
    if revision == plan.revision:
        return plan
    dirty = _dirty(project, memo)
    return replace(plan, revision=revision, dirty=dirty) if dirty is not None else None


def host_of(project: Path) -> str | None:
    """The host's name, where the manifest is the very file that the memo was made from; whatever else has moved.

    Who wants to know only which host is meant need not compile the project again for a spec that was edited.
    """
    memo, manifest = _read(path_of(project)), str(project / MANIFEST)
    if memo is None or manifest not in memo["files"] or memo["files"][manifest] != _digest(project / manifest):
        return None
    return from_json(memo["plan"]).host


def _read(path: Path) -> dict[str, Any] | None:
    """The memo, if it is a plain file of ours, whole, in the format of this version."""
    try:
        if path.is_symlink() or path.stat().st_uid != os.getuid():
            return None
        seal, _, text = files.read(path).partition(b"\n")
    except OSError:
        return None  # no memo: the long way
    if seal.decode("ascii", "replace") != digest.of_bytes(text):
        return None  # cut or edited: a complete plan reports what is wrong, if anything is
    try:
        return files.record(files.parse(text), FORMAT)
    except ValueError:
        return None


def _same(memo: Mapping[str, Any], project: Path, environ: Mapping[str, str]) -> bool:
    if memo["program"] != program() or memo["environment"] != variables(memo["variables"], environ):
        return False
    if memo["files"] != digests(project, memo["files"]) or memo["names"] != names(project, memo["names"]):
        return False
    return bool(memo["hardware"] == host.fingerprint(host.root_from_environment(environ)).digest)


def program() -> dict[str, str]:
    """The running octoform: version, interpreter, and the package's own files by name, size and time."""
    version, executable = octoform.__version__, sys.executable
    return {"octoform": version, "python": sys.version, "executable": executable, "build": build_of(PACKAGE)}


def build_of(package: Path) -> str:
    """Digest over name, size and time of every file of a package: an installed one, or a checkout being edited."""
    return digest.of_value(_listing(str(package)))


def _listing(folder: str) -> list[list[object]]:
    found: list[list[object]] = []
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda item: item.name):
            if entry.is_dir():
                found += _listing(entry.path) if entry.name not in _UNREAD else []
            else:
                facts = entry.stat()
                found.append([entry.name, facts.st_size, facts.st_mtime_ns])
    return found


def variables(chosen: Iterable[str], environ: Mapping[str, str]) -> dict[str, str]:
    """The environment variables that a plan reads: octoform's own, and whether the manifest's are set.

    The values of the manifest's variables are in no key and may be secrets, so not even a digest of them is kept.
    """
    fields = {name: "set" if environ.get(name) else "unset" for name in sorted(chosen)}
    return {**fields, **{name: environ.get(name, "") for name in SETTINGS}}


def digests(project: Path, files: Iterable[str]) -> dict[str, str | None]:
    """Digest of each file, None where it cannot be read; a link is distinguished from a file of the same bytes."""
    return {name: _digest(project / name) for name in files}


def _digest(path: Path) -> str | None:
    try:
        found = digest.of_file(path)
        return f"{path.readlink()} {found}" if path.is_symlink() else found
    except OSError:
        return None


def names(project: Path, folders: Iterable[str]) -> dict[str, list[str]]:
    """Every name below each folder, so that a new file, folder or link is noticed; caches of Python are omitted."""
    return {folder: sorted(_below(f"{project}/{folder}", folder)) for folder in folders}


def _below(path: str, name: str) -> Iterator[str]:
    try:
        with os.scandir(path) as entries:
            found = sorted(entries, key=lambda entry: entry.name)
    except OSError:
        return  # not there (its name is missing, too) or closed to this user
    yield name + "/"
    for entry in found:
        if entry.name == "__pycache__":
            continue
        if entry.is_dir(follow_symlinks=False):
            yield from _below(entry.path, f"{name}/{entry.name}")
        else:
            yield f"{name}/{entry.name}"


def _dirty(project: Path, memo: Mapping[str, Any]) -> tuple[str, ...] | None:
    """Which of the project's own sources git calls changed; None when git cannot say, and the long way shows why."""
    from octoform.state.git_access import RepositoryRefused, call  # only after a commit since the last apply

    inside = [name for name in memo["sources"] if (project / name).is_relative_to(project)]
    options = ["--porcelain=v1", "-z", "--no-renames", "--ignore-submodules=all"]
    try:
        done = call(str(project), ["status", *options, "--", *inside])
    except (OSError, RepositoryRefused):
        return None
    if done.returncode != 0:
        return None
    where = repository(project)
    if where is None:
        return None
    entries = [where.root / entry[3:] for entry in os.fsdecode(done.stdout).split("\0") if entry]
    return tuple(sorted(os.path.relpath(entry, project.resolve()) for entry in entries))


def rests_on(
    project: Path, host_name: str, sources: Iterable[str], chosen: Iterable[str], environ: Mapping[str, str]
) -> dict[str, Any]:
    """All that a plan is made from, as it is now; ``sources`` are the files of manifest, specs, schemas and profiles.

    To be taken before the plan is made: what moves meanwhile then differs from what is kept, and the memo is no hit.
    """
    listed = names(project, ["protocol", f"state/{host_name}"])
    below = (name for group in listed.values() for name in group if not name.endswith("/"))
    files = sorted({*sources, *below, *(f".octoform/{host_name}/{name}" for name in LOCAL)})
    wanted = sorted(chosen)
    return {
        "program": program(),
        "variables": wanted,
        "environment": variables(wanted, environ),
        "sources": sorted(sources),
        "files": digests(project, files),
        "names": listed,
        "hardware": host.fingerprint(host.root_from_environment(environ)).digest,
    }


def document(made: Remembered, ground: Mapping[str, Any]) -> bytes:
    """The memo of a plan without work, made from ``ground`` (see `rests_on`): its own digest, then one line of JSON."""
    lines = [diagnostics.to_json(item) for item in made.diagnostics]
    text = digest.canonical_json({"format": FORMAT, **ground, "plan": to_json(made.plan), "diagnostics": lines})
    return digest.of_bytes(text).encode() + b"\n" + text
