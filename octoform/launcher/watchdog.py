"""An async tool that blocks the event loop stops everybody: no deadline comes, no other client is answered.

A thread looks every now and then whether a call on the loop is over its deadline. Only then, if the loop does not turn
and the frame of that very call stands on the main thread, a signal is sent whose handler raises inside the tool. A
signal also ends a system call that waits, which an exception alone cannot.
"""

import asyncio
import logging
import signal
import sys
import threading
import time
from types import CodeType, FrameType
from typing import Any, Protocol

from .workers import Interrupted

LOG = logging.getLogger("octoform.launcher")
EVERY = 0.5
"""Seconds between two looks, and what a loop has for one turn."""


class Overdue(Protocol):
    """A call on the event loop with its deadline (monotonic seconds)."""

    deadline: float
    tool: str


class Watchdog:
    """Knows the calls that run on the event loop. One for the process; ``arm`` in the main thread."""

    def __init__(self) -> None:
        self._calls: set[Any] = set()
        self._frames: frozenset[CodeType] = frozenset()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()

    def watch(self, call: Overdue) -> None:
        self._calls.add(call)

    def forget(self, call: Overdue) -> None:
        self._calls.discard(call)

    def arm(self, frames: frozenset[CodeType]) -> bool:
        """Watch the running loop; ``frames`` are the functions that a tool runs in, with its call as ``work``.

        False where that cannot be: the loop does not run in the main thread, whose signals these are.
        """
        if threading.current_thread() is not threading.main_thread():
            return False
        self._frames = frames
        self._loop = asyncio.get_running_loop()
        signal.signal(signal.SIGUSR2, self._handle)
        if self._thread is None or not self._thread.is_alive():
            self._ended.clear()
            self._thread = threading.Thread(target=self._look, name="watchdog", daemon=True)
            self._thread.start()
        return True

    def disarm(self) -> None:
        """Watch no more."""
        self._ended.set()

    def _look(self) -> None:
        while not self._ended.wait(EVERY):
            loop = self._loop
            if loop is None or not self._overdue() or loop.is_closed() or self._turns(loop):
                continue
            if self._guilty(sys._current_frames().get(threading.main_thread().ident or 0)) is not None:
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGUSR2)

    def _overdue(self) -> bool:
        now = time.monotonic()
        return any(now > call.deadline for call in tuple(self._calls))

    def _turns(self, loop: asyncio.AbstractEventLoop) -> bool:
        turned = threading.Event()
        try:
            loop.call_soon_threadsafe(turned.set)
        except RuntimeError:  # closed in this moment
            return True
        return turned.wait(EVERY)

    def _guilty(self, frame: FrameType | None) -> Any:
        """The overdue call in whose code the main thread is; None when it is anywhere else."""
        while frame is not None:
            if frame.f_code in self._frames:
                work: Any = frame.f_locals.get("work")
                return work if work in self._calls and time.monotonic() > work.deadline else None
            frame = frame.f_back
        return None

    def _handle(self, _: int, frame: FrameType | None) -> None:
        """In the main thread, between two of its instructions."""
        work = self._guilty(frame)
        if work is not None:
            LOG.error("the tool %s blocked every other call and is over its time: it was interrupted", work.tool)
            raise Interrupted


WATCHDOG = Watchdog()
