"""Locks on files, as the kernel knows them: no text that anyone wrote makes one, and they end with their holder.

A lock (flock) belongs to the open file: it ends when the last descriptor of it is closed, hence with its process. A
program that is started does not inherit it, since each file is opened with O_CLOEXEC. Standard library only.
"""

import contextlib
import fcntl
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

_PAUSE = 0.005
"""Seconds between two looks at a lock that others keep."""


def lock_file(path: Path) -> int:
    """A descriptor of the private file of a lock, made where there is none; OSError for a link or a folder."""
    return os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)


def acquire(
    descriptor: int,
    seconds: float | None = 0.0,
    *,
    shared: bool = False,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> bool:
    """Take the lock of an open file; False when others keep it for so long (None: as long as it takes).

    OSError when the file system knows no locks.
    """
    how = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
    if seconds is None:
        fcntl.flock(descriptor, how)
        return True
    end = clock() + seconds if seconds else 0.0
    while True:
        try:
            fcntl.flock(descriptor, how | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            if not seconds or clock() >= end:
                return False
        sleep(_PAUSE)


def release(descriptor: int) -> None:
    """Give the lock of an open file back, which stays open."""
    fcntl.flock(descriptor, fcntl.LOCK_UN)


def is_locked(path: Path) -> bool:
    """Whether a process of this kernel keeps an exclusive lock on the file; the kernel frees it when that dies.

    OSError when the file cannot be opened, as a link cannot.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        return not acquire(descriptor, shared=True)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def held(path: Path, seconds: float | None = None, *, shared: bool = False) -> Iterator[bool]:
    """Hold a lock on the file, made where there is none; False inside when others keep it for so long.

    OSError when it cannot be opened, as a link or a folder cannot. A file that was replaced or removed while this
    waited is not the one that others lock: the one of that name is.
    """
    while True:
        descriptor = lock_file(path)
        try:
            had = acquire(descriptor, seconds, shared=shared)
            if had and not _is_at(path, descriptor):
                continue
            yield had
            return
        finally:
            os.close(descriptor)


@contextlib.contextmanager
def held_folder(folder: Path) -> Iterator[int]:
    """Hold the lock of a folder itself, as long as it takes to get it; its descriptor inside. OSError for a link."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        acquire(descriptor, None)
        yield descriptor
    finally:
        os.close(descriptor)


def _is_at(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(path.lstat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False
