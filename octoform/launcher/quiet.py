"""Log lines that strangers can cause are few, so that nobody fills a disk by knocking. Standard library only."""

import logging
import threading
import time
from collections.abc import Callable

MOST_LINES = 60
WINDOW_SECONDS = 60.0


class Throttle(logging.Filter):
    """Lets so many records of a logger through in a minute, and tells how many it held back before the next one."""

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
            if self._lines > MOST_LINES:
                self._held += 1
                return False
            return True
