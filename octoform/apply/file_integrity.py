"""Protects files from agents: the manifest, specs, profiles and accepted artifacts are compared after every attempt.

An agent has one folder and one file to write. A change of anything else that octoform answers for is undone and fails
the attempt, by name; so is a new file where one would be read as instruction. Other new or changed files in the
project, and what is new in the person's home folder, are reported, since a person may be at work there too. For the
same reason nothing that is undone is lost: it is kept in the attempt's folder.
"""

import contextlib
import errno
import os
import shutil
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

from octoform.apply.project_files import MAX_NAMED, Gaps, above, at_start, inside, is_entry, listed, listing, names_in
from octoform.base import files
from octoform.diagnostics import Diagnostic, error, warning
from octoform.records import dataclass, replace

NOT_UNDONE = "APPLY-NOT-UNDONE"
"""The code of a change that stands: no other attempt may begin, since it would be taken for a person's."""
_MAX_UNDONE = 100
_HANDLE = getattr(os, "O_PATH", os.O_RDONLY) | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC


@dataclass(frozen=True, slots=True)
class _There:
    """The content of a path: a plain file with bytes and mode, a link with its target, something else, or unreadable.

    What is closed lies where this user may not look. ``owner`` is the user and the group of a file.
    """

    kind: str
    data: bytes = b""
    mode: int = 0
    owner: tuple[int, int] = (-1, -1)


@dataclass(frozen=True, slots=True)
class Guarded:
    """The guarded paths: files and whole folders, none of which need exist.

    No folder of ``rooms`` may get another entry, and none of ``starts`` another file that an interpreter runs at its
    start; an entry in ``home`` is reported, and a change of a file of ``noted``. What is ``installed``, a file or a
    room, is reported and never put back. ``spared`` names, at the beginning and at the end, where another run is at
    work.
    """

    files: Iterable[Path]
    folders: Iterable[Path]
    rooms: Iterable[Path] = ()
    home: Path | None = None
    installed: frozenset[Path] = frozenset()
    spared: Callable[[], tuple[Path, ...]] = tuple
    starts: Iterable[Path] = ()
    noted: Iterable[Path] = ()


class _Held:
    """A folder that is found again wherever it has been moved to."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._handle = os.open(path, _HANDLE)

    def __del__(self) -> None:
        with contextlib.suppress(AttributeError, OSError):  # it could not be opened
            os.close(self._handle)

    def elsewhere(self) -> Path | None:
        """Where it lies now; None while it is in its place, once it is gone, or where the system does not say."""
        try:
            facts, now = os.fstat(self._handle), Path(f"/proc/self/fd/{self._handle}").readlink()
            moved = not self.path.is_dir() or not os.path.samestat(facts, self.path.lstat())
            return now if moved and os.path.samestat(facts, now.lstat()) else None
        except OSError:
            return None


@dataclass(frozen=True, slots=True)
class Watch:
    """The content of the guarded paths (None: nothing) and the project's other files, by size and time.

    ``real`` are the folders at and above the guarded paths that were no links; every path below ``folders`` that is in
    neither of both was not there. None of ``ways``, which lead to the guarded paths, was a link. ``held`` are the
    project's folder and those in it that lead there. ``rights`` are mode, user and group of these folders, and of the
    home's that lead to a guarded file: anyone who may write a folder may replace what is in it.
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
    noted: Mapping[Path, _There | None]
    ways: frozenset[Path]
    held: tuple[_Held, ...]
    rights: Mapping[Path, tuple[int, int, int]]


def begin(project: Path, wanted: Guarded) -> Watch:
    """Remember what is guarded, and the sizes and times of the rest of the project."""
    folders = tuple(wanted.folders)
    gaps = Gaps()
    guarded = {path: None if gaps.have(path) else _look(path) for path in (*wanted.files, *folders)}
    within: set[Path] = set()
    for folder in (folder for folder in folders if guarded[folder] is not None):
        entries, places = _below(folder)
        guarded |= {path: _look(path) for path in entries}
        within.update(places)
    over = above(guarded)
    real = frozenset(place for place in {*inside(project, over), *within} if _is_folder(place))
    rooms = {room: names_in(room) for room in wanted.rooms}
    starts = {room: names_in(room, at_start) for room in wanted.starts}
    home = (wanted.home, names_in(wanted.home)) if wanted.home else None
    seen, busy = listing(project), wanted.spared()
    below = ((top, () if gaps.have(top) else _below(top)[0]) for top in wanted.noted)
    noted = {path: _look(path) for top, entries in below for path in (top, *entries)}
    held = _held((project, *sorted(place for place in real if place.parent == project)))
    ways = _ways(project, wanted, over | above(rooms), gaps)
    rights = _rights({project, *real, *(inside(wanted.home, over) if wanted.home else ())})
    kept = (wanted.installed, busy, wanted.spared, starts, noted, ways, held, rights)
    return Watch(project, guarded, real, folders, rooms, home, seen, *kept)


