"""One lock for each bus, across the threads of a server and across processes.

Two servers of one host, or two clients that each started one, must not talk over each other on one device. The lock
is a file lock (flock), which the kernel releases when a process dies, below a folder that only this user can write;
its place depends on the user alone, because servers are started with very different environments.
"""

import asyncio
import fcntl
import hashlib
import os
import stat
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Protocol

from .faults import BusBusy
from .sysfs import read_text

DEFAULT_TIMEOUT = 10.0
_STEP = 0.005
_LONGEST_STEP = 0.05
_threads: dict[str, threading.Lock] = {}
_threads_guard = threading.Lock()


class Bus:
    """A lock to hold over a whole exchange: ``with bus("..."):``, or ``async with`` in an async tool.

    Not re-entrant: who holds it and asks again waits for itself, and gets BusBusy. Raises BusBusy after ``timeout``
    seconds, OSError when the lock's folder cannot be made.
    """

    def __init__(self, name: str, timeout: float = DEFAULT_TIMEOUT) -> None:
        """``name`` says what is shared: a bus's name, or a device's folder in sysfs."""
        self.name = name
        self.timeout = timeout
        self._descriptor = -1
        with _threads_guard:
            self._thread = _threads.setdefault(name, threading.Lock())

    def __enter__(self) -> "Bus":
        """Wait for the lock."""
        end, step = time.monotonic() + self.timeout, _STEP
        while not self._try():
            self._give_up_after(end)
            time.sleep(step)
            step = min(step * 2, _LONGEST_STEP)
        return self

    async def __aenter__(self) -> "Bus":
        """Wait for the lock while other tasks go on."""
        end, step = time.monotonic() + self.timeout, _STEP
        while not self._try():
            self._give_up_after(end)
            await asyncio.sleep(step)
            step = min(step * 2, _LONGEST_STEP)
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        """Release it."""
        os.close(self._descriptor)  # closing the only descriptor releases the file lock
        self._descriptor = -1
        self._thread.release()

    async def __aexit__(self, *problem: type[BaseException] | BaseException | TracebackType | None) -> None:
        """Release it."""
        self.__exit__(*problem)

    def _try(self) -> bool:
        if not self._thread.acquire(blocking=False):
            return False
        try:
            self._descriptor = _lock_file(_file(self.name))
        except BaseException:
            self._thread.release()
            raise
        if self._descriptor < 0:
            self._thread.release()
        return self._descriptor >= 0

    def _give_up_after(self, end: float) -> None:
        if time.monotonic() >= end:
            holder = read_text(_file(self.name), 40) or "?"
            raise BusBusy(self.name, f"{self.name} was in use for {self.timeout:g} s (by process {holder})")


class Located(Protocol):
    """A device with a place in sysfs."""

    @property
    def folder(self) -> Path:
        """Its folder now."""
        ...


def bus(shared: str | Located, timeout: float = DEFAULT_TIMEOUT) -> Bus:
    """The lock of a bus by its name, or of one device wherever it is attached."""
    return Bus(shared if isinstance(shared, str) else str(shared.folder), timeout)


def _file(name: str) -> Path:
    return _folder() / (hashlib.sha256(name.encode("utf-8", "surrogateescape")).hexdigest()[:24] + ".lock")


def _lock_file(path: Path) -> int:
    """A descriptor that holds the file's lock, or -1 when another one holds it."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, str(os.getpid()).encode(), 0)
    except BlockingIOError:
        os.close(descriptor)
        return -1
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def _folder() -> Path:
    """The private folder of this user's locks; PermissionError when another user got to its name first."""
    user = os.getuid()
    session = Path(f"/run/user/{user}")
    folder = session / "octoform" if session.is_dir() and os.access(session, os.W_OK) else Path(f"/tmp/octoform-{user}")
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != user or status.st_mode & 0o022:
        raise PermissionError(f"{folder} is not a private folder of this user")
    return folder
