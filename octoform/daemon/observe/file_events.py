"""The common interface of the daemon's event sources. (Light.)"""

import errno
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from inotify_simple import INotify, flags

from octoform.base.files import walk
from octoform.daemon.model import Cause
from octoform.diagnostics import Diagnostic, warning
from octoform.endpoint.environment.model import packages_of
from octoform.endpoint.process.estop import LATCH
from octoform.endpoint.process.record import RECORD
from octoform.endpoint.published_files import read_manifest
from octoform.records import dataclass, field
from octoform.state.layout import Layout


class Ear(Protocol):
    """Listens to one thing."""

    @property
    def hold(self) -> float:
        """Seconds for which it is left alone after it was heard: what happens all the time then costs little.

        What it has to say waits in the kernel meanwhile.
        """

    @property
    def every(self) -> float | None:
        """None for an ear that the kernel wakes, else the seconds between two looks of one that has to look."""

    def fileno(self) -> int | None:
        """The descriptor that becomes readable; None while there is nothing to listen to."""

    def hear(self) -> frozenset[Cause]:
        """The causes since the last call; empty when there are none."""

    def close(self) -> None:
        """Let go of it."""


# Files that come, go and change, as the kernel reports them for each folder of a changing list. (Light.)
#
# Folders are watched and not files: a file is replaced by renaming another one over it, and a watch on the file would
# stay with the one that is gone. Of each folder only the names count that somebody else writes, so that what the daemon
# itself writes never wakes it.

_CHANGED = flags.CREATE | flags.CLOSE_WRITE | flags.MOVED_TO | flags.MOVED_FROM | flags.DELETE | flags.ATTRIB
_SELF = flags.DELETE_SELF | flags.MOVE_SELF
_GONE = flags.IGNORED | flags.UNMOUNT


@dataclass(frozen=True, slots=True)
class Watch:
    """A folder, and the cause when something in it changes.

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
        """The folders that could not be watched, because the user's watches are used up."""
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
        """The folder itself is gone or was moved away: another one may be in its place later."""
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


# The replacement for the kernel's events once a user's watches are used up: a look every few seconds. (Light.)

LOOK_SECONDS = 5.0


class Unwatched:
    """An ear for the folders that others could not watch; states nothing while there is none."""

    hold = 0.0

    def __init__(self, ears: Iterable[FolderEar]) -> None:
        self._ears = tuple(ears)

    @property
    def every(self) -> float | None:
        """Seconds between two looks; None while there is nothing to look at."""
        return LOOK_SECONDS if self.folders else None

    @property
    def folders(self) -> int:
        """How many there are now."""
        return sum(len(ear.unwatched) for ear in self._ears)

    def fileno(self) -> int | None:
        """None: nothing wakes it."""
        return None

    def hear(self) -> frozenset[Cause]:
        """Whatever may have happened there since the last look."""
        return frozenset(cause for ear in self._ears for watch in ear.unwatched for cause in watch.causes)

    def close(self) -> None:
        """There is nothing to let go of."""

    def diagnostic(self) -> Diagnostic | None:
        """The diagnostic for a person; None where every folder is watched."""
        if not self.folders:
            return None
        summary = f"{self.folders} folders are looked at every {LOOK_SECONDS:g} s only: the user's watches are used up"
        hint = "sysctl fs.inotify.max_user_watches is their number; a greater one lets the daemon hear at once"
        return warning("DAEMON-FEW-WATCHES", summary, hint=hint)


# What of a deployment is watched on disk, and what each change means. (Light.)
#
# Excluded are the files that the daemon, the endpoint in everyday work or a client write: counters, tokens, the audit
# log, episodes, readings, attempts. A daemon that woke itself would never sleep again.

MANIFEST = "octopus.yaml"
ASKED = ("paused.json", "asked.json")
"""The files that commands write into the daemon's folder to be noticed by it."""
MAX_FOLDERS = 300


def logs(layout: Layout) -> Iterator[Watch]:
    """The two logs in which problems are reported."""
    names = {layout.call_log.name: Cause.LOG, layout.server_log.name: Cause.LOG}
    yield Watch(layout.logs, Cause.FILES, names, written=True)


def signs(layout: Layout) -> Iterator[Watch]:
    """Small files by which other processes say something: who serves, who stopped it, who holds the state."""
    local = dict.fromkeys((layout.lock.name, layout.instances.name, layout.fingerprint.name), Cause.FILES)
    folders = dict.fromkeys(("endpoint", "run", "log", "daemon", "environments", "kept"), Cause.FILES)
    yield Watch(layout.local, Cause.FILES, {**local, **folders})
    run = {RECORD: Cause.PROCESS, layout.stop_mark.name: Cause.FILES, LATCH: Cause.FILES}
    yield Watch(layout.run, Cause.FILES, run)
    yield Watch(layout.daemon, Cause.FILES, dict.fromkeys(ASKED, Cause.ASKED))


def standing(layout: Layout) -> Iterator[Watch]:
    """The files that the endpoint needs: manifest, accepted files, its own files, the environment's packages."""
    yield Watch(layout.project, Cause.FILES, dict.fromkeys((MANIFEST, "state"), Cause.FILES))
    yield Watch(layout.committed.parent, Cause.FILES, {layout.host: Cause.FILES})
    for folder in (layout.committed, layout.endpoint):
        yield from (Watch(each, Cause.FILES) for each in _below(folder))
    manifest = read_manifest(layout)
    if manifest is not None:
        environment = Path(str(manifest.get("environment")))
        for each in (environment, environment / "bin", packages_of(environment)):
            yield Watch(each, Cause.FILES)


def _below(folder: Path) -> Iterator[Path]:
    """The folder and those in it, hidden ones and bytecode omitted; the folder also when it is not there."""
    yield folder
    count = 0
    for root, folders, _ in walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".") and name != "__pycache__"]
        for name in folders:
            count += 1
            if count > MAX_FOLDERS:
                return
            yield root / name