def _ways(project: Path, wanted: Guarded, places: set[Path], gaps: Gaps) -> frozenset[Path]:
    """Those of the places, there or not, that are no links; not those above a project or a home."""
    passed = {*project.parents, *((wanted.home, *wanted.home.parents) if wanted.home else ())}
    return frozenset(place for place in places - passed if gaps.have(place) or not place.is_symlink())


def _is_folder(place: Path) -> bool:
    """Whether a folder is there itself, not a link to one."""
    try:
        return stat.S_ISDIR(os.lstat(place).st_mode)
    except OSError:
        return False


def _rights(folders: Iterable[Path]) -> dict[Path, tuple[int, int, int]]:
    """The rights of the folders that may be looked at, the upper ones first."""
    found = ((folder, _right(folder)) for folder in sorted(folders))
    return {folder: right for folder, right in found if right is not None}


def _right(folder: Path) -> tuple[int, int, int] | None:
    """Mode, user and group of a folder; None for what is none, or may not be looked at."""
    try:
        facts = os.lstat(folder)
    except OSError:
        return None
    return (stat.S_IMODE(facts.st_mode), facts.st_uid, facts.st_gid) if stat.S_ISDIR(facts.st_mode) else None


def _held(folders: Iterable[Path]) -> tuple[_Held, ...]:
    found = []
    for folder in folders:
        with contextlib.suppress(OSError):  # closed to this user
            found.append(_Held(folder))
    return tuple(found)


def end(watch: Watch, undone: Path) -> list[Diagnostic]:
    """Put back what was changed and say so; an empty list when the attempt kept to its folder.

    ``undone`` is a folder, made when it is needed, for what the changed files had become.
    """
    watch = replace(watch, busy=(*watch.busy, *watch.spared()))
    # First what closes the way to the rest; once more for the folders that were put back.
    found = [*_reopened(watch), *_moved_back(watch, undone), *_reopened(watch)]
    gaps = Gaps()
    found += _unlinked(watch, undone, gaps)
    for path, before in watch.guarded.items():
        if _is_other(path, before, gaps):
            with _undoing(watch, path, found):
                found += _undone(watch, path, before, undone)
            gaps.forget()
    for folder in watch.folders:
        found += _new(watch, folder, undone)
    found += _entered(watch, undone)
    found += _strangers(watch, undone)
    return found


def _is_other(path: Path, before: _There | None, gaps: Gaps) -> bool:
    """Whether something else is at a path than before."""
    return not (before is None and gaps.have(path)) and _look(path) != before


def _undone(watch: Watch, path: Path, before: _There | None, undone: Path) -> list[Diagnostic]:
    """Put back what was at a guarded path that has changed."""
    if _is_spared(watch, path):
        return []
    if path in watch.installed:
        return [_shared(path)]
    if before is None and path in watch.folders and path.is_dir() and not path.is_symlink():
        return []  # a new folder: what is in it goes below
    kept = _keep(watch, path, undone)
    _restore(watch, path, before)
    whole = before is None or before.kind != "other" or path in watch.folders
    return [_touched(watch, path, kept) if whole else _lost(watch, path, "what else lay in it is gone")]


@contextlib.contextmanager
def _undoing(watch: Watch, path: Path, found: list[Diagnostic]) -> Iterator[None]:
    """Report a refusal of the system at one path, and go on with the rest."""
    try:
        yield
    except OSError as problem:
        found.append(_not_removed(watch, path, problem))


def _reopened(watch: Watch) -> list[Diagnostic]:
    """Give folders their mode and owner again, the upper ones first."""
    found: list[Diagnostic] = []
    for folder, before in watch.rights.items():
        if _right(folder) in (before, None) or _is_spared(watch, folder):
            continue
        with _undoing(watch, folder, found):
            if _right(folder) != before:
                os.chown(folder, *before[1:], follow_symlinks=False)
                folder.chmod(before[0])
            found.append(_touched(watch, folder, None))
    return found


