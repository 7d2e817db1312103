"""Locks on files, as the kernel knows them: no text that anyone wrote makes one, and they end with their holder.

Standard library only.
"""

import contextlib
import fcntl
import os
from collections.abc import Iterator
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


@contextlib.contextmanager
def held(path: Path, *, wait: bool = True, shared: bool = False) -> Iterator[bool]:
    """Hold a lock (flock) on the file, made where there is none; False inside, without waiting, while others keep it.

    OSError when it cannot be opened, as a link or a folder cannot.
    """
    how = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    try:
        try:
            fcntl.flock(descriptor, how if wait else how | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
        else:
            yield True
    finally:
        os.close(descriptor)
