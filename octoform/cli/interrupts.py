"""SIGTERM and SIGHUP as an orderly stop: an exception that unwinds, so that a stopped run leaves what Ctrl-C leaves.

Without it these signals end the process where it stands, with its lock, its journal and the agent's private folders.
Only the command line asks for this, and only for as long as it runs.
"""

import os
import select
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

STOPS = (signal.SIGTERM, signal.SIGHUP)
UNWINDING_SECONDS = 20.0
"""How long a stop may take before the next signal counts as another one; a closed terminal sends several at once."""


class Stopped(KeyboardInterrupt):
    """The process was asked to stop by the signal ``number``; whatever lets an interrupt pass lets this pass too."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


@contextmanager
def orderly() -> Iterator[None]:
    """Raise `Stopped` in the block at SIGTERM and SIGHUP; one that is ignored (``nohup``) or handled stays so."""
    here = threading.current_thread() is threading.main_thread()
    taken = [number for number in STOPS if here and signal.getsignal(number) is signal.SIG_DFL]
    handler = _Handler()
    for number in taken:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


class _Handler:
    def __init__(self) -> None:
        self._stopped_at = float("-inf")

    def __call__(self, number: int, _frame: FrameType | None) -> None:
        now = time.monotonic()
        if now - self._stopped_at < UNWINDING_SECONDS:
            return
        self._stopped_at = now
        _part_with_lost_readers()
        raise Stopped(number)


def _part_with_lost_readers() -> None:
    """Where the terminal is gone, or the program behind a pipe, printing fails, and the stop must not end in that."""
    for descriptor in (1, 2):
        looked = select.poll()
        looked.register(descriptor, 0)
        if any(event & (select.POLLERR | select.POLLHUP) for _, event in looked.poll(0)):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, descriptor)
            os.close(nowhere)
