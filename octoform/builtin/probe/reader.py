"""The only way PROBE touches the file system: small text reads below one root, with every failure counted.

sysfs answers with EIO, EACCES or ENODATA in everyday life, and a sick driver may not answer at all. A failed read is
a None here and a line in the scan's detail, never an exception. Nothing under ``/dev`` is ever opened: the class
refuses it, so that no mistake in a table can make PROBE open a device node.
"""

import errno
import math
import os
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from octoform.base import shortage
from octoform.records import dataclass

ATTRIBUTE_BYTES = 4096
ORDINARY_ABSENCE = (errno.ENOENT, errno.ENOTDIR, errno.ELOOP)
_FLAGS = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOFOLLOW


class Abandoned(Exception):
    """The scan's time was over while a read hung; its late answer must not reach anything."""


class Reader:
    """Reads below ``root``; paths are absolute as the host sees them (``/sys/...``)."""

    def __init__(self, root: str) -> None:
        """``root`` is ``/`` or the folder of a recorded host."""
        self.root = root.rstrip("/")
        self.failures: Counter[str] = Counter()
        self.abandoned = False
        self.ends = math.inf
        """When the scan's time is over, on the monotonic clock."""

    def fresh(self) -> "Reader":
        """A reader of the same root with its own counters, for one scan."""
        return Reader(self.root)

    def data(self, path: str, limit: int = ATTRIBUTE_BYTES) -> bytes | None:
        """Up to ``limit`` bytes of a file, None when it cannot be read. Never opens anything below /dev."""
        if path.startswith("/dev"):
            raise ValueError(f"PROBE opens nothing below /dev: {path}")
        try:
            descriptor = os.open(self.root + path, _FLAGS)
        except OSError as problem:
            self._failed(problem)
            return None
        try:
            found = os.read(descriptor, limit)
            while limit > ATTRIBUTE_BYTES and len(found) < limit:
                more = os.read(descriptor, limit - len(found))
                if not more:
                    break
                found += more
        except OSError as problem:
            self._failed(problem)
            return None
        finally:
            os.close(descriptor)
        self.still_wanted()
        return found

    def text(self, path: str, limit: int = ATTRIBUTE_BYTES) -> str:
        """The same as text, surrounding white space removed; empty when it cannot be read."""
        found = self.data(path, limit)
        return found.decode("utf-8", "surrogateescape").strip() if found else ""

    def names(self, path: str) -> list[str]:
        """The names in a folder, sorted; OSError is the caller's to report."""
        with os.scandir((self.root + path) or "/") as entries:
            found = sorted(entry.name for entry in entries)
        self.still_wanted()
        return found

    def names_or_none(self, path: str) -> list[str]:
        """The names in a folder, empty when it cannot be listed (counted unless it is merely absent)."""
        try:
            return self.names(path)
        except OSError as problem:
            self._failed(problem)
            return []

    def link(self, path: str) -> str:
        """Where a symbolic link points, as it is written; empty when there is none."""
        try:
            return str(Path(self.root + path).readlink())
        except OSError as problem:
            if problem.errno != errno.EINVAL:
                self._failed(problem)
            return ""

    def note(self) -> str:
        """The failed reads, for the scan's detail: ``unreadable: EACCES 2, EIO 1``."""
        if not self.failures:
            return ""
        return "unreadable: " + ", ".join(f"{name} {count}" for name, count in sorted(self.failures.items()))

    def _failed(self, problem: OSError) -> None:
        self.still_wanted()
        if problem.errno not in ORDINARY_ABSENCE:
            self.failures[errno.errorcode.get(problem.errno or 0, "EUNKNOWN")] += 1

    def still_wanted(self) -> None:
        """Abandoned when the scan's time was over before what it waited for came."""
        if self.abandoned:
            raise Abandoned


# Runs each scan within its own time, so that one driver that does not answer costs seconds and not the stage.
#
# A scan runs in a thread of its own. When its time is over the thread is left behind (a read that hangs in the kernel
# cannot be ended from outside); what it found until then counts, what it would still find does not.

SCAN_SECONDS = 5.0
STATUS_OF_ERRNO = {
    errno.ENOENT: "not_found",
    errno.ENOTDIR: "not_found",
    errno.EACCES: "denied",
    errno.EPERM: "denied",
    errno.ETIMEDOUT: "timeout",
    errno.EOPNOTSUPP: "unsupported",
}
DETAIL_CHARS = 400


@dataclass(frozen=True, slots=True)
class Scan:
    """A named look at one part of the system; ``look`` stores what it finds in its own target.

    ``patience``: how many times as long as others it may take, for what is known to be slow.
    """

    name: str
    look: Callable[[Reader], None]
    patience: float = 1.0


@dataclass(frozen=True, slots=True)
class ScanReport:
    """How a scan went: status is ok, not_found, denied, unsupported, error or timeout."""

    name: str
    status: str
    detail: str
    milliseconds: float

    def as_json(self) -> dict[str, object]:
        """The entry of ``scan_methods``."""
        entry: dict[str, object] = {"name": self.name, "status": self.status}
        if self.detail:
            entry["detail"] = self.detail
        return entry | {"duration_ms": round(self.milliseconds, 1)}


def run_all(scans: list[Scan], reader: Reader, seconds: float = SCAN_SECONDS) -> list[ScanReport]:
    """Run the scans one after the other, each for at most ``seconds``; one report each, in the same order."""
    return [run_one(scan, reader.fresh(), seconds * scan.patience) for scan in scans]


def run_one(scan: Scan, reader: Reader, seconds: float) -> ScanReport:
    """Run one scan; ``reader`` is its own, and is reported when its time is over."""
    outcome: list[tuple[str, str]] = []
    started = time.monotonic()
    reader.ends = started + seconds
    thread = threading.Thread(target=_look, args=(scan, reader, outcome), daemon=True)
    shortage.start(thread)
    thread.join(seconds)
    elapsed = (time.monotonic() - started) * 1000
    if thread.is_alive():
        reader.abandoned = True
        return ScanReport(
            scan.name, "timeout", f"no answer within {seconds:g} s; what it found until then is kept", elapsed
        )
    status, detail = outcome[0] if outcome else ("error", "ended without a result")
    return ScanReport(scan.name, status, detail[:DETAIL_CHARS], elapsed)


def _look(scan: Scan, reader: Reader, outcome: list[tuple[str, str]]) -> None:
    try:
        scan.look(reader)
    except Abandoned:
        return
    except OSError as problem:
        status = STATUS_OF_ERRNO.get(problem.errno or 0, "error")
        outcome.append((status, "" if status == "not_found" else problem.strerror or "input/output error"))
    except (ValueError, KeyError, IndexError, RecursionError) as problem:
        # A kernel text of an unforeseen shape fails this one scan, which reports it.
        outcome.append(("error", f"{type(problem).__name__} while reading"))
    else:
        outcome.append(("ok", reader.note()))
