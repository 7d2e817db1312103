"""Files that come, go and change, told by the kernel for each folder of a changing list. (Light.)

Folders are watched and not files: a file is replaced by renaming another one over it, and a watch on the file would
stay with the one that is gone. Of each folder only the names count that somebody else writes, so that what the daemon
itself writes never wakes it.
"""

import errno
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from inotify_simple import INotify, flags

from octoform.daemon.model import Cause

_CHANGED = flags.CREATE | flags.CLOSE_WRITE | flags.MOVED_TO | flags.MOVED_FROM | flags.DELETE | flags.ATTRIB
_SELF = flags.DELETE_SELF | flags.MOVE_SELF
_GONE = flags.IGNORED | flags.UNMOUNT


@dataclass(frozen=True, slots=True)
class Watch:
    """A folder, and what is said when something in it changes.

    ``names`` are the only ones that count, each with a cause of its own; without them every name counts but hidden
    ones and bytecode. ``written`` counts every write to a file, also while it stays open.
    """

    folder: Path
    cause: Cause
    names: Mapping[str, Cause] = field(default_factory=dict)
    written: bool = False

    @property
    def causes(self) -> frozenset[Cause]:
        """Everything that a change in it may be."""
        return frozenset((self.cause, *self.names.values()))

    def of(self, name: str) -> Cause | None:
        """The cause that a changed name is; None when it does not count."""
        if self.names:
            return self.names.get(name)
        return None if name.startswith(".") or name == "__pycache__" else self.cause


class FolderEar:
    """Listens to the folders that ``wanted`` names, as far as they are there.

    With ``resync`` the list is asked for again at once when something changed, and not only at the next `follow`.
    """

    every = None

    def __init__(self, wanted: Callable[[], Iterable[Watch]], hold: float = 0.0, *, resync: bool = False) -> None:
        self.hold = hold
        self._wanted = wanted
        self._resync = resync
        self._inotify = INotify(nonblocking=True)
        self._watches: dict[int, Watch] = {}
        self._missing: tuple[Path, ...] = ()
        self._stale = True
        self.unwatched: tuple[Watch, ...] = ()
        """What could not be watched, because the user's watches are used up (`octoform.daemon.observe.polling`)."""
        self.follow()

    def fileno(self) -> int | None:
        """Readable when something changed."""
        return int(self._inotify.fileno())

    def follow(self) -> None:
        """Bring the list of folders up to date, if anything was heard or a folder is there that was not."""
        if not (self._stale or any(folder.is_dir() for folder in self._missing)):
            return
        self._stale, self.unwatched = False, ()
        missing, kept = [], {}
        for watch in self._wanted():
            number = self._watch(watch)
            if number is None:
                missing.append(watch.folder)
            else:
                kept[number] = watch
        for number in set(self._watches) - set(kept):
            with suppress(OSError):  # it went with its folder
                self._inotify.rm_watch(number)
        self._watches, self._missing = kept, tuple(missing)

    def hear(self) -> frozenset[Cause]:
        """The causes of what changed since the last time."""
        found: set[Cause] = set()
        for event in self._inotify.read(timeout=0):
            mask = int(event.mask)
            if mask & flags.Q_OVERFLOW:
                self._stale = True
                found.update(cause for watch in self._watches.values() for cause in watch.causes)
                continue
            watch = self._watches.get(event.wd)
            if watch is None:
                continue
            if mask & (_SELF | _GONE):
                self._lost(event.wd)
                found.add(watch.cause)
            elif (cause := watch.of(event.name)) is not None:
                found.add(cause)
        self._stale = self._stale or bool(found)
        if self._resync:
            self.follow()
        return frozenset(found)

    def close(self) -> None:
        """Listen to nothing any more."""
        self._inotify.close()

    def _lost(self, number: int) -> None:
        """The folder itself is gone or was moved away: another one may stand in its place later."""
        self._stale = True
        self._watches.pop(number, None)
        with suppress(OSError):
            self._inotify.rm_watch(number)

    def _watch(self, watch: Watch) -> int | None:
        mask = int(_CHANGED | _SELF | flags.ONLYDIR | (flags.MODIFY if watch.written else 0))
        try:
            return int(self._inotify.add_watch(watch.folder, mask))
        except OSError as problem:
            if problem.errno == errno.ENOSPC:
                self.unwatched += (watch,)
            return None
