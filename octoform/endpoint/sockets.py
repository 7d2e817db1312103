"""Connect to the sockets of a running endpoint, also where its folder has a long name. Light."""

import os
import socket

LONGEST = 100
"""Bytes of a path that every system takes for a socket (unix(7): 108 with the end)."""


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


def _connect(client: socket.socket, path: str) -> None:
    if len(os.fsencode(path)) <= LONGEST:
        client.connect(path)
        return
    above, _, name = path.rpartition("/")
    folder = os.open(above, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        client.connect(f"/proc/self/fd/{folder}/{name}")
    finally:
        os.close(folder)
