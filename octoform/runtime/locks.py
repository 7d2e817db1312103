"""One lock for each bus, across the threads of a server and across processes.

Two servers of one host, or two clients that each started one, must not talk over each other on one device. The lock
is a file lock (flock), which the kernel releases when a process dies, below a folder that only this user can write;
its place depends on the user alone, because servers are started with very different environments.

Each holder opens the file for itself, which keeps threads of one process apart as well. The lock lives and dies with
the file object: a tool that is stopped by an exception at any place, also while it takes the lock, leaves none.
"""

import asyncio
import fcntl
import hashlib
import io
import os
import stat
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Protocol

from .faults import BusBusy
from .sysfs import read_text

DEFAULT_TIMEOUT = 10.0
_STEP = 0.005
_LONGEST_STEP = 0.05


class Bus:
    """A lock to hold over a whole exchange: ``with bus("..."):``, or ``async with`` in an async tool.

    Not re-entrant: who holds it and asks again waits for itself, and gets BusBusy. Raises BusBusy after ``timeout``
    seconds, OSError when the lock's folder cannot be made.
    """

    def __init__(self, name: str, timeout: float = DEFAULT_TIMEOUT, confirm: Callable[[], None] | None = None) -> None:
        """``name`` says what is shared: a bus's name, or a device's folder in sysfs.

        ``confirm`` is called once the lock is held; when it raises, the lock is released.
        """
        self.name = name
        self.timeout = timeout
        self._confirm = confirm
        self._file: io.FileIO | None = None

    def __enter__(self) -> "Bus":
        """Wait for the lock."""
        end, step = time.monotonic() + self.timeout, _STEP
        while not self._try():
            self._give_up_after(end)
            time.sleep(step)
            step = min(step * 2, _LONGEST_STEP)
        return self._confirmed()

    async def __aenter__(self) -> "Bus":
        """Wait for the lock while other tasks go on."""
        end, step = time.monotonic() + self.timeout, _STEP
        while not self._try():
            self._give_up_after(end)
            await asyncio.sleep(step)
            step = min(step * 2, _LONGEST_STEP)
        return self._confirmed()

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        """Release it."""
        held, self._file = self._file, None
        if held is not None:
            held.close()

    async def __aexit__(self, *problem: type[BaseException] | BaseException | TracebackType | None) -> None:
        """Release it."""
        self.__exit__(*problem)

    def _confirmed(self) -> "Bus":
        try:
            if self._confirm is not None:
                self._confirm()
        except BaseException:
            self.__exit__()
            raise
        return self

    def _try(self) -> bool:
        self._file = _locked(_file(self.name))
        return self._file is not None

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

    def confirm(self) -> None:
        """Raise when it is no longer the device that a tool which acts asked for."""
        ...


def bus(shared: str | Located, timeout: float = DEFAULT_TIMEOUT) -> Bus:
    """The lock of a bus by its name, or of one device wherever it is attached."""
    return Bus(shared, timeout) if isinstance(shared, str) else Bus(str(shared.folder), timeout, shared.confirm)


def _file(name: str) -> Path:
    return _folder() / (hashlib.sha256(name.encode("utf-8", "surrogateescape")).hexdigest()[:24] + ".lock")


def _locked(path: Path) -> io.FileIO | None:
    """The file with its lock, or None when another one holds it."""
    file = io.FileIO(path, "r+", opener=_opened)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        return None
    os.pwrite(file.fileno(), f"{os.getpid()}\n".ljust(12).encode(), 0)
    return file


def _opened(path: str, _: int) -> int:
    return os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)


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
