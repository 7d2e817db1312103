"""The firmware of a camera rail that talks in lines: one command, one answer, and no way to see where it is.

While no host has the port open it sweeps by itself. Opening the port ends the sweep where it is; the firmware keeps
counting its own steps through sweep and commands alike, so that HOME leads back to the origin whatever came before.
A movement takes its time, the lines that arrive meanwhile wait, and nothing interrupts it. When the port is closed a
movement goes on to its end and the answer is lost.
"""

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from octoform.base.clock import Clock
from octoform.patterns import regex

FAULTS = ("mute", "odd", "gone", "jammed", "late", "hot")
# mute: does nothing and sends nothing. odd: answers nonsense. gone: the next line unplugs it. jammed: answers well and
# does not move. late: moves and answers much later. hot: refuses every movement.
_MAX_LINE = 64
_NUMBER = regex(r"[+-]?\d{1,9}")
AXES = ("X", "Y")


class Unplugged(OSError):
    """The device went away while it was talked to."""


@dataclass(frozen=True)
class _Movement:
    began: float
    ends: float
    start: dict[str, int]
    way: dict[str, int]
    answer: str | None  # empty: no listener is left; None: sent, or nothing to send
    answers: float

    def at(self, now: float) -> dict[str, int]:
        """The carriage; an axis with less far to go is there sooner."""
        longest = max(abs(steps) for steps in self.way.values())
        whole = self.ends - self.began
        gone = longest if now >= self.ends or not whole else int(longest * max(0.0, now - self.began) / whole)
        found = {}
        for axis, steps in self.way.items():
            done = min(gone, abs(steps))
            found[axis] = self.start[axis] + (done if steps > 0 else -done)
        return found


