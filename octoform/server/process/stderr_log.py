"""The process's log on standard error, which may be on the very disk that is full.

The log of the process and the audit log share a disk. A sentence that cannot be written there must not break what it
is about: no call, no door and no emergency stop ends because its complaint found no room.
"""

import errno
import logging
import sys
import threading
import time
from collections.abc import Callable

from octoform.base.clock import stamp

_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


def write_line(text: str) -> None:
    """Print one line to stderr, at once, with its time in front (RFC 3339, UTC), by which `octoform logs` sorts it.

    Without room on the disk it is lost; every other OSError is raised.
    """
    try:
        print(f"{stamp(digits=3)} octoform: {text}", file=sys.stderr, flush=True)
    except OSError as problem:
        if problem.errno not in _NO_ROOM:
            raise


class StderrHandler(logging.Handler):
    """States what is logged, so that every line of this package has one form."""

    def emit(self, record: logging.LogRecord) -> None:
        """Say one record."""
        write_line(self.format(record))


# Log lines that strangers can cause are few, so that no stranger fills the disk with requests. Standard library only.

MAX_LINES = 60
WINDOW_SECONDS = 60.0


class Throttle(logging.Filter):
    """Lets so many records of a logger through in a minute, and shows how many it held back before the next one."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock = clock
        self._lock = threading.Lock()
        self._began = clock()
        self._lines = 0
        self._held = 0

    def filter(self, record: logging.LogRecord) -> bool:
        """True for a record that may be written."""
        with self._lock:
            if self._clock() - self._began >= WINDOW_SECONDS:
                held, self._held, self._lines, self._began = self._held, 0, 0, self._clock()
                if held:
                    record.msg = f"({held} lines like this one were omitted before it) {record.getMessage()}"
                    record.args = ()
            self._lines += 1
            if self._lines > MAX_LINES:
                self._held += 1
                return False
            return True
