"""Time as the daemon feels it: a machine that slept, and a wall clock that was set. (Light.)

After a sleep nothing that was seen before counts, and stamps of before and after a jump cannot be compared. Both show
in the distances of three clocks from each other, so nothing has to be woken for them.
"""

import time

from octoform.base.clock import boottime, stamp

SLEPT_SECONDS = 2.0
JUMPED_SECONDS = 5.0
"""What a wall clock may be moved by without a word: it is slowed and sped up all the time to agree with others."""


class SystemClock:
    """The clocks of this machine: CLOCK_BOOTTIME goes on while it sleeps, the wall clock makes stamps."""

    def uptime(self) -> float:
        """Seconds since the machine was started."""
        return boottime()

    def stamp(self) -> str:
        """RFC 3339 in UTC, to the millisecond."""
        return stamp(digits=3)

    def awake(self) -> float:
        """Seconds since the start during which the machine did not sleep."""
        return time.monotonic()

    def wall(self) -> float:
        """Seconds since 1970 as the wall clock has it."""
        return time.time()


class Moments:
    """Compares the clocks each time it is asked."""

    def __init__(self, clock: SystemClock) -> None:
        self._clock = clock
        self._before = self._distances()

    def moved(self) -> bool:
        """Whether the machine slept or its wall clock was set since the last time."""
        slept, set_ = self._distances()
        before, self._before = self._before, (slept, set_)
        return slept - before[0] > SLEPT_SECONDS or abs(set_ - before[1]) > JUMPED_SECONDS

    def _distances(self) -> tuple[float, float]:
        uptime = self._clock.uptime()
        return uptime - self._clock.awake(), self._clock.wall() - uptime
