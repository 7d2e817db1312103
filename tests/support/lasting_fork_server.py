"""The fork server of the tests' own processes: one that is not used for a minute goes on, for another test soon does.

To load what it loads takes a second of CPU, as long as ten commands. Those that commands begin for themselves are the
real ones. Where its descriptor is a listening socket, each connection to it is one client's orders, and it ends with
the last of them: see `shared_fork_servers`.
"""

import os
import runpy
import socket
import struct
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

SCRIPT = Path(__file__)
IDLE_SECONDS = 180.0
_CLIENTS: set[socket.socket] = set()
_TURN = threading.Lock()


def peer(connection: socket.socket) -> int:
    """The user at the other end (SO_PEERCRED of unix(7))."""
    found = struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i")))
    return int(found[1])


def _serve_all(listener: socket.socket, serve: Callable[[socket.socket], None]) -> None:
    while True:
        client = listener.accept()[0]
        if peer(client) == os.getuid():
            with _TURN:
                _CLIENTS.add(client)
            threading.Thread(target=_serve_one, args=(client, serve)).start()


def _serve_one(client: socket.socket, serve: Callable[[socket.socket], None]) -> None:
    try:
        client.send(b"ready")
        serve(client)
    except ConnectionError:  # it has gone
        pass
    client.close()
    with _TURN:
        _CLIENTS.remove(client)
        if not _CLIENTS:
            os._exit(0)  # who has just come sees the end of it, and begins another one


def _main(program: dict[str, Any]) -> None:
    program["serve"].__globals__["IDLE_SECONDS"] = IDLE_SECONDS
    orders = socket.socket(fileno=int(sys.argv[1]))
    if orders.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
        program["load"](sys.argv[2])
        _serve_all(orders, program["serve"])
    orders.detach()
    program["main"]()


if __name__ == "__main__":
    _main(runpy.run_path(str(SCRIPT.parents[2] / "octoform/endpoint/scripts/fork_server.py")))
