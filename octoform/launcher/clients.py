"""Which program calls: what the kernel says of its process, and what it says of itself.

Every process of this machine's user is the caller ``local``; a person who reads the log or a question wants to know
which of them it was. The kernel's word (user and process) is a fact; the name and version are the client's own claim,
so they are bounded, and no character of them can end a line or look like anything else.
"""

from contextvars import ContextVar
from dataclasses import dataclass

from fastmcp.server.dependencies import FastMCPRequestContext

from .socketfile import Peer

NAME_CHARS, VERSION_CHARS = 60, 24
_PEER: ContextVar[Peer | None] = ContextVar("peer", default=None)


@dataclass(frozen=True, slots=True)
class Client:
    """``name`` is what the client says of itself, with its version (empty: nothing); ``peer`` is None over HTTP.

    The process at the other end of the socket may be a pipe (``octoform connect``) that the client started.
    """

    name: str = ""
    peer: Peer | None = None

    def fields(self) -> dict[str, str | int]:
        """What a record of the audit log says of it."""
        known: dict[str, str | int] = {"client": self.name} if self.name else {}
        if self.peer is not None:
            known |= {"uid": self.peer.uid, "pid": self.peer.pid}
        return known

    def words(self) -> str:
        """What a person reads of it, in ASCII; empty where nothing is known."""
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
    shown = "".join(letter if letter.isprintable() else _escape(letter) for letter in flat)
    return shown if len(shown) <= most else f"{shown[: most - 3]}..."


def _ascii(text: str) -> str:
    """The same in ASCII, without the quotes that stand around it: what looks like a letter and is none shows."""
    return "".join(letter if " " <= letter <= "~" and letter != '"' else _escape(letter) for letter in text)


def _escape(letter: str) -> str:
    return f"\\u{ord(letter):04x}" if ord(letter) <= 0xFFFF else f"\\U{ord(letter):08x}"
