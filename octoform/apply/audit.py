"""What an agent may not touch: the manifest, specs, profiles and accepted artifacts are compared after every attempt.

An agent has one folder and one file to write. A change of anything else that octoform answers for is undone and fails
the attempt, by name; other new or changed files in the project are told, since a person may be at work there too. For
the same reason nothing that is undone is lost: it is kept in the attempt's folder.
"""

import os
import shutil
import stat
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from octoform.diagnostics import Diagnostic, error, warning

MOST_FILES = 5000
_SKIPPED = {"node_modules", "__pycache__"}


@dataclass(frozen=True, slots=True)
class _There:
    """What lies at a path: a plain file with its bytes, a link with its target, or something else."""

    kind: str
    data: bytes = b""


@dataclass(frozen=True, slots=True)
class Watch:
    """What lies at the guarded paths (None: nothing) and what else lay in the project, by size and time.

    ``real`` are the folders above the guarded paths that were no links.
    """

    project: Path
    guarded: Mapping[Path, _There | None]
    real: frozenset[Path]
    folders: tuple[Path, ...]
    seen: Mapping[Path, tuple[int, int]]


def begin(project: Path, files: Iterable[Path], folders: Iterable[Path]) -> Watch:
    """Remember ``files``, all files below ``folders``, and the sizes and times of the rest of the project."""
    folders = tuple(folders)
    guarded = {path: _look(path) for path in files}
    for folder in folders:
        guarded |= {path: _look(path) for path in _files(folder)}
    above = {parent for path in guarded for parent in path.parents if parent.is_relative_to(project)}
    real = frozenset(parent for parent in above if parent.is_dir() and not parent.is_symlink())
    return Watch(project, guarded, real, folders, _listing(project))


def end(watch: Watch, undone: Path) -> list[Diagnostic]:
    """Put back what was changed and say so; an empty list when the attempt kept to its folder.

    ``undone`` is a folder, made when it is needed, for what the changed files had become.
    """
    found = []
    for path, before in watch.guarded.items():
        if _look(path) == before:
            continue
        if not path.is_relative_to(watch.project):
            found.append(_shared(path))
            continue
        kept = _keep(watch, path, undone)
        _restore(watch, path, before)
        found.append(_touched(watch, path, kept))
    for folder in watch.folders:
        for path in _files(folder):
            if path not in watch.guarded:
                kept = _keep(watch, path, undone)
                path.unlink()
                found.append(_touched(watch, path, kept))
    found += _strangers(watch)
    return found


def _shared(path: Path) -> Diagnostic:
    """The installation serves other projects and may just have been brought up to date, so it is not put back."""
    return error(
        "APPLY-OUTSIDE-WRITE",
        "a file of octoform's installation was changed while the agent ran; it was left as it is",
        path=str(path),
        hint="if you have just installed another octoform, apply again; if not, install it anew",
    )


def _keep(watch: Watch, path: Path, undone: Path) -> Path | None:
    """A copy of what a file has become; None when no plain file lies there, or the copy cannot be written."""
    there = _look(path)
    if there is None or there.kind != "file":
        return None
    copy = undone / _name(watch.project, path).lstrip("/")
    try:
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(there.data)
    except OSError:
        return None  # the agent has filled the disk or made away with its folder; both are told elsewhere
    return copy


def _touched(watch: Watch, path: Path, kept: Path | None) -> Diagnostic:
    return error(
        "APPLY-OUTSIDE-WRITE",
        "a file that is not the agent's own was changed while it ran; the change was undone",
        path=_name(watch.project, path),
        detail=f"what it had become is kept in {_name(watch.project, kept)}" if kept else None,
        hint="an attempt may write only in its own folder; do not edit these files while an apply runs",
    )


def _strangers(watch: Watch) -> list[Diagnostic]:
    now = _listing(watch.project)
    changed = sorted(path for path, facts in now.items() if watch.seen.get(path) != facts and path not in watch.guarded)
    return [
        warning(
            "APPLY-OUTSIDE-WRITE",
            "a file of the project was written while the agent ran; it was left as it is",
            path=_name(watch.project, path),
        )
        for path in changed[:20]
    ]


def _name(project: Path, path: Path) -> str:
    return str(path.relative_to(project)) if path.is_relative_to(project) else str(path)


def _look(path: Path) -> _There | None:
    """Never follows a link, and never waits for a pipe that was put in a file's place."""
    try:
        mode = path.lstat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None
    if stat.S_ISLNK(mode):
        return _There("link", os.fsencode(path.readlink()))
    return _There("file", path.read_bytes()) if stat.S_ISREG(mode) else _There("other")


def _restore(watch: Watch, path: Path, before: _There | None) -> None:
    """Put back what was there; folders that went, or became files or links, are made again."""
    for parent in reversed(path.parents):
        if parent in watch.real and (parent.is_symlink() or not parent.is_dir()):
            parent.unlink(missing_ok=True)
            parent.mkdir()
    _clear(path)
    if before is None or before.kind == "other":
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    if before.kind == "link":
        path.symlink_to(os.fsdecode(before.data))
    else:
        path.write_bytes(before.data)


def _clear(path: Path) -> None:
    there = _look(path)
    if there is not None and there.kind == "other" and path.is_dir():
        shutil.rmtree(path)
    elif there is not None:
        path.unlink()


def _files(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(Path(root) / name for root, _, names in os.walk(folder) for name in names)


def _listing(project: Path) -> dict[Path, tuple[int, int]]:
    """Size and time of the project's visible files, bounded; hidden folders (git, environments) are left out."""
    found: dict[Path, tuple[int, int]] = {}
    for root, folders, names in os.walk(project):
        folders[:] = sorted(name for name in folders if not name.startswith(".") and name not in _SKIPPED)
        for name in names:
            if len(found) >= MOST_FILES:
                return found
            path = Path(root) / name
            try:
                facts = path.lstat()
            except FileNotFoundError:  # gone since the folder was read: nothing to compare
                continue
            found[path] = (facts.st_size, facts.st_mtime_ns)
    return found
