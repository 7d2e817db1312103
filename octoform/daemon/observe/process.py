"""The end of the endpoint's process, reported by the kernel at once. (Light.)

A process descriptor names one process permanently, so that a pid that was given again is never taken for it.
"""

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from octoform.base.processes import PROC, process_stat
from octoform.daemon.model import Cause
from octoform.endpoint.process import record
from octoform.endpoint.process.record import Running, is_it
from octoform.endpoint.sockets import GREETING, connect
from octoform.state.layout import Layout

_ENDED = frozenset((Cause.PROCESS,))


class ProcessEar:
    """Listens to one process at a time."""

    hold = 0.0
    every = None

    def __init__(self) -> None:
        self._process: Running | None = None
        self._handle: int | None = None

    def follow(self, process: Running | None) -> bool:
        """Listen to this process from now on; False when it has ended already, so that no event will come."""
        if process == self._process and self._handle is not None:
            return True
        self._release()
        self._process = process
        if process is None:
            return True
        try:
            self._handle = os.pidfd_open(process.pid)
        except OSError:
            return False
        if is_it(process):
            return True
        self._release()
        return False

    def fileno(self) -> int | None:
        """Readable once the process has ended."""
        return self._handle

    def hear(self) -> frozenset[Cause]:
        """The end of the process, reported once."""
        if self._handle is not None:
            with suppress(OSError):  # mostly it is a child of another process
                os.waitid(os.P_PIDFD, self._handle, os.WEXITED | os.WNOHANG)
        self._release()
        return _ENDED

    def close(self) -> None:
        """Let go of the process, which goes on."""
        self._release()

    def _release(self) -> None:
        if self._handle is not None:
            os.close(self._handle)
        self._handle = self._process = None


# Whether the process that serves the endpoint answers: asked at its control door and at that of its clients. (Light.)
#
# The control door has a thread of its own, so it detects a process that hangs (stopped, swapped out, one library
# that holds everything) from one that works. The clients' door is answered by the event loop. A loop that is busy for
# seconds is no fault, and the endpoint interrupts what blocks it by itself; so that door is asked seldom, and believed
# only when it stays shut. Neither is a process at fault that wants to run and gets no processor: it is given more time.

ASK_SECONDS = 3.0
GREETING_SECONDS = 1.0
GREETED_EVERY = 15.0
SHUT_SECONDS = 15.0
"""How long a door may stay shut: one that is ending has closed it already, and finishes its calls before it goes.

So long, too, a process that wants to run may take: on a machine with too much to do it is only slow.
"""
_AT_ONCE = 0.5

Ask = Callable[[Layout, float], Mapping[str, Any] | None]
Greeted = Callable[[Layout, float], bool]
Busy = Callable[[int], bool]


class Answering:
    """Asks one endpoint, and remembers since when a door was shut.

    ``uptime`` is the clock of that memory. `ask`, `greeted` and `busy` are what the system reports, which tests
    replace.
    """

    ask: Ask
    greeted: Greeted
    busy: Busy

    def __init__(self, layout: Layout, uptime: Callable[[], float]) -> None:
        self._layout = layout
        self._uptime = uptime
        self.ask, self.greeted, self.busy = _ask, _greeted, wants_to_run
        self._shut: dict[str, float] = {}
        self._greet = 0.0
        self._instance = ""

    def __call__(self, process: Running) -> tuple[bool | None, Mapping[str, Any] | None]:
        """Whether this process answers, and its status; (None, None) while it is doubtful."""
        if process.instance != self._instance:
            self._instance, self._shut, self._greet = process.instance, {}, 0.0
        began = self._uptime()
        found, hangs = self._answer()
        if found is None:
            stays = self._stays("control", began)
            return (False, None) if stays or (hangs and not self.busy(process.pid)) else (None, None)
        self._shut.pop("control", None)
        if self._loop():
            return True, found
        return (False, found) if self._stays("clients", self._uptime()) else (True, found)

    def _answer(self) -> tuple[Mapping[str, Any] | None, bool]:
        """The process's answer, and whether it accepted the question twice without one, as a hung process does."""
        waited = []
        for _ in range(2):
            began = self._uptime()
            found = self.ask(self._layout, ASK_SECONDS)
            if found is not None and "error" not in found:
                return found, False
            waited.append(self._uptime() - began)
            if waited[-1] < _AT_ONCE:
                break  # the door is shut: asking again at once gives nothing new
        return None, len(waited) == 2 and min(waited) >= ASK_SECONDS - _AT_ONCE

    def _loop(self) -> bool:
        """Whether the event loop greets; asked again each time while it does not, else seldom."""
        now = self._uptime()
        if "clients" not in self._shut and now < self._greet:
            return True
        self._greet = now + GREETED_EVERY
        if self.greeted(self._layout, GREETING_SECONDS):
            self._shut.pop("clients", None)
            return True
        return False

    def _stays(self, door: str, since: float) -> bool:
        return self._uptime() - self._shut.setdefault(door, since) >= SHUT_SECONDS


def _ask(layout: Layout, seconds: float) -> Mapping[str, Any] | None:
    return record.ask(layout, {"op": "status"}, seconds)


def wants_to_run(pid: int) -> bool:
    """Whether a thread of a process runs, or would if it got a processor (proc(5): state R)."""
    threads = PROC / str(pid) / "task"
    found = (process_stat(int(path.name), threads) for path in threads.glob("[0-9]*"))
    return any(thread is not None and thread.state == "R" for thread in found)


def _greeted(layout: Layout, seconds: float) -> bool:
    try:
        with connect(layout.socket, seconds) as client:
            return client.recv(len(GREETING)) == GREETING
    except OSError:
        return False
