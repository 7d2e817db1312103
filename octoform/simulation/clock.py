"""Time of simulated devices: seconds from anywhere, so that a test's own time makes a minute pass at once."""

from collections.abc import Callable

Clock = Callable[[], float]
"""Seconds, never going back; ``time.monotonic`` is one."""


def sped_up(clock: Clock, factor: float) -> Clock:
    """The same clock, ``factor`` times as fast."""
    return clock if factor == 1 else lambda: clock() * factor