class LineDevice:
    """``position`` is the carriage itself, ``counted`` what the firmware believes; ``fault`` None or one of FAULTS.

    ``lines`` are all that arrived. ``longest`` and ``farthest`` are the most steps of one movement and the most that
    an axis was ever away from the origin.
    """

    def __init__(self, description: Mapping[str, Any], clock: Clock = time.monotonic) -> None:
        self.description, self._clock = description, clock
        self.lines: list[str] = []
        self.fault: str | None = description.get("fault")
        self.counted = dict.fromkeys(AXES, 0)
        self.longest = self.farthest = 0
        self._step = 2 * float(description["half_period"]) / float(description.get("speedup", 1))
        self._sweep: Mapping[str, int] = description.get("sweep") or {}
        self._text = b""
        self._movement = _still(dict.fromkeys(AXES, 0), clock())
        self._alone: float | None = clock()
        self._lock = threading.RLock()

    @property
    def baud(self) -> int | None:
        """Any: the board's USB port is its own, a speed means nothing to it."""
        return None

    @property
    def position(self) -> dict[str, int]:
        """Where the carriage is, in steps from the origin."""
        with self._lock:
            return self._place(self._clock())

    @property
    def alone(self) -> bool:
        """Whether no host has the port open."""
        return self._alone is not None

    @property
    def due(self) -> float | None:
        """When the answer to the movement under way comes; None when nothing is to come."""
        return self._movement.answers if self._movement.answer is not None else None

    def garbled(self, data: bytes) -> None:
        """Never: it understands any speed."""

    def opened(self) -> None:
        """A host has opened the port: the sweep yields."""
        with self._lock:
            now = self._clock()
            if self._alone is not None and now >= self._alone:
                start, place = self._movement.at(self._alone), self._place(now)
                for axis in AXES:
                    self.counted[axis] += place[axis] - start[axis]
                self._movement = _still(place, now)
            self._alone = None

    def closed(self) -> None:
        """No host has the port open: what is under way ends, then the sweep begins again."""
        with self._lock:
            self._text, move = b"", self._movement
            if move.answer is not None:
                self._movement = replace(move, answer="", answers=move.ends)
            self._alone = max(self._clock(), move.ends)

    def feed(self, data: bytes) -> bytes:
        """The firmware's output now; with ``b""`` later what it sends then. Unplugged when it went away."""
        with self._lock:
            self._text += data
            out = b""
            while True:
                out += self._due_now()
                if self.due is not None or b"\n" not in self._text:
                    break
                line, _, self._text = self._text.partition(b"\n")
                out += self._obeyed(line.strip(b"\r ").decode("ascii", "backslashreplace"))
            if len(self._text) > _MAX_LINE and self.due is None:
                self._text = b""
                out += b"ERR line too long\n"
            return out

    def _due_now(self) -> bytes:
        move = self._movement
        if move.answer is None or self._clock() < move.answers:
            return b""
        self._movement = _still(move.at(move.ends), move.ends)
        return f"{move.answer}\n".encode() if move.answer else b""

    def _obeyed(self, line: str) -> bytes:
        """The immediate answer; the answer of a movement follows when it is over."""
        if not line:
            return b""
        self.lines.append(line)
        if self.fault == "gone":
            raise Unplugged("unplugged")
        if self.fault == "mute":
            return b""
        if self.fault == "odd":
            return b"boot v3 \x1b[31m\n"
        words = line.split(" ")
        if words == [self.description["home"]]:
            return self._moved({axis: -steps for axis, steps in self.counted.items()})
        axis = self.description["moves"].get(words[0])
        if axis is None or len(words) != 2:
            return b"ERR unknown command\n"
        if not _NUMBER.fullmatch(words[1]):
            return b"ERR not a number of steps\n"
        steps = int(words[1])
        refused = self._refusal(axis, steps)
        return f"ERR {refused}\n".encode() if refused else self._moved({axis: steps})

    def _refusal(self, axis: str, steps: int) -> str | None:
        if self.fault == "hot" or steps in self.description.get("refuse", ()):
            return "motor driver is hot"
        most, farthest = self.description.get("most"), self.description.get("farthest")
        if most is not None and abs(steps) > most:
            return f"steps out of range, at most {most}"
        if farthest is not None and abs(self.counted[axis] + steps) > farthest:
            return f"position out of range, at most {farthest}"
        return None

    def _moved(self, way: Mapping[str, int]) -> bytes:
        now = self._clock()
        for axis, steps in way.items():
            self.counted[axis] += steps
        lasts = max(abs(steps) for steps in way.values()) * self._step
        start = self._movement.at(now)
        real = {axis: 0 if self.fault == "jammed" else way.get(axis, 0) for axis in AXES}
        waits = self.description.get("late", 30) if self.fault == "late" else 0
        self._movement = _Movement(now, now + lasts, start, real, "OK", now + lasts + waits)
        if len(way) == 1:
            self.longest = max(self.longest, *(abs(steps) for steps in real.values()))
        self.farthest = max(self.farthest, *(abs(start[axis] + steps) for axis, steps in real.items()))
        return self._due_now()

    def _place(self, now: float) -> dict[str, int]:
        """The carriage; while no one listens it goes to and fro, each axis within its own bounds."""
        if self._alone is None or now < self._alone or not self._step:
            return self._movement.at(now)
        start, gone = self._movement.at(self._alone), int((now - self._alone) / self._step)
        return {axis: _swept(start[axis], gone, self._sweep.get(axis, 0)) for axis in AXES}


def _still(place: dict[str, int], now: float) -> _Movement:
    return _Movement(now, now, place, dict.fromkeys(AXES, 0), None, now)


def _swept(start: int, gone: int, width: int) -> int:
    """Where a sweep between -width and width is after so many steps, begun towards the higher end."""
    if not width:
        return start
    if start > width:
        down = start + width
        return start - gone if gone <= down else _swept(-width, gone - down, width)
    up = width - start
    if gone <= up:
        return start + gone
    turn = (gone - up) % (4 * width)
    return width - turn if turn <= 2 * width else -3 * width + turn