def _moved_back(watch: Watch, undone: Path) -> list[Diagnostic]:
    """Put folders that were moved back into their places; what has come there meanwhile is kept."""
    now = watch.held[0].elsewhere() if watch.held else None
    if now is not None:  # what lies in it is still together
        return [_lost(watch, watch.project, f"it is {now} now")]
    found = []
    for folder in watch.held[1:]:
        now = folder.elsewhere()
        if now is None:
            continue
        kept = _keep(watch, folder.path, undone)
        try:
            _clear(folder.path)
            now.rename(folder.path)  # a folder, into a free place: no file is replaced
        except OSError as problem:
            found.append(_lost(watch, folder.path, f"{problem.strerror}: {now}"))
        else:
            found.append(_touched(watch, folder.path, kept))
    return found


def _unlinked(watch: Watch, undone: Path, gaps: Gaps) -> list[Diagnostic]:
    """Take away each link that has come into a place that leads to a guarded path, which would then lie elsewhere."""
    found: list[Diagnostic] = []
    for place in sorted(place for place in watch.ways if not gaps.have(place) and _may_be_link(place)):
        with _undoing(watch, place, found):
            if place.is_symlink() and not _is_spared(watch, place):
                kept = _keep(watch, place, undone)
                place.unlink()
                if place in watch.real:
                    place.mkdir()
                found.append(_touched(watch, place, kept))
            gaps.forget()
    return found


