"""The emergency stop's latch: a file, because it has to outlive the process and be seen by every other one.

The gate asks at every call, so asking costs one look at the file's status. Whatever is at that place counts as
engaged, readable or not: a damaged latch must never set an arm free. Latching never waits for anything; clearing does.
"""

import contextlib
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from octoform.base import clock, files
from octoform.base.clock import stamp
from octoform.base.files import private_folder
from octoform.base.locks import acquire, lock_file

_TEXT = 500
_SIZE = 16 * 1024


@dataclass(frozen=True, slots=True)
class Estop:
    """The person who engaged it, why, and since when (UTC, ISO 8601). An unreadable latch has a ``reason`` too."""

    by: str
    reason: str
    since: str


class Latch:
    """The latch at ``path``. Safe to use from threads and from several processes at once."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._place = str(path)
        self._seen: tuple[tuple[int, int, int], Estop] | None = None
        self._forced: Estop | None = None
        self.wordless: OSError | None = None
        """Why the latch that this object made has neither who nor why; None when it does."""

    def engaged(self) -> Estop | None:
        """The record of its engagement; None when it is open. A place that cannot be looked at counts as engaged."""
        try:
            status = os.lstat(self._place)
        except FileNotFoundError:
            return self._forced
        except OSError as problem:
            return Estop("unknown", f"the latch {self.path} cannot be looked at: {problem.strerror}", "")
        stamp = _stamp(status)
        seen = self._seen
        if seen is None or seen[0] != stamp:
            self._seen = seen = (stamp, self._read(status.st_mtime))
        return seen[1]

    def engage(self, by: str, reason: str) -> Estop:
        """Latch it at once; one that is engaged already stays as it is. What engaged it comes back.

        OSError when no file can be made; the latch then holds in this object, hence in this process alone.
        """
        estop = Estop(by[:_TEXT], reason[:_TEXT], stamp())
        try:
            private_folder(self.path.parent)
            self._create(estop)
        except OSError:
            self._forced = estop
            raise
        return self.engaged() or estop

    def keep(self) -> None:
        """Put the latch on the disk, so that it outlives a power cut too; may take as long as the disk does."""
        for place in (self.path, self.path.parent):
            descriptor = os.open(place, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)

    def clear(self, by: str) -> Estop | None:
        """Open it and give back what had engaged it; None when it was open. OSError when the file cannot go.

        ``by`` may not be empty: somebody has to answer for it, and the caller records who.
        """
        if not by:
            raise ValueError("no person is named who clears the latch")
        before = self.engaged()
        with contextlib.suppress(FileNotFoundError):
            self.path.unlink()
        self._forced = self.wordless = None
        return before

    @contextlib.contextmanager
    def held(self, seconds: float) -> Iterator[bool | None]:
        """Changes of the latch and their records in one order: True inside while no other holds this.

        Waits up to ``seconds``, then goes on with False: an emergency stop waits for no one. None where the lock file
        cannot be opened.
        """
        try:
            private_folder(self.path.parent)
            lock = lock_file(self.path.with_suffix(".lock"))
        except OSError:
            yield None
            return
        try:
            yield acquire(lock, seconds)
        finally:
            os.close(lock)

    def _create(self, estop: Estop) -> None:
        """Appears whole or not at all, and never replaces another; empty where the disk has no room for words."""
        temporary = self.path.with_name(f".{self.path.name}.{os.urandom(6).hex()}")
        fields = {"format": 1, "by": estop.by, "reason": estop.reason, "since": estop.since}
        words = json.dumps(fields).encode("ascii")
        try:
            files.create(temporary, words, synced=False)
            files.publish_new(temporary, self.path)
        except FileExistsError:
            return
        except OSError as problem:
            with contextlib.suppress(FileExistsError):
                self._create_empty(estop, problem)
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink()

    def _create_empty(self, estop: Estop, problem: OSError) -> None:
        """The latch without words; this object knows them for as long as that very file stands."""
        descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        try:
            self._seen = (_stamp(os.fstat(descriptor)), estop)
            self.wordless = problem
        finally:
            os.close(descriptor)

    def _read(self, changed: float) -> Estop:
        try:
            words = files.read_json(self.path, _SIZE, follow=False, any_text=True)
            return Estop(str(words["by"]), str(words["reason"]), str(words["since"]))
        except (OSError, ValueError, LookupError, TypeError) as problem:
            reason = f"the latch {self.path} is there but cannot be read ({type(problem).__name__})"
            return Estop("unknown", reason, clock.stamp(changed))


def _stamp(status: os.stat_result) -> tuple[int, int, int]:
    return status.st_ino, status.st_mtime_ns, status.st_size
