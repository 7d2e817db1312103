"""One servo of the bus: registers, a motor that takes its time, heat, and the faults that real ones have.

Where makers' papers leave it open, it behaves so: a goal outside of the angle limits is clamped to them, and the answer
to that write carries the angle bit; with torque off a goal is acknowledged and forgotten, the register keeps what the
motor holds; switching torque on holds the present position; at the highest temperature the motor lets go.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from octoform.base.clock import Clock

# How a motor goes from here to there: a speed that rises, stays and falls, so that a position follows from the time.
#
# All in counts and seconds. A movement begun while another is under way starts with the speed that it has then: a motor
# that has to turn round slows down first.


@dataclass(frozen=True)
class _Piece:
    lasts: float
    speed: float
    gain: float

    def way(self, after: float) -> float:
        return self.speed * after + self.gain * after * after / 2


@dataclass(frozen=True)
class Motion:
    """One movement. Pieces of constant acceleration, the goal at the end of the last."""

    began: float
    start: float
    goal: float
    pieces: tuple[_Piece, ...] = ()

    @property
    def ends(self) -> float:
        """The time at which the goal is reached."""
        return self.began + sum(piece.lasts for piece in self.pieces)

    def at(self, now: float) -> tuple[float, float]:
        """Position and speed."""
        place, after = self.start, max(0.0, now - self.began)
        for piece in self.pieces:
            if after < piece.lasts:
                return place + piece.way(after), piece.speed + piece.gain * after
            place, after = place + piece.way(piece.lasts), after - piece.lasts
        return self.goal, 0.0

    def turns(self) -> list[float]:
        """The positions between the pieces: no position of the movement lies outside of them, start and goal."""
        place, found = self.start, []
        for piece in self.pieces[:-1]:
            place += piece.way(piece.lasts)
            found.append(place)
        return found


def resting(place: float, now: float) -> Motion:
    """No movement at all."""
    return Motion(now, place, place)


def planned(before: Motion, now: float, goal: float, top: float, gain: float) -> Motion:
    """The movement to ``goal`` from where ``before`` is now, with a highest speed and an acceleration (above 0)."""
    start, speed = before.at(now)
    pieces: list[_Piece] = []
    place = start
    stops = place + speed * abs(speed) / (2 * gain)
    if speed and (goal - stops) * speed < 0:
        pieces.append(_Piece(abs(speed) / gain, speed, -math.copysign(gain, speed)))
        place, speed = stops, 0.0
    pieces += _straight(goal - place, abs(speed), top, gain)
    return Motion(now, start, goal, tuple(piece for piece in pieces if piece.lasts > 0))


def _straight(way: float, speed: float, top: float, gain: float) -> list[_Piece]:
    """A way without turning round, begun with a speed towards its end."""
    side, far = (math.copysign(1, way), abs(way))
    pieces = []
    if speed > top:
        slow = (speed - top) / gain
        pieces.append(_Piece(slow, side * speed, -side * gain))
        far, speed = far - (speed + top) / 2 * slow, top
    peak = min(top, math.sqrt(gain * max(0.0, far) + speed * speed / 2))
    rise, fall = max(0.0, peak - speed) / gain, peak / gain
    cruise = far - (peak + speed) / 2 * rise - peak / 2 * fall
    pieces.append(_Piece(rise, side * speed, side * gain))
    if peak > 0:
        pieces.append(_Piece(max(0.0, cruise) / peak, side * peak, 0.0))
        pieces.append(_Piece(fall, side * peak, -side * gain))
    return pieces


# The memory of one servo: which field stands at which address, what survives a power cut, what can't be written.
#
# All numbers come from the rig's description. Fields of two bytes have the low byte first; a ``sign_bit`` marks a
# negative number and leaves the rest its size.


class Registers:
    """``memory`` is what a host reads; ``kept`` what is there again after the supply was off."""

    def __init__(self, given: Mapping[str, Any]) -> None:
        self.fields: Mapping[str, Mapping[str, Any]] = given["fields"]
        self._kept_below, self._read_only_from = int(given["kept_below"]), int(given["read_only_from"])
        self.memory = bytearray(int(given["size"]))
        for name, field in self.fields.items():
            self.put(name, field.get("initial", 0))
        self.kept = bytes(self.memory)

    def value(self, name: str) -> int:
        """A field's number with its sign; 0 for a field that this servo does not have."""
        field = self.fields.get(name)
        if field is None:
            return 0
        start, bit = int(field["address"]), field.get("sign_bit")
        raw = int.from_bytes(self.memory[start : start + int(field["bytes"])], "little")
        if bit is not None and raw >> bit & 1:
            raw = -(raw & ~(1 << bit))
        return raw

    def put(self, name: str, number: float) -> None:
        """Set a field, kept within what fits in; nothing for a field that this servo does not have."""
        field = self.fields.get(name)
        if field is None:
            return
        width, bit = int(field["bytes"]), field.get("sign_bit")
        most = (1 << (8 * width if bit is None else bit)) - 1
        raw = min(abs(round(number)), most) if bit is not None else min(max(round(number), 0), most)
        if bit is not None and number < 0:
            raw |= 1 << bit
        self.memory[field["address"] : field["address"] + width] = raw.to_bytes(width, "little")

    def scaled(self, name: str, number: float) -> None:
        """Set a field to a measured value, in the field's own unit."""
        self.put(name, number / self.fields.get(name, {}).get("scale", 1))

    def write(self, address: int, data: bytes, *, locked: bool) -> set[str]:
        """Write a host's bytes; returns the names of the written fields. Read-only fields stay as they are."""
        touched = set()
        end = min(address + len(data), self._read_only_from)
        for place in range(address, end):
            self.memory[place] = data[place - address]
        if not locked:
            kept = bytearray(self.kept)
            kept[address : min(end, self._kept_below)] = self.memory[address : min(end, self._kept_below)]
            self.kept = bytes(kept)
        for name, field in self.fields.items():
            if field["address"] < end and address < field["address"] + field["bytes"]:
                touched.add(name)
        return touched

    def restart(self) -> None:
        """After a power cut: what was kept, and all else as it was delivered."""
        self.memory[: self._kept_below] = self.kept[: self._kept_below]
        for name, field in self.fields.items():
            if field["address"] >= self._kept_below:
                self.put(name, field.get("initial", 0))


