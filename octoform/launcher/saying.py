"""What the process says to whoever reads its log, which may stand on the very disk that has no room left.

The log of the process and the audit log share a disk. A sentence that cannot be written there must not break what it
is about: no call, no door and no emergency stop ends because its complaint found no room.
"""

import errno
import sys

_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


def say(text: str) -> None:
    """Print one line to stderr, at once. Without room on the disk it is lost; every other OSError is raised."""
    try:
        print(f"octoform: {text}", file=sys.stderr, flush=True)
    except OSError as problem:
        if problem.errno not in _NO_ROOM:
            raise
