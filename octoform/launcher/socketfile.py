"""A listening Unix socket in a private folder, and who is at its other end. Standard library only."""

import errno
import os
import socket
import struct
from dataclasses import dataclass
from pathlib import Path

LONGEST = 100
"""Bytes of a path that every system takes for a socket (unix(7): 108 with the end)."""

PASSING = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOBUFS, errno.ECONNABORTED, errno.EINTR})
"""What accept(2) says in a shortage that ends again, or of one client alone: no reason to close a door."""
PAUSE = 0.1
"""Seconds until a door tries again in a shortage."""


def listen(path: Path, backlog: int = 64) -> socket.socket:
    """A listening socket at ``path``, mode 0600 from its first moment; what a dead process left there goes."""
    path.unlink(missing_ok=True)
    server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
    before = os.umask(0o177)
    try:
        with _Named(path) as name:
            server.bind(name)
    finally:
        os.umask(before)
    server.listen(backlog)
    return server


@dataclass(frozen=True, slots=True)
class Peer:
    """The process at the other end, as the kernel knows it: its number and its user."""

    pid: int
    uid: int

    @property
    def mine(self) -> bool:
        """True when it runs as this user, or as root."""
        return self.uid in (os.getuid(), 0)


def peer(connection: socket.socket) -> Peer:
    """Who is at the other end, as it was when it connected (SO_PEERCRED of socket(7))."""
    packed = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    pid, uid, _ = struct.unpack("3i", packed)
    return Peer(pid, uid)


class _Named:
    """A name for ``path`` that is short enough: the folder through a descriptor where the path is long."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._folder = -1

    def __enter__(self) -> str:
        if len(os.fsencode(self._path)) <= LONGEST:
            return str(self._path)
        self._folder = os.open(self._path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        return f"/proc/self/fd/{self._folder}/{self._path.name}"

    def __exit__(self, *_: object) -> None:
        if self._folder >= 0:
            os.close(self._folder)
