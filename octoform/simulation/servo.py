"""One servo of the bus: registers, a motor that takes its time, heat, and the faults that real ones have.

Where makers' papers leave it open, it behaves so: a goal outside of the angle limits is clamped to them, and the answer
to that write carries the angle bit; with torque off a goal is acknowledged and forgotten, the register keeps what the
motor holds; switching torque on holds the present position; at the highest temperature the motor lets go.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from octoform.simulation import packets
from octoform.simulation.clock import Clock
from octoform.simulation.motion import Motion, planned, resting
from octoform.simulation.registers import Registers

# mute: obeys and does not answer. stuck: acknowledges and does not move. deaf_torque: torque never goes on.
# corrupt: answers with a wrong checksum. half: stops in the middle of an answer.
FAULTS = ("mute", "stuck", "deaf_torque", "corrupt", "half")


@dataclass
class Reached:
    """How far something ever was, both ways."""

    lowest: float
    highest: float

    def add(self, *values: float) -> None:
        """Count these in."""
        self.lowest, self.highest = min(self.lowest, *values), max(self.highest, *values)


class Servo:
    """``fault`` is None or one of FAULTS; ``goals`` is what hosts asked for, ``reached`` where the motor was."""

    def __init__(self, number: int, bus: Mapping[str, Any], clock: Clock) -> None:
        self._bus, self._own, self._clock = bus, bus["servos"][number], clock
        self._motor, self._heat = bus["motor"], bus["heat"]
        self._memory = Registers(bus["registers"])
        for name, value in {"id": number, **self._own.get("initial", {})}.items():
            self._memory.put(name, value)
        self._memory.kept = bytes(self._memory.memory)
        self.fault: str | None = self._own.get("fault")
        self.temperature = float(self._heat["ambient"])
        self.moment = self.sag = 0.0
        start = float(self._own["start"])
        self._motion: Motion = resting(start, clock())
        self._heated = clock()
        self._later: tuple[int, bytes] | None = None
        self.reached, self.goals = Reached(start, start), Reached(math.inf, -math.inf)
        self._memory.put("goal", start)

    @property
    def registers(self) -> bytearray:
        """The memory as a host would read it now."""
        self._measure()
        return self._memory.memory

    @property
    def number(self) -> int:
        """The bus id that it answers to."""
        return self._memory.value("id")

    @property
    def position(self) -> float:
        """Where the shaft is, in counts with parts of one."""
        place, _ = self._motion.at(self._clock())
        self.reached.add(place)
        return place

    @position.setter
    def position(self, place: float) -> None:
        """Turned by hand."""
        self._motion = resting(place, self._clock())
        self.reached.add(place)

    @property
    def speed(self) -> float:
        """Counts a second."""
        return self._motion.at(self._clock())[1]

    @property
    def torque(self) -> bool:
        """Whether the motor holds."""
        return self._memory.value("torque") == 1

    @property
    def load(self) -> float:
        """Percent of what the motor can hold, with its sign: against gravity, and more while it moves."""
        if not self.torque or (self._supported() and not self.speed):
            return 0.0
        moving = math.copysign(self._motor["friction"], self.speed) if self.speed else 0.0
        return float(max(-100.0, min(100.0, -100 * self.moment / self._motor["stall"] + moving)))

    @property
    def current(self) -> float:
        """Milliamperes."""
        if not self.torque:
            return 0.0
        return float(self._motor["idle_current"] + abs(self.load) / 100 * self._motor["stall_current"])

    def value(self, name: str) -> int:
        """A register by its name."""
        self._measure()
        return self._memory.value(name)

    @property
    def errors(self) -> int:
        """The error bits that every answer carries now."""
        hot = self.temperature >= (self._memory.value("highest_temperature") or math.inf)
        low = self._volts() < self._memory.value("lowest_voltage") / 10
        return (packets.OVERHEAT if hot else 0) | (packets.VOLTAGE if low else 0)

    def write(self, address: int, data: bytes) -> int:
        """What a host writes; the error bits of the answer."""
        before = self._memory.value("torque")
        held = self._memory.value("goal")
        locked = self._memory.value("lock") == 1
        touched = self._memory.write(address, data, locked=locked)
        if "torque" in touched:
            self._switched(bool(before))
        outside = "goal" in touched and self._asked(held)
        return self.errors | (packets.ANGLE if outside else 0)

    def read(self, address: int, count: int) -> bytes:
        """What a host reads; beyond the end of the memory there are zeros."""
        return bytes(self.registers[address : address + count]).ljust(count, b"\0")

    def later(self, address: int, data: bytes) -> None:
        """Remember a write until ``act``."""
        self._later = (address, data)

    def act(self) -> None:
        """Do what was remembered; nothing when there is nothing."""
        if self._later is not None:
            self.write(*self._later)
        self._later = None

    def warm(self) -> None:
        """Let the time since the last call heat or cool the motor; at its highest temperature it lets go."""
        now, lasted = self._clock(), self._clock() - self._heated
        aim = self._heat["ambient"] + self._heat["per_percent"] * abs(self.load)
        self.temperature = aim + (self.temperature - aim) * math.exp(-max(0.0, lasted) / self._heat["slowness"])
        self._heated = now
        if self.torque and self.errors & packets.OVERHEAT:
            self._memory.put("torque", 0)
            self._switched(True)

    def power_cycle(self) -> None:
        """The supply was off for a moment."""
        place = self.position
        self._memory.restart()
        self._motion = resting(place, self._clock())
        self._memory.put("goal", place)

    def _switched(self, before: bool) -> None:
        if self.fault == "deaf_torque" or self._memory.value("torque") > 1:
            self._memory.put("torque", 0)
        if self.torque == before:
            return
        if self.torque:
            self._motion = resting(self.position, self._clock())
            self._memory.put("goal", self.position)
        elif "drop" in self._own and not self._supported():
            self._go(float(self._own["drop"]), self._motor["falls"], self._motor["falls"] * 4)
        else:
            self._motion = resting(self.position, self._clock())

    def _asked(self, held: int) -> bool:
        """A goal was written: whether it lies outside of the limits."""
        goal = self._memory.value("goal")
        self.goals.add(goal)
        lowest, highest = self._memory.value("lowest"), self._memory.value("highest")
        within = min(max(goal, lowest), highest)
        self._memory.put("goal", within if self.torque else held)
        if self.torque:
            speed = self._memory.value("speed") or self._motor["top_speed"]
            gain = self._memory.value("acceleration") * self._motor["gain_of_one"] or self._motor["top_gain"]
            self._go(within, min(speed, self._motor["top_speed"]), gain)
        return within != goal

    def _go(self, goal: float, top: float, gain: float) -> None:
        if self.fault == "stuck":
            return
        now = self._clock()
        place, speed = self._motion.at(now)
        # Whatever brakes it, a shaft under way stops before its limit.
        room = self._memory.value("highest") - place if speed > 0 else place - self._memory.value("lowest")
        if speed:
            gain = max(gain, speed * speed / (2 * max(room, 1e-6)))
        self._motion = planned(self._motion, now, goal, top, gain)
        self.reached.add(self._motion.start, *(place for place in self._motion.turns()))

    def _supported(self) -> bool:
        """Whether the arm lies on its own stop, which bears the weight."""
        return "drop" in self._own and abs(self.position - self._own["drop"]) < self._motor["rests_within"]

    def _volts(self) -> float:
        return float(self._bus["supply"]["volts"] - self.sag)

    def _measure(self) -> None:
        place, speed = self._motion.at(self._clock())
        self.reached.add(place)
        self._memory.put("position", place)
        self._memory.put("present_speed", speed)
        self._memory.scaled("load", self.load)
        self._memory.scaled("voltage", self._volts())
        self._memory.scaled("temperature", self.temperature)
        self._memory.scaled("current", math.copysign(self.current, self.load))
        self._memory.put("moving", 1 if speed else 0)
        self._memory.put("status", self.errors)
