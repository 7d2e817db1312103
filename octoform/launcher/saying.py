"""What the process says to whoever reads its log, which may stand on the very disk that has no room left.

The log of the process and the audit log share a disk. A sentence that cannot be written there must not break what it
is about: no call, no door and no emergency stop ends because its complaint found no room.
"""

import errno
import logging
import sys
import time

_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


def say(text: str) -> None:
    """Print one line to stderr, at once, with its time in front (RFC 3339, UTC), by which `octoform logs` sorts it.

    Without room on the disk it is lost; every other OSError is raised.
    """
    now = time.time()
    stamp = f"{time.strftime('%Y-%m-%dT%H:%M:%S', time.gmtime(now))}.{int(now % 1 * 1000):03d}Z"
    try:
        print(f"{stamp} octoform: {text}", file=sys.stderr, flush=True)
    except OSError as problem:
        if problem.errno not in _NO_ROOM:
            raise


class Said(logging.Handler):
    """Says what is logged, so that every line of this package has one form."""

    def emit(self, record: logging.LogRecord) -> None:
        """Say one record."""
        say(self.format(record))
