"""One process owns the devices of a host: who it is, so that no one else is ever taken for it. Standard library only.

Ownership is a file lock, which the kernel gives back however the process ends. The record beside it states who holds
it (pid, start time, boot, command line), because a pid alone may be anybody's by the time it is read.
"""

import contextlib
import json
import os
import secrets
from pathlib import Path
from typing import Any

from octoform.base import clock, files
from octoform.base.files import private_folder
from octoform.base.locks import acquire, lock_file
from octoform.base.place import KEY, place_of
from octoform.base.processes import command_line, start_of
from octoform.base.shape import fits

from .stderr_log import write_line

RECORD = "process.json"
MARK = "OCTOFORM_ENDPOINT"
"""The variable that marks the processes that tools leave behind; the starter of this process sets it."""
_LOCK = "owner.lock"


class Owner:
    """The ownership of one host's endpoint, held until `release` or the end of the process."""

    def __init__(self, folder: Path, descriptor: int) -> None:
        self._folder = folder
        self._lock = descriptor
        self.instance = secrets.token_hex(8)
        """Identifies this start of the endpoint."""
        self._document = b""

    @staticmethod
    def take(folder: Path) -> "Owner | None":
        """Ownership, or None when another process has it. OSError when the folder cannot be written."""
        private_folder(folder)
        lock = lock_file(folder / _LOCK)
        if acquire(lock):
            return Owner(folder, lock)
        os.close(lock)
        return None

    def record(self, **facts: Any) -> None:
        """Write who owns the endpoint and what it serves; called once it does, and whenever a fact changes."""
        document = {
            "format": 1,
            "pid": os.getpid(),
            "start": start_of(os.getpid()),
            "boot": clock.boot_id(),
            "argv": command_line(os.getpid()),
            "instance": self.instance,
            "mark": os.environ.get(MARK),
            KEY: place_of(self._folder),
            "since": clock.stamp(),
            **facts,
        }
        self._document = json.dumps(document, indent=1).encode()
        files.replace(self._folder / RECORD, self._document)

    def is_recorded(self) -> bool:
        """False once the record is gone or names another start; one that was damaged is written again.

        No one finds a process whose record cannot be read, and none other can be started beside it.
        """
        path = self._folder / RECORD
        try:
            data = files.read(path, follow=False)
            if data == self._document:
                return True
            found = files.parse(data)
            if fits(found, {"instance": str}) and found["instance"] != self.instance:
                return False
        except FileNotFoundError:
            return False
        except (OSError, ValueError) as problem:
            write_line(f"the record of this process was damaged ({problem}) and is written again")
        if self._document:
            with contextlib.suppress(OSError):  # tried again with the next look
                files.make_way(path)
                files.replace(path, self._document)
        return True

    def release(self) -> None:
        """Take the record away and let the next one own the endpoint."""
        if self.is_recorded():
            (self._folder / RECORD).unlink(missing_ok=True)
        os.close(self._lock)
