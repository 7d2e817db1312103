"""What an agent may not touch: the manifest, specs, profiles and accepted artifacts are compared after every attempt.

An agent has one folder and one file to write. A change of anything else that octoform answers for is undone and fails
the attempt, by name; so is a new file where one would be read as instruction. Other new or changed files in the
project, and what is new in the person's home folder, are told, since a person may be at work there too. For the same
reason nothing that is undone is lost: it is kept in the attempt's folder.
"""

import os
import shutil
import stat
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from octoform.base import files
from octoform.diagnostics import Diagnostic, error, warning

MOST_FILES = 5000
_SKIPPED = {"node_modules", "__pycache__"}


@dataclass(frozen=True, slots=True)
class _There:
    """What lies at a path: a plain file with bytes and mode, a link with its target, something else, or what is closed.

    What is closed lies where this user may not look.
    """

    kind: str
    data: bytes = b""
    mode: int = 0


@dataclass(frozen=True, slots=True)
class Guarded:
    """What is to be as it was: files and whole folders, none of which need exist.

    No folder of ``rooms`` may get another entry, and none of ``starts`` another file that an interpreter runs at its
    start; an entry in ``home`` is told. What is ``installed``, a file or a room, is told and never put back.
    ``spared`` tells, at the beginning and at the end, where another run is at work.
    """

    files: Iterable[Path]
    folders: Iterable[Path]
    rooms: Iterable[Path] = ()
    home: Path | None = None
    installed: frozenset[Path] = frozenset()
    spared: Callable[[], tuple[Path, ...]] = tuple
    starts: Iterable[Path] = ()


@dataclass(frozen=True, slots=True)
class Watch:
    """What lies at the guarded paths (None: nothing) and what else lay in the project, by size and time.

    ``real`` are the folders at and above the guarded paths that were no links; every path below ``folders`` that is in
    neither of both was not there.
    """

    project: Path
    guarded: Mapping[Path, _There | None]
    real: frozenset[Path]
    folders: tuple[Path, ...]
    rooms: Mapping[Path, frozenset[str]]
    home: tuple[Path, frozenset[str]] | None
    seen: Mapping[Path, tuple[int, int]]
    installed: frozenset[Path]
    busy: tuple[Path, ...]
    spared: Callable[[], tuple[Path, ...]]
    starts: Mapping[Path, frozenset[str]]


def begin(project: Path, wanted: Guarded) -> Watch:
    """Remember what is guarded, and the sizes and times of the rest of the project."""
    folders = tuple(wanted.folders)
    guarded = {path: _look(path) for path in (*wanted.files, *folders)}
    for folder in folders:
        guarded |= {path: _look(path) for path in _files(folder)}
    above = {parent for path in guarded for parent in path.parents if parent.is_relative_to(project)}
    within = {path for folder in folders for path in _folders(folder)}
    real = frozenset(place for place in above | within if place.is_dir() and not place.is_symlink())
    rooms = {room: _names(room) for room in wanted.rooms}
    starts = {room: _names(room, _at_start) for room in wanted.starts}
    home = (wanted.home, _names(wanted.home)) if wanted.home else None
    listing, busy = _listing(project), wanted.spared()
    kept = (wanted.installed, busy, wanted.spared, starts)
    return Watch(project, guarded, real, folders, rooms, home, listing, *kept)


def end(watch: Watch, undone: Path) -> list[Diagnostic]:
    """Put back what was changed and say so; an empty list when the attempt kept to its folder.

    ``undone`` is a folder, made when it is needed, for what the changed files had become.
    """
    watch = replace(watch, busy=(*watch.busy, *watch.spared()))
    found = []
    for path, before in watch.guarded.items():
        if _look(path) == before or _is_spared(watch, path):
            continue
        if path in watch.installed:
            found.append(_shared(path))
            continue
        if before is None and path in watch.folders and path.is_dir() and not path.is_symlink():
            continue  # a new folder: what is in it goes below
        kept = _keep(watch, path, undone)
        _restore(watch, path, before)
        found.append(_touched(watch, path, kept))
    for folder in watch.folders:
        found += _new(watch, folder, undone)
    found += _entered(watch, undone)
    found += _strangers(watch)
    return found


def _entered(watch: Watch, undone: Path) -> list[Diagnostic]:
    """Take away what has come to folders in which files count by their mere presence."""
    found = []
    for rooms, counts in ((watch.rooms, _is_entry), (watch.starts, _at_start)):
        for room, names in rooms.items():
            for path in (room / name for name in sorted(_names(room, counts) - names)):
                if room in watch.installed:
                    found.append(_shared(path))
                elif not _is_spared(watch, path):
                    found.append(_touched(watch, path, _keep(watch, path, undone)))
                    _clear(path)
    return found


def _new(watch: Watch, folder: Path, undone: Path) -> list[Diagnostic]:
    """Take away what was not there before: files, links and whatever else, then the folders that held nothing more."""
    found = []
    for path in _files(folder):
        if path not in watch.guarded and not _is_spared(watch, path):
            kept = _keep(watch, path, undone)
            path.unlink()
            found.append(_touched(watch, path, kept))
    for path in sorted(_folders(folder), reverse=True):
        if path not in watch.real and not path.is_symlink() and not _is_spared(watch, path):
            path.rmdir()
            if not found:
                found.append(_touched(watch, path, None))
    return found


