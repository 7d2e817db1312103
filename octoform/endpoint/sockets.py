"""Connect to the sockets of a running endpoint, also where its folder has a long name. Light.

A connection alone proves nothing: the kernel makes it for anyone who still has the socket open, also for a process that
is being killed at this moment and will never take it. So the endpoint greets each client as it takes it, and what was
never greeted was never served.
"""

import errno
import os
import socket

MAX_PATH_BYTES = 100
"""Bytes of a path that every system takes for a socket (unix(7): 108 with the end)."""
GREETING = b"\n"
"""The endpoint's greeting to each client: a line without a message, which every reader of lines passes over."""


def connect(path: str | os.PathLike[str], seconds: float) -> socket.socket:
    """A connected socket with this timeout; OSError when nothing listens there."""
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
    client.settimeout(seconds)
    try:
        _connect(client, os.fspath(path))
    except OSError:
        client.close()
        raise
    return client


def greeted(path: str | os.PathLike[str], seconds: float) -> socket.socket:
    """A connected socket of an endpoint that has taken this client; OSError when nothing there takes any.

    One that sends nothing for so many seconds may be slow, and is returned as it is: its greeting comes later or
    never.
    """
    client = connect(path, seconds)
    try:
        if not client.recv(len(GREETING)):
            raise ConnectionResetError(errno.ECONNRESET, os.strerror(errno.ECONNRESET))
    except TimeoutError:
        return client
    except BaseException:
        client.close()
        raise
    return client


def _connect(client: socket.socket, path: str) -> None:
    if len(os.fsencode(path)) <= MAX_PATH_BYTES:
        client.connect(path)
        return
    above, _, name = path.rpartition("/")
    folder = os.open(above, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        client.connect(f"/proc/self/fd/{folder}/{name}")
    finally:
        os.close(folder)
