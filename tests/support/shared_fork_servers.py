"""One fork server of an environment for all processes of a test run, where each would load for itself.

It listens at a name of the environment among the system's abstract ones (unix(7)), which are gone with it: who binds
the name starts it, everyone else connects. It ends with its last client, not with the one that started it.
"""

import errno
import os
import socket
import threading
from collections.abc import Callable
from pathlib import Path

from lasting_fork_server import peer

from octoform.endpoint.bounded_program import ForkServer, Purpose

CLIENTS = 64
"""That may wait while it loads."""


def _capabilities() -> str:
    """The rights of this process (proc(5)): a fork server with more would lend them to what has fewer."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(line.split()[1] for line in lines if line.startswith("CapEff:"))


class SharedForkServer(ForkServer):
    """The fork server of an environment, started where no process of this user has started it."""

    def __init__(self, python: Path, purpose: Purpose = "servers") -> None:
        self._owner = os.getpid()
        self._loaded = None
        self._waits = threading.Lock()
        self._orders = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        name = "\0octoform-tests-" + "-".join(map(str, (os.getuid(), _capabilities(), *self._key(python, purpose))))
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
            try:
                listener.bind(name)
            except OSError as problem:
                if problem.errno != errno.EADDRINUSE:
                    raise
                self._connect(name)
            else:
                listener.listen(CLIENTS)
                self._connect(name)  # first: it ends with its last client
                self._process = self._begun(python, purpose, listener)

    def _connect(self, name: str) -> None:
        """Where it is just ending, or between its name and its listening, nothing is loaded: the next one is."""
        try:
            self._orders.connect(name)
        except ConnectionRefusedError:
            self._loaded = False
        else:
            self._loaded = None if peer(self._orders) == os.getuid() else False

    def end(self) -> None:
        """Leave it to the others."""
        self._loaded = False
        self._orders.close()


def share() -> None:
    """Have this process take shared ones for servers. Those for pictures load little, and tests end or stop them."""
    begin: Callable[..., ForkServer] = ForkServer.at.__func__  # type: ignore[attr-defined]

    def at(cls: type[ForkServer], python: Path, purpose: Purpose = "servers") -> ForkServer:
        with cls._turn:
            wanted = cls._key(python, purpose)
            former = cls._kept.get(wanted)
            if purpose == "servers" and not (former and former._lives()):
                if former:
                    former.end()
                cls._kept[wanted] = SharedForkServer(python, purpose)
        return begin(cls, python, purpose)

    ForkServer.at = classmethod(at)  # type: ignore[method-assign, assignment]
