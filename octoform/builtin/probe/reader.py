"""The only way PROBE touches the file system: small text reads below one root, with every failure counted.

sysfs answers with EIO, EACCES or ENODATA in everyday life, and a sick driver may not answer at all. A failed read is
a None here and a line in the scan's detail, never an exception. Nothing under ``/dev`` is ever opened: the class
refuses it, so that no mistake in a table can make PROBE open a device node.
"""

import errno
import math
import os
from collections import Counter
from pathlib import Path

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
        """What could not be read, for the scan's detail: ``unreadable: EACCES 2, EIO 1``."""
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
