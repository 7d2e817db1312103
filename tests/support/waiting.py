"""Waiting for what another process does: one way, with a limit that only a failure reaches."""

import time
from collections.abc import Callable

SECONDS = 60.0


def until(holds: Callable[[], object], what: str = "it did not come true in time", seconds: float = SECONDS) -> bool:
    """True as soon as the condition holds; an AssertionError with ``what`` is missing after so many seconds."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, what
        time.sleep(0.01)
    return True