def _is_spared(watch: Watch, path: Path) -> bool:
    return any(path.is_relative_to(place) for place in watch.busy)


def _shared(path: Path) -> Diagnostic:
    """The installation serves other projects and may just have been brought up to date, so it is not put back."""
    return error(
        "APPLY-OUTSIDE-WRITE",
        "a file of octoform's installation was changed while the agent ran; it was left as it is",
        path=str(path),
        hint="if you have just installed another octoform, apply again; if not, install it again",
    )


def _keep(watch: Watch, path: Path, undone: Path) -> Path | None:
    """What has become of a file, out of its place; None when nothing can be kept of it, or there is no room.

    A folder is moved, so that nothing of a person's is lost; a link is told by a file that holds its target.
    """
    there = _look(path)
    if there is None or (there.kind == "other" and not path.is_dir()):
        return None
    copy = undone / _name(watch.project, path).lstrip("/")
    try:
        copy.parent.mkdir(parents=True, exist_ok=True)
        if there.kind == "other":
            shutil.move(path, copy)
        else:
            files.replace(copy, there.data, 0o644, synced=False)
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
    if watch.home is not None:
        folder, names = watch.home
        above = {place for path in (watch.project, *watch.guarded) for place in (path, *path.parents)}
        changed += [path for path in (folder / name for name in sorted(_names(folder) - names)) if path not in above]
    return [
        warning(
            "APPLY-OUTSIDE-WRITE",
            "a file outside of the attempt's folder was written while the agent ran; it was left as it is",
            path=_name(watch.project, path),
            hint="see whether it is yours; an agent that runs in a sandbox cannot write there",
        )
        for path in changed[:20]
    ]


def _name(project: Path, path: Path) -> str:
    return str(path.relative_to(project)) if path.is_relative_to(project) else str(path)


def _look(path: Path) -> _There | None:
    """Never follows a link, and never waits for a pipe that was put in a file's place."""
    try:
        mode = path.lstat().st_mode
        if stat.S_ISLNK(mode):
            return _There("link", os.fsencode(path.readlink()))
        return _There("file", files.read(path), stat.S_IMODE(mode)) if stat.S_ISREG(mode) else _There("other")
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError:  # closed to this user, or larger than anything that is read as instruction
        return _There("closed")


def _restore(watch: Watch, path: Path, before: _There | None) -> None:
    """Put back what was there; folders that went, or became files or links, are made again."""
    for parent in reversed(path.parents):
        if parent in watch.real and (parent.is_symlink() or not parent.is_dir()):
            parent.unlink(missing_ok=True)
            parent.mkdir()
    if before is not None and before.kind == "closed":
        return  # nobody knows what stood there; that it can be seen now is told
    _clear(path)
    if before is None or before.kind == "other":
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    if before.kind == "link":
        path.symlink_to(os.fsdecode(before.data))
        return
    files.replace(path, before.data, before.mode)
    path.chmod(before.mode)


def _clear(path: Path) -> None:
    there = _look(path)
    if there is not None and there.kind == "other" and path.is_dir():
        shutil.rmtree(path)
    elif there is not None:
        path.unlink()


def _files(folder: Path) -> list[Path]:
    """All that lies below a folder and is none itself; a link to a folder is a link."""
    found = []
    for root, folders, names in os.walk(folder):
        links = (name for name in folders if (Path(root) / name).is_symlink())
        found += [Path(root) / name for name in (*names, *links)]
    return sorted(found)


def _folders(folder: Path) -> list[Path]:
    """The folder and all folders below it."""
    return [Path(root) for root, _, _ in os.walk(folder)]


def _at_start(name: str) -> bool:
    """Whether an interpreter runs a file of that name among its packages before anything else (site, Python docs)."""
    return name.endswith(".pth") or name in ("sitecustomize.py", "usercustomize.py")


def _is_entry(name: str) -> bool:
    return name != "__pycache__"


def _names(room: Path, counts: Callable[[str], bool] = _is_entry) -> frozenset[str]:
    try:
        return frozenset(path.name for path in room.iterdir() if counts(path.name))
    except OSError:
        return frozenset()


def _own_streams() -> set[tuple[int, int]]:
    """Where octoform itself prints: a person may have sent that into a file of the project."""
    found = set()
    for number in (1, 2):
        try:
            facts = os.fstat(number)
        except OSError:
            continue  # closed
        found.add((facts.st_dev, facts.st_ino))
    return found


def _listing(project: Path) -> dict[Path, tuple[int, int]]:
    """Size and time of the project's visible files, bounded; hidden folders (git, environments) are left out."""
    found: dict[Path, tuple[int, int]] = {}
    own = _own_streams()
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
            if (facts.st_dev, facts.st_ino) not in own:
                found[path] = (facts.st_size, facts.st_mtime_ns)
    return found
