"""One wait for everything that can happen to a deployment. (Light.)

The kernel wakes it; nothing is polled but where an ear has no other way. A burst of events comes as one reason to look.
The end of the process is reported at once and alone, since a look at everything else takes time in which it could be
started again. All the rest is reported when it has been quiet for a moment.
"""

import os
import select
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

from octoform.daemon.model import Cause, Facts
from octoform.daemon.observe import file_events
from octoform.daemon.observe.clock_jumps import Moments, SystemClock
from octoform.daemon.observe.file_events import Ear, FolderEar, Unwatched
from octoform.daemon.observe.hardware import hardware
from octoform.daemon.observe.process import ProcessEar
from octoform.records import dataclass
from octoform.state.layout import Layout

QUIET_SECONDS = 0.05
BURST_SECONDS = 0.3
PING_SECONDS = 3.0
LOG_HOLD, FILES_HOLD = 1.0, 0.5
_NOTHING = frozenset[Cause]()
_AT_ONCE = frozenset((Cause.PROCESS,))

Poll = Callable[[Sequence[int], float | None], set[int]]
"""Waits until one of these descriptors can be read, at most so many seconds; those that can be."""


@dataclass(frozen=True, slots=True)
class Timing:
    """Seconds: between two full looks, and between two questions whether the endpoint answers."""

    interval: float = 300.0
    ping: float = PING_SECONDS


class EventSources:
    """All ears, the timers and the clocks behind one `wait`."""

    def __init__(
        self, process: ProcessEar, ears: Iterable[Ear], timing: Timing, clock: SystemClock, poll: Poll | None = None
    ) -> None:
        self._process = process
        listening = tuple(ears)
        self.unwatched = Unwatched(ear for ear in listening if isinstance(ear, FolderEar))
        self._ears: tuple[Ear, ...] = (process, *listening, self.unwatched)
        self._timing = timing
        self._clock = clock
        self._poll = poll or wait_readable
        self._moments = Moments(clock)
        self._bell = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        now = clock.uptime()
        self._deaf: dict[Ear, float] = {ear: now + ear.every for ear in self._ears if ear.every is not None}
        self._interval, self._ping = now + timing.interval, now + timing.ping
        self._serves = False
        self._missed = _NOTHING

    def wait(self, seconds: float | None) -> frozenset[Cause]:
        """Wait for events, at most so long; empty when the time is over, or when somebody called `rouse`."""
        end = None if seconds is None else self._clock.uptime() + seconds
        while True:
            if found := self._due():
                return self._first(found)
            now = self._clock.uptime()
            if end is not None and now >= end:
                return _NOTHING
            times = [self._interval, *self._deaf.values()]
            times += [self._ping] if self._serves else []
            times += [end] if end is not None else []
            ready = self._poll(self._listening(), max(0.0, min(times) - now))
            if self._bell in ready:
                os.eventfd_read(self._bell)
                return _NOTHING
            if found := self._heard(ready):
                return self._first(found if found & _AT_ONCE else found | self._burst())

    def rouse(self) -> None:
        """Let a wait return now, or the next one; may be called from a signal's handler or another thread."""
        os.eventfd_write(self._bell, 1)

    def follow(self, facts: Facts) -> None:
        """Listen to what these facts name: the process that runs now, the folders that are there now."""
        self._serves = facts.process is not None
        self._missed |= facts.put_off
        if not self._process.follow(facts.process) or facts.put_off:
            self._missed |= _AT_ONCE
        for ear in self._ears:
            if isinstance(ear, FolderEar):
                ear.follow()
        if self.unwatched.every is not None:
            self._deaf.setdefault(self.unwatched, self._clock.uptime() + self.unwatched.every)

    def close(self) -> None:
        """Let go of everything."""
        for ear in self._ears:
            ear.close()
        os.close(self._bell)

    def _first(self, found: frozenset[Cause]) -> frozenset[Cause]:
        """The end of the process by itself, and what came with it at the next wait; else all."""
        if not found & _AT_ONCE:
            return found
        self._missed |= found - _AT_ONCE
        return _AT_ONCE

    def _due(self) -> frozenset[Cause]:
        """The causes that are due by time alone."""
        now = self._clock.uptime()
        found, self._missed = set(self._missed), _NOTHING
        if self._moments.moved():
            found.add(Cause.RESUMED)
        if now >= self._interval:
            found.add(Cause.INTERVAL)
        if self._serves and now >= self._ping:
            found.add(Cause.PING)
        if Cause.INTERVAL in found or Cause.RESUMED in found:
            self._interval = now + self._timing.interval
        if found:
            self._ping = now + self._timing.ping
        for ear in [ear for ear, until in self._deaf.items() if now >= until]:
            del self._deaf[ear]
            if ear.every is not None:
                self._deaf[ear] = now + ear.every
                found |= ear.hear()
        return frozenset(found)

    def _listening(self) -> list[int]:
        numbers = [ear.fileno() for ear in self._ears if ear not in self._deaf]
        return [self._bell, *(number for number in numbers if number is not None)]

    def _heard(self, ready: set[int]) -> frozenset[Cause]:
        found: set[Cause] = set()
        for ear in self._ears:
            if ear not in self._deaf and ear.fileno() in ready:
                heard = ear.hear()
                found |= heard
                if heard and ear.hold:
                    self._deaf[ear] = self._clock.uptime() + ear.hold
        return frozenset(found)

    def _burst(self) -> frozenset[Cause]:
        """Collect further events until none comes for a moment, within a bound."""
        found = _NOTHING
        end = self._clock.uptime() + BURST_SECONDS
        while (left := end - self._clock.uptime()) > 0:
            ready = self._poll(self._listening(), min(QUIET_SECONDS, left)) - {self._bell}
            if not ready:
                break
            found |= self._heard(ready)
            if found & _AT_ONCE:
                break
        return found


def wait_readable(numbers: Sequence[int], seconds: float | None) -> set[int]:
    """Wait in the kernel until one of the descriptors can be read."""
    poll = select.poll()
    for number in numbers:
        poll.register(number, select.POLLIN)
    return {number for number, _ in poll.poll(None if seconds is None else seconds * 1000)}


def open_sources(
    layout: Layout, environ: Mapping[str, str], timing: Timing, clock: SystemClock | None = None
) -> EventSources:
    """The sources of a deployment; OSError when the system gives no way to watch files."""
    ears: list[Ear] = [
        FolderEar(partial(file_events.signs, layout)),
        FolderEar(partial(file_events.standing, layout), FILES_HOLD),
        FolderEar(partial(file_events.logs, layout), LOG_HOLD),
        hardware(environ),
    ]
    return EventSources(ProcessEar(), ears, timing, clock or SystemClock())
