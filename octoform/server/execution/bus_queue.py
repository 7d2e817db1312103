"""One call at a time on a bus, in the order in which they came, no matter who sent them.

A bus is a device's wire: two calls on it at once would mix their bytes. A call that never returned keeps its bus, since
no one can know what its thread still does there; a later call is refused at once and does not wait in vain.
The same queue bounds how many calls of one tool, and how many at all, may run: a tool that hangs cannot take the
threads of the others.

Everything here runs on the event loop; there is no lock because there is no second thread.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

WAITING = 256
"""Calls that may wait for one bus; the next one hears at once that it is busy."""


class Busy(Exception):
    """A bus could not be had; the text names the bus, who holds it and since when, ``code`` is busy, stuck or stopped
    (a tool that stops its device was called meanwhile)."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


@dataclass(eq=False, slots=True)
class Holder:
    """A call on its buses: the tool and its effect, who called, the effects that the caller may know of, when it took
    the first bus (monotonic seconds), and whether it is stuck."""

    tool: str
    caller: str
    effect: str
    sees: frozenset[str]
    since: float = 0.0
    stuck: bool = False


class Bus:
    """Something that ``capacity`` calls may hold at once; ``title`` is its name in a sentence."""

    __slots__ = ("_waiting", "capacity", "holders", "stops", "title")

    def __init__(self, title: str, capacity: int = 1) -> None:
        self.title = title
        self.capacity = capacity
        self.holders: list[Holder] = []
        self.stops = 0
        self._waiting: deque[tuple[asyncio.Future[None], Holder]] = deque()

    def free(self) -> bool:
        """Whether it can be had without waiting: no one is in line, and none that holds it is stuck."""
        return len(self.holders) < self.capacity and not self._waiting and not self._stuck()

    async def take(self, holder: Holder, deadline: float) -> None:
        """Hold the bus, waiting in line until ``deadline`` (the loop's time); Busy when it cannot be had."""
        self.refuse_when_stuck(holder)
        if self.free():
            self.holders.append(holder)
            return
        if len(self._waiting) >= WAITING:
            raise Busy("busy", f"{self.words(holder)}, and {WAITING} calls wait for it already")
        loop = asyncio.get_running_loop()
        turn: asyncio.Future[None] = loop.create_future()
        entry = (turn, holder)
        self._waiting.append(entry)
        timer = loop.call_at(deadline, self._expire, turn, holder)
        try:
            await turn
        except BaseException:
            if entry in self._waiting:
                self._waiting.remove(entry)
            elif holder in self.holders:  # the turn came in the same moment in which the caller left
                self.release(holder)
            raise
        finally:
            timer.cancel()

    def release(self, holder: Holder) -> None:
        """Give the bus to the next in line; does nothing for a call that does not hold it."""
        if holder not in self.holders:
            return
        self.holders.remove(holder)
        while self._waiting and len(self.holders) < self.capacity:
            turn, following = self._waiting.popleft()
            if not turn.done():
                self.holders.append(following)
                turn.set_result(None)

    def turn_away(self) -> None:
        """Everybody in line hears that the bus is stuck."""
        for turn, asks in self._waiting:
            if not turn.done():
                turn.set_exception(Busy("stuck", self.words(asks)))
        self._waiting.clear()

    def overtake(self) -> None:
        """A tool that stops the device was called: what moves and is in line came before, and hears so."""
        self.stops += 1
        for turn, asks in self._waiting:
            if asks.effect != "read" and not turn.done():
                turn.set_exception(_stopped(self))

    def refuse_when_stuck(self, asks: Holder) -> None:
        """Busy at once when a call that holds the bus did not return."""
        if self._stuck():
            raise Busy("stuck", self.words(asks))

    def words(self, asks: Holder) -> str:
        """The holder of the bus, as a sentence without its end; no name of a tool that ``asks`` may not know of."""
        holder = next((each for each in self.holders if each.stuck), self.holders[0] if self.holders else None)
        if holder is None:
            return f"{self.title} is busy"
        seconds = time.monotonic() - holder.since
        known = holder.effect in asks.sees
        if holder.stuck:
            what = f"a call of {holder.tool}" if known else "a call"
            return (
                f"{self.title} is held by {what} that did not return; it began {seconds:.0f} s ago. "
                "It is free again when that call returns, or after octoform restart"
            )
        who = f"{holder.tool} (called by {holder.caller})" if known else "another call"
        return f"{self.title} is busy: {who} has held it for {seconds:.1f} s"

    def _stuck(self) -> bool:
        return any(holder.stuck for holder in self.holders)

    def _expire(self, turn: asyncio.Future[None], asks: Holder) -> None:
        if not turn.done():
            turn.set_exception(Busy("busy", self.words(asks)))


def _stopped(bus: Bus) -> Busy:
    text = f"{bus.title} was stopped after this call came, so it is not made"
    return Busy("stopped", f"{text}. Call the tool again if it still has to be done")


def take_free(buses: Sequence[Bus], holder: Holder) -> bool:
    """Hold all of them if none has to be waited for; the usual case, at the cost of a few comparisons."""
    for bus in buses:
        if not bus.free():
            return False
    holder.since = time.monotonic()
    for bus in buses:
        bus.holders.append(holder)
    return True


async def take(buses: Sequence[Bus], holder: Holder, deadline: float) -> None:
    """Hold all of them, taken in their order, or none; Busy when one cannot be had by ``deadline``."""
    for bus in buses:
        bus.refuse_when_stuck(holder)
    taken: list[Bus] = []
    stops = [bus.stops for bus in buses]
    try:
        for bus in buses:
            await bus.take(holder, deadline)
            holder.since = holder.since or time.monotonic()
            taken.append(bus)
        for bus, before in zip(buses, stops, strict=True):
            if bus.stops != before and holder.effect != "read":
                raise _stopped(bus)
    except BaseException:
        release(taken, holder)
        raise


def release(buses: Sequence[Bus], holder: Holder) -> None:
    """Give all of them to the next in line."""
    for bus in buses:
        bus.release(holder)


def abandon(buses: Sequence[Bus], holder: Holder, kept: Callable[[Bus], bool]) -> None:
    """The call is stuck: it keeps the buses that ``kept`` names, and anyone who waits for one of those hears so."""
    holder.stuck = True
    for bus in buses:
        if kept(bus):
            bus.turn_away()
        else:
            bus.release(holder)
