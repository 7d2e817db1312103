"""Whether some process holds a lock on a file, as the kernel knows it: no text that anyone wrote makes it so.

Standard library only.
"""

import fcntl
import os
from pathlib import Path


def is_locked(path: Path) -> bool:
    """Whether a process of this kernel keeps an exclusive lock (flock) on the file; the kernel frees it when that dies.

    OSError when the file cannot be opened, as a link cannot.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False
