"""The folders of what the process keeps and writes are its user's alone, whoever made them. Standard library only.

Whoever can write there can take an emergency stop away, put tokens or counters in their place, and reach the sockets.
"""

import os
import stat
from pathlib import Path

PRIVATE = 0o700


class NotOursError(Exception):
    """A folder that may not be used; the text is one line for a person."""


def private(folder: Path) -> None:
    """Make the folder, or close one of ours that is open to others.

    NotOursError when it is a link, no folder, another user's, or when somebody else, save root, has a file in it (it
    had been open then); also when the system refuses.
    """
    if folder.is_symlink():
        raise NotOursError(f"{folder} is a link; a folder has to stand there")
    try:
        folder.mkdir(mode=PRIVATE, parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError as problem:
        raise NotOursError(f"{folder} cannot be used: {problem.strerror}") from problem
    try:
        status = os.fstat(descriptor)
        if status.st_uid != os.geteuid():
            raise NotOursError(f"{folder} belongs to another user (uid {status.st_uid}); nothing of it can be trusted")
        if stat.S_IMODE(status.st_mode) & 0o077:
            os.fchmod(descriptor, PRIVATE)
        _look_through(folder, descriptor)
    finally:
        os.close(descriptor)


def _look_through(folder: Path, descriptor: int) -> None:
    with os.scandir(descriptor) as entries:
        for entry in entries:
            owner = entry.stat(follow_symlinks=False).st_uid
            if owner not in (os.geteuid(), 0):
                text = f"{entry.name} in {folder} belongs to another user (uid {owner}); look at it and take it away"
                raise NotOursError(text)