def _may_be_link(place: Path) -> bool:
    """Whether a link is there, or what is there is unknown."""
    try:
        return stat.S_ISLNK(os.lstat(place).st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError:
        return True


def _entered(watch: Watch, undone: Path) -> list[Diagnostic]:
    """Take away what has come to folders in which files count by their mere presence."""
    found: list[Diagnostic] = []
    for rooms, counts in ((watch.rooms, is_entry), (watch.starts, at_start)):
        for room, names in rooms.items():
            for path in (room / name for name in sorted(names_in(room, counts) - names)):
                if room in watch.installed:
                    found.append(_shared(path))
                elif not _is_spared(watch, path):
                    found += _taken(watch, path, undone)
    return found


def _taken(watch: Watch, path: Path, undone: Path) -> list[Diagnostic]:
    """Take away whatever is at a path, and say so."""
    found: list[Diagnostic] = []
    with _undoing(watch, path, found):
        kept = _keep(watch, path, undone)
        _clear(path)
        found.append(_touched(watch, path, kept))
    return found


def _new(watch: Watch, folder: Path, undone: Path) -> list[Diagnostic]:
    """Take away what was not there before: files, links and whatever else, then the folders that held nothing more."""
    found: list[Diagnostic] = []
    entries, places = _below(folder)
    for path in entries:
        if path not in watch.guarded and not _is_spared(watch, path):
            found += _taken(watch, path, undone)
    for path in sorted(places, reverse=True):
        if path in watch.real or path.is_symlink() or _is_spared(watch, path):
            continue
        with _undoing(watch, path, found):
            try:
                path.rmdir()
            except OSError as problem:
                if problem.errno != errno.ENOTEMPTY:
                    raise
                found += _taken(watch, path, undone)  # what is nested too deep to be read
                continue
            if not found:
                found.append(_touched(watch, path, None))
    return _bounded(found)


def _bounded(found: list[Diagnostic]) -> list[Diagnostic]:
    """A bounded report on thousands of files: the first ones, and the number of the rest."""
    more = [item for item in found if item.code != NOT_UNDONE][_MAX_UNDONE:]
    if not more:
        return found
    summary = f"{len(more)} more files that are not the agent's own were changed while it ran; the changes were undone"
    result = error("APPLY-OUTSIDE-WRITE", summary, detail=listed([item.path or "" for item in more]))
    return [*(item for item in found if item not in more), result]


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
    """Keep a changed file away from its place; None when nothing can be kept of it, or there is no room.

    A folder is moved, so that nothing of a person's is lost; a link is recorded as a file with its target.
    """
    there = _look(path)
    if there is None or (there.kind == "other" and not path.is_dir()):
        return None
    copy = undone / _name(watch.project, path).lstrip("/")
    try:
        copy.parent.mkdir(parents=True, exist_ok=True)
        if there.kind == "other":
            shutil.move(path, copy)  # a folder, perhaps from another file system
        else:
            files.replace(copy, there.data, 0o644, synced=False)
    except (OSError, RecursionError):
        return None  # the agent has filled the disk or made away with its folder; both are reported elsewhere
    return copy


def _not_removed(watch: Watch, path: Path, problem: OSError) -> Diagnostic:
    how = "`lsattr` shows whether it was made immutable (`chattr -i` ends that)"
    if problem.errno == errno.EBUSY:
        how = "`findmnt` shows what was mounted there (`umount` ends that)"
    return error(
        NOT_UNDONE,
        "a file that is not the agent's own was changed while it ran, and the change could not be undone",
        path=_name(watch.project, path),
        detail=problem.strerror,
        hint=f"undo it yourself before you apply again: {how}",
    )


def _touched(watch: Watch, path: Path, kept: Path | None) -> Diagnostic:
    return error(
        "APPLY-OUTSIDE-WRITE",
        "a file that is not the agent's own was changed while it ran; the change was undone",
        path=_name(watch.project, path),
        detail=f"what it had become is kept in {_name(watch.project, kept)}" if kept else None,
        hint="an attempt may write only in its own folder; do not edit these files while an apply runs",
    )


def _lost(watch: Watch, path: Path, detail: str) -> Diagnostic:
    return error(
        "APPLY-OUTSIDE-WRITE",
        "a folder was taken away while the agent ran, and it could not be put back",
        path=_name(watch.project, path),
        detail=detail,
        hint="put it back yourself, from where it is now or from your backup",
    )


def _strangers(watch: Watch, undone: Path) -> list[Diagnostic]:
    now = listing(watch.project)
    new = (path for path, facts in now.items() if watch.seen.get(path) != facts and not path.is_relative_to(undone))
    gaps = Gaps()
    changed = [path for path, before in watch.noted.items() if _is_other(path, before, gaps)]
    tops = (top for top in watch.noted if not gaps.have(top) and top.is_dir())
    changed += [path for top in tops for path in _below(top)[0] if path not in watch.noted]
    changed += sorted(path for path in new if path not in watch.guarded)
    if watch.home is not None:
        folder, names = watch.home
        come = [folder / name for name in sorted(names_in(folder) - names)]
        ours = {watch.project, *watch.guarded, *above((watch.project, *watch.guarded))} if come else set()
        changed += [path for path in come if path not in ours]
    hint = "check if it is yours; an agent that runs in a sandbox cannot write there"
    summary = "a file outside of the attempt's folder was written while the agent ran; it was left as it is"
    named = [_name(watch.project, path) for path in changed]
    found = [warning("APPLY-OUTSIDE-WRITE", summary, path=name, hint=hint) for name in named[:MAX_NAMED]]
    more = named[MAX_NAMED:]
    if more:
        summary = f"{len(more)} more files outside of the attempt's folder were written; they were left as they are"
        found.append(warning("APPLY-OUTSIDE-WRITE", summary, detail=listed(more), hint=hint))
    return found


def _name(project: Path, path: Path) -> str:
    return str(path.relative_to(project)) if project in path.parents else str(path)


def _look(path: Path) -> _There | None:
    """Never follows a link, and never waits for a pipe that was put in a file's place."""
    try:
        facts = os.lstat(path)
        mode = facts.st_mode
        if stat.S_ISLNK(mode):
            return _There("link", os.fsencode(path.readlink()))
        if not stat.S_ISREG(mode):
            return _There("other")
        return _There("file", files.read(path), stat.S_IMODE(mode), (facts.st_uid, facts.st_gid))
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
        return  # the former content is unknown; that the file can be read now is reported
    _clear(path)
    if before is None or before.kind == "other":
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    if before.kind == "link":
        path.symlink_to(os.fsdecode(before.data))
        return
    files.replace(path, before.data, before.mode)
    with contextlib.suppress(PermissionError):  # an ordinary user's file was and is that user's
        os.chown(path, *before.owner)
    path.chmod(before.mode)


def _clear(path: Path) -> None:
    there = _look(path)
    if there is not None and there.kind == "other" and path.is_dir():
        files.remove_tree(path)
    elif there is not None:
        path.unlink()


def _below(folder: Path) -> tuple[list[Path], list[Path]]:
    """All that lies below a folder and is none itself (a link to a folder is a link); the folder and all below it."""
    entries, places = [], []
    for root, folders, names in files.walk(folder):
        places.append(root)
        links = (name for name in folders if (root / name).is_symlink())
        entries += [root / name for name in (*names, *links)]
    return sorted(entries), places
