"""The stdio command of every local client: messages to the endpoint's socket and back, nothing else. Light.

The process behind the socket owns the devices and speaks the protocol; this one may be started as often as there are
clients, so it loads nothing that a pipe does not need. It outlives the process behind it: where another endpoint takes
its place, the client goes on with that one and need not know of it.
"""

import contextlib
import fcntl
import os
import select
import socket
import time
from collections.abc import Callable, Iterator

from octoform.endpoint.mcp_session import Conversation, Down, Up, read
from octoform.endpoint.sockets import GREETING

PIPE_BYTES = 1 << 20
"""Bytes that a pipe may hold, where the system grants it: a picture then passes in a few steps instead of many."""
STEP_MS, REST_MS = 50, 500
"""Milliseconds between two looks for another endpoint: while the client waits for one, and while it does not."""
REFUSAL_SECONDS = 2.0
"""How long a client that gets no endpoint may take for its first request."""

Again = Callable[[bool], "socket.socket | str | None"]
"""Another connection, asked for again and again with whether the client waits; it must return at once.

None: there is none yet. A string: there is none, and why. An empty text: there will be none, as somebody wants.
"""
Returning = Callable[[], Again]
"""Made when an endpoint has ended for the first time, so that no one else loads what it needs."""


def pipe(connection: socket.socket, stdin: int = 0, stdout: int = 1, again: Returning | None = None) -> bool:
    """Carry messages both ways until one side is done; True when the client ended it, False when the endpoint did.

    With ``again`` the end of an endpoint is no end: the client goes on with the next one's.
    """
    with _unblocked(stdin, stdout):
        return _Pipe(stdin, stdout).carry(connection, again)


def refuse(why: str, stdin: int = 0, stdout: int = 1) -> None:
    """Answer the first requests of a client that gets no endpoint with ``why``; a silent one is not waited for.

    A client shows an answer to the person behind it, and most drop what a command prints on standard error.
    """
    if os.isatty(stdin):  # a person typed the command, and reads standard error
        return
    with _unblocked(stdin, stdout):
        _Pipe(stdin, stdout).refuse(why, time.monotonic() + REFUSAL_SECONDS)


@contextlib.contextmanager
def _unblocked(*descriptors: int) -> Iterator[None]:
    before = {descriptor: os.get_blocking(descriptor) for descriptor in descriptors}
    try:
        for descriptor in before:
            os.set_blocking(descriptor, False)
            with contextlib.suppress(OSError):  # no pipe, or more than this user may have
                fcntl.fcntl(descriptor, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        yield
    finally:
        # Others may have the same terminal open.
        for descriptor, blocking in before.items():
            os.set_blocking(descriptor, blocking)


class _Pipe:
    def __init__(self, stdin: int, stdout: int) -> None:
        self._conversation = Conversation()
        self._up, self._down = Up(stdin, self._conversation), Down(stdout, self._conversation)
        self._left = False
        """The client takes nothing any more."""

    def carry(self, connection: socket.socket, returning: Returning | None) -> bool:
        """See `pipe`."""
        current: socket.socket | None = connection
        again: Again | None = None
        while current is not None:
            usable = self._serve(current)
            if current is not connection:
                current.close()
            self._up.reset()
            self._down.reset()
            if self._left or self._up.ended or not usable or returning is None:
                break
            again = again or returning()
            self._down.send(self._conversation.lost())
            current = self._another(again)
        while self._down.waiting and not self._left:
            self._turn({})
        return self._up.ended or self._left

    def refuse(self, why: str, end: float) -> None:
        """Answer the requests that come first, at the latest until ``end`` on the monotonic clock; see `refuse`."""
        while not (self._down.waiting or self._left or self._up.ended) and time.monotonic() < end:
            self._turn({}, STEP_MS)
            self._refuse(why)
        while self._down.waiting and not self._left:
            self._turn({})

    def _serve(self, connection: socket.socket) -> bool:
        """Carry messages until this endpoint or the client is done; False when another endpoint would not help."""
        connection.setblocking(False)
        number, greeting = connection.fileno(), GREETING
        gone = closed = False
        while not self._left:
            if self._up.ended and not self._up.waits and not closed:
                closed = True
                with contextlib.suppress(OSError):  # the endpoint was faster
                    connection.shutdown(socket.SHUT_WR)
            watched = {} if self._down.full else {number: select.POLLIN}
            if self._up.ready and not gone:
                watched[number] = watched.get(number, 0) | select.POLLOUT
            ready = self._turn(watched)
            if self._up.ready and not gone:
                gone = not self._up.drain(number)
            if number not in ready or self._down.full:
                continue
            part = read(number)
            if part == b"":
                return True
            try:
                self._up.ahead(self._down.put((part or b"").removeprefix(greeting)))
            except ValueError:
                return False
            greeting = greeting if part is None else b""
        return False

    def _another(self, again: Again) -> socket.socket | None:
        """Another endpoint, introduced to the client's conversation; None when there is to be none, or no client."""
        while not (self._left or self._up.ended):
            found = again(self._up.waits)
            if isinstance(found, socket.socket):
                self._up.ahead(self._conversation.found())
                self._down.send(self._conversation.renewed())
                return found
            if found == "":
                break
            if found:
                self._refuse(found)
            self._turn({}, STEP_MS if self._up.waits else REST_MS)
        return None

    def _refuse(self, why: str) -> None:
        """Answer what waits for an endpoint; a notification has no one who waits for it."""
        answers = (self._conversation.refused(line, why) for line in self._up.taken())
        self._down.send([answer for answer in answers if answer is not None])

    def _turn(self, more: dict[int, int], timeout: int | None = None) -> set[int]:
        """Wait until something can be read or written, at most so many milliseconds, and do the client's part of it."""
        watched = dict(more)
        if not (self._up.ended or self._up.full):
            watched[self._up.source] = watched.get(self._up.source, 0) | select.POLLIN
        if self._down.waiting:
            watched[self._down.target] = watched.get(self._down.target, 0) | select.POLLOUT
        poll = select.poll()
        for descriptor, events in watched.items():
            poll.register(descriptor, events)
        ready = {descriptor for descriptor, _ in poll.poll(timeout)}
        if self._up.source in ready and not (self._up.ended or self._up.full):
            self._up.fill()
        if self._down.waiting:
            self._left = not self._down.drain()
        return ready
