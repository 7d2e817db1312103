"""A listening Unix socket in a private folder, and who is at its other end. Standard library only."""

import errno
import os
import socket
import struct
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

from fastmcp.server.dependencies import FastMCPRequestContext

from octoform.base.escaping import escape_of

MAX_PATH_BYTES = 100
"""Bytes of a path that every system takes for a socket (unix(7): 108 with the end)."""

PASSING = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOBUFS, errno.ECONNABORTED, errno.EINTR})
"""What accept(2) answers in a shortage that ends again, or of one client alone: no reason to close a door."""
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
    """The peer of a connection, as it was when it connected (SO_PEERCRED of socket(7))."""
    packed = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
    pid, uid, _ = struct.unpack("3i", packed)
    return Peer(pid, uid)


class _Named:
    """A name for ``path`` that is short enough: the folder through a descriptor where the path is long."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._folder = -1

    def __enter__(self) -> str:
        if len(os.fsencode(self._path)) <= MAX_PATH_BYTES:
            return str(self._path)
        self._folder = os.open(self._path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        return f"/proc/self/fd/{self._folder}/{self._path.name}"

    def __exit__(self, *_: object) -> None:
        if self._folder >= 0:
            os.close(self._folder)


# Which program calls: the kernel's facts of its process, and its own.
#
# Every process of this machine's user is the caller ``local``; a person who reads the log or a question wants to know
# which of them it was. The kernel's word (user and process) is a fact; the name and version are the client's own claim,
# so they are bounded, and no character of them can end a line or look like anything else.

NAME_CHARS, VERSION_CHARS = 60, 24
_PEER: ContextVar[Peer | None] = ContextVar("peer", default=None)


@dataclass(frozen=True, slots=True)
class Client:
    """``name`` is what the client reports of itself, with its version (empty: nothing); ``peer`` is None over HTTP.

    The process at the other end of the socket may be a pipe (``octoform connect``) that the client started.
    """

    name: str = ""
    peer: Peer | None = None

    def fields(self) -> dict[str, str | int]:
        """Its fields in a record of the audit log."""
        known: dict[str, str | int] = {"client": self.name} if self.name else {}
        if self.peer is not None:
            known |= {"uid": self.peer.uid, "pid": self.peer.pid}
        return known

    def words(self) -> str:
        """Its description for a person, in ASCII; empty where nothing is known."""
        claim = f'a client that calls itself "{_ascii(self.name)}"' if self.name else ""
        fact = f"process {self.peer.pid} of user {self.peer.uid}" if self.peer is not None else ""
        return ", ".join(filter(None, [claim, fact]))


def connected(peer: Peer) -> None:
    """Everything that is asked in this context, and in what it starts, comes from this process."""
    _PEER.set(peer)


def client_of(request: FastMCPRequestContext | None) -> Client:
    """The client of a request."""
    params = request.session.client_params if request is not None else None
    name = ""
    if params is not None:
        parts = (_cut(params.client_info.name, NAME_CHARS), _cut(params.client_info.version, VERSION_CHARS))
        name = " ".join(filter(None, parts))
    return Client(name, _PEER.get())


def _cut(text: str, most: int) -> str:
    """One line of printable characters; what is no such character stands as its escape."""
    flat = " ".join(text[: most * 4].split())
    shown = "".join(letter if letter.isprintable() else escape_of(letter) for letter in flat)
    return shown if len(shown) <= most else f"{shown[: most - 3]}..."


def _ascii(text: str) -> str:
    """The same in ASCII, without the quotes that stand around it: what looks like a letter and is none shows."""
    return "".join(letter if " " <= letter <= "~" and letter != '"' else escape_of(letter) for letter in text)
