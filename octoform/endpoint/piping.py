"""The stdio command of every local client: bytes to the endpoint's socket and back, nothing else. Light.

The process behind the socket owns the devices and speaks the protocol; this one may be started as often as there are
clients, so it loads nothing that a pipe does not need.
"""

import contextlib
import fcntl
import os
import select
import socket

from octoform.endpoint.sockets import GREETING

CHUNK = 1 << 16
PIPE_BYTES = 1 << 20
"""What a pipe may hold, where the system grants it: a picture then passes in a few steps instead of many."""
MOST_WAITING = 1 << 20
"""Bytes that may wait for a slow reader before its writer is made to wait too."""


class _Way:
    """One direction: bytes read that are not yet written."""

    __slots__ = ("ended", "greeting", "source", "target", "waiting")

    def __init__(self, source: int, target: int, greeting: bytes = b"") -> None:
        self.source = source
        self.target = target
        self.greeting = greeting
        """What is left out where it comes first."""
        self.waiting = b""
        self.ended = False


def pipe(connection: socket.socket, stdin: int = 0, stdout: int = 1) -> bool:
    """Carry bytes both ways until one side is done; True when the client ended it, False when the endpoint did."""
    before = {descriptor: os.get_blocking(descriptor) for descriptor in (stdin, stdout)}
    connection.setblocking(False)
    try:
        for descriptor in before:
            os.set_blocking(descriptor, False)
            with contextlib.suppress(OSError):  # no pipe, or more than this user may have
                fcntl.fcntl(descriptor, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        return _carry(connection, _Way(stdin, connection.fileno()), _Way(connection.fileno(), stdout, GREETING))
    finally:
        # Others may have the same terminal open.
        for descriptor, blocking in before.items():
            os.set_blocking(descriptor, blocking)


def _carry(connection: socket.socket, up: _Way, down: _Way) -> bool:
    closed = False
    while not down.ended or down.waiting:
        _turn(up, down)
        if up.ended and not up.waiting and not closed:
            closed = True
            try:
                connection.shutdown(socket.SHUT_WR)
            except OSError:  # the endpoint was faster
                return True
    return closed


def _turn(up: _Way, down: _Way) -> None:
    """Wait until something can be read or written, then do it."""
    watched: dict[int, int] = {}
    for way in (up, down):
        if not way.ended and len(way.waiting) < MOST_WAITING:
            watched[way.source] = watched.get(way.source, 0) | select.POLLIN
        if way.waiting:
            watched[way.target] = watched.get(way.target, 0) | select.POLLOUT
    poll = select.poll()
    for descriptor, events in watched.items():
        poll.register(descriptor, events)
    ready = {descriptor for descriptor, _ in poll.poll()}
    for way in (up, down):
        if way.source in ready and not way.ended and len(way.waiting) < MOST_WAITING:
            _fill(way)
        if way.waiting:
            _drain(way)


def _fill(way: _Way) -> None:
    try:
        part = os.read(way.source, CHUNK)
    except BlockingIOError:
        return
    except OSError:
        part = b""
    way.ended = not part
    way.waiting += part.removeprefix(way.greeting)
    way.greeting = b""


def _drain(way: _Way) -> None:
    try:
        way.waiting = way.waiting[os.write(way.target, way.waiting) :]
    except BlockingIOError:
        return
    except OSError:  # the reader is gone: what it did not take is nobody's
        way.waiting, way.ended = b"", True
