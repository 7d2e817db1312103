"""A file that stays open for long, and is looked at before each use whether its number still means it.

Tools run in this process. One that closes a descriptor twice closes whatever has got that number since, and the next
device that is opened gets it: a record of the log would then be a command to the device. Standard library only.
"""

import os
from pathlib import Path


class OwnFile:
    """An open file of ours; ``number`` is its descriptor, to be used only after `held` said so."""

    __slots__ = ("_identity", "number")

    def __init__(self, path: Path, how: int) -> None:
        """Open ``path``, made if it is not there, private, links not followed; OSError when that cannot be."""
        self.number = os.open(path, how | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)
        status = os.fstat(self.number)
        self._identity = (status.st_dev, status.st_ino)
        if status.st_mode & 0o077:
            os.fchmod(self.number, 0o600)

    def held(self) -> bool:
        """True while the number is this file's; it costs less than a microsecond."""
        try:
            status = os.fstat(self.number)
        except OSError:
            return False
        return (status.st_dev, status.st_ino) == self._identity

    def close(self) -> None:
        """Let it go; a number that is somebody else's by now is left alone."""
        if self.held():
            os.close(self.number)
