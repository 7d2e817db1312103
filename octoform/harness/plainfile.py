"""Reading small files that an agent could have put there: plain, bounded, and never through a link."""

import os
import stat
from pathlib import Path


def read_plain(path: Path, limit: int) -> bytes | None:
    """The first ``limit`` bytes of a plain file; None when there is none, or it is a link, a folder or a pipe."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            return None
        return os.read(descriptor, limit)
    finally:
        os.close(descriptor)