# The packets of a half-duplex servo bus: what is a whole one, what is broken, and how an answer is written.
#
# ``FF FF id length instruction parameters... checksum``; length counts the parameters and two more, the checksum is the
# inverted sum of all after the header. An answer has the error bits in place of the instruction.

PING, READ, WRITE, LATER, ACTION, SYNC_READ, SYNC_WRITE = 0x01, 0x02, 0x03, 0x04, 0x05, 0x82, 0x83
EVERYBODY = 0xFE
VOLTAGE, ANGLE, OVERHEAT, OVERCURRENT, OVERLOAD = 0x01, 0x02, 0x04, 0x08, 0x20
"""Error bits of an answer."""
_HEADER = b"\xff\xff"


@dataclass(frozen=True)
class Packet:
    """A whole packet whose checksum is right."""

    number: int
    instruction: int
    parameters: bytes


def checksum(body: bytes) -> int:
    """Of all bytes between header and checksum."""
    return ~sum(body) & 0xFF


def packet(number: int, instruction: int, parameters: bytes = b"") -> bytes:
    """An instruction to a servo, or with error bits as the instruction its answer."""
    body = bytes([number, len(parameters) + 2, instruction]) + parameters
    return _HEADER + body + bytes([checksum(body)])


class Reader:
    """Finds the packets in what arrives, however it was cut.

    ``broken`` counts what was no packet: a wrong checksum, bytes before a header, a packet whose end did not come
    within ``patience`` seconds.
    """

    def __init__(self, patience: float) -> None:
        self.broken = 0
        self._patience, self._text, self._since = patience, b"", 0.0
        self._lost = False

    @property
    def waiting(self) -> bool:
        """Whether a packet has begun and not ended."""
        return bool(self._text)

    def clear(self) -> None:
        """Forget what has begun."""
        self._text = b""

    def read(self, data: bytes, now: float) -> list[Packet]:
        """The packets that are whole with ``data``, which arrived at ``now``."""
        if self._text and now - self._since > self._patience:
            self._lose(len(self._text))
        if data:
            self._text, self._since = self._text + data, now
        found = []
        while (one := self._next()) is not None:
            found.append(one)
        return found

    def _next(self) -> Packet | None:
        while self._text:
            start = self._text.find(_HEADER)
            if start < 0:
                start = len(self._text) - self._text.endswith(b"\xff")
            if start:
                self._lose(start)
                continue
            if len(self._text) < 4:
                return None
            number, length = self._text[2], self._text[3]
            if number == 0xFF or length < 2:
                self._lose(1)
                continue
            if len(self._text) < length + 4:
                return None
            body, given = self._text[2 : length + 3], self._text[length + 3]
            if checksum(body) != given:
                self._lose(2)
                continue
            self._text, self._lost = self._text[length + 4 :], False
            return Packet(number, body[2], body[3:])
        return None

    def _lose(self, count: int) -> None:
        """Drop bytes; what is lost in one go, up to the next good packet, counts once."""
        self._text = self._text[count:]
        self.broken += not self._lost
        self._lost = True


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
        return (OVERHEAT if hot else 0) | (VOLTAGE if low else 0)

    def write(self, address: int, data: bytes) -> int:
        """Write a host's bytes; returns the error bits of the answer."""
        before = self._memory.value("torque")
        held = self._memory.value("goal")
        locked = self._memory.value("lock") == 1
        touched = self._memory.write(address, data, locked=locked)
        if "torque" in touched:
            self._switched(bool(before))
        outside = "goal" in touched and self._asked(held)
        return self.errors | (ANGLE if outside else 0)

    def read(self, address: int, count: int) -> bytes:
        """Read bytes for a host; beyond the end of the memory there are zeros."""
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
        if self.torque and self.errors & OVERHEAT:
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
