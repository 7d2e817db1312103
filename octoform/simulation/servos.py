"""A half-duplex bus of servos, from the bytes that arrive to the bytes that go back.

It keeps count as the hardware's witness: packets received, broken and overlapping ones, and per servo the farthest
goals and positions. A second instruction that arrives before the first could be answered collides with the answer:
both are lost, and counted.
"""

import math
import threading
import time
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.clock import Clock
from octoform.simulation import servo as packets
from octoform.simulation.servo import Packet, Reader, Servo, packet

# The shape of an arm: where its joints are in space, and what gravity asks of each motor.
#
# The description's ``linkage`` lists the links from the shoulder up. All of them move in one upright plane, which
# ``turn`` turns about the base; ``roll`` and ``grip`` are the last joint and the jaws.

GRAVITY = 9.81
Point = tuple[float, float, float]


class Linkage:
    """``positions`` are raw counts by unit number, everywhere."""

    def __init__(self, given: Mapping[str, Any], counts: int) -> None:
        self.given, self._counts = given, counts
        self._links: list[Mapping[str, Any]] = list(given.get("links", ()))

    def angle(self, count: float) -> float:
        """Radians away from the centre of a turn."""
        return (count - self._counts / 2) * math.tau / self._counts

    def moments(self, positions: Mapping[int, float]) -> dict[int, float]:
        """Newton metres that the weight asks of the motor of each link, positive where it pulls the count up."""
        ends = self._plane(positions)
        found = {}
        for first, link in enumerate(self._links):
            moment = 0.0
            for begin, end, one in list(zip(ends, ends[1:], self._links, strict=False))[first:]:
                moment += one["mass"] * GRAVITY * ((begin[0] + end[0]) / 2 - ends[first][0])
            found[link["joint"]] = -moment * link["sign"]
        return found

    def _plane(self, positions: Mapping[int, float]) -> list[tuple[float, float]]:
        """(outwards, up) of the shoulder and the end of each link, in metres."""
        out, up, angle = 0.0, float(self.given.get("base", 0.0)), 0.0
        ends = [(out, up)]
        for link in self._links:
            angle += math.radians(link["offset"]) + link["sign"] * self.angle(positions[link["joint"]])
            out, up = out + link["length"] * math.cos(angle), up + link["length"] * math.sin(angle)
            ends.append((out, up))
        return ends

    def points(self, positions: Mapping[int, float]) -> list[Point]:
        """Base, shoulder and the end of each link: x, y along the bench and z up, in metres."""
        turn = self.angle(positions[self.given["turn"]]) if "turn" in self.given else 0.0
        plane = self._plane(positions)
        return [(0.0, 0.0, 0.0), *((out * math.cos(turn), out * math.sin(turn), up) for out, up in plane)]


DROPPED = "dropped"


class ServoBus:
    """``servos`` by the id that the description gives them; ``bus_fault`` is None or ``dropped``."""

    def __init__(self, description: Mapping[str, Any], clock: Clock = time.monotonic) -> None:
        self.description, self._clock = description, clock
        speedup = description.get("speedup", 1)
        self._fast: Clock = clock if speedup == 1 else lambda: clock() * speedup
        self.servos = {number: Servo(number, description, self._fast) for number in description["servos"]}
        self.linkage = Linkage(description.get("linkage", {}), description["motor"]["counts"])
        self._reader = Reader(description["patience"])
        self.received = self.overlapping = self.noise = 0
        self.bus_fault: str | None = None
        self._left: int | None = None
        self._until: float | None = None
        self._lock = threading.RLock()
        self.advance()

    @property
    def baud(self) -> int | None:
        """The speed of the line at which the servos understand; None for any."""
        return int(self.description["baud"])

    @property
    def corrupt(self) -> int:
        """The received bytes that were no packet."""
        return self._reader.broken

    @property
    def broken(self) -> int:
        """Packets that arrived corrupted, cut short or on top of another."""
        return self._reader.broken + self.overlapping

    @property
    def due(self) -> float | None:
        """When there is something to say unasked: never."""
        return None

    def opened(self) -> None:
        """A host has the port open; servos do not notice."""

    def closed(self) -> None:
        """No host has the port open any more."""

    def garbled(self, data: bytes) -> None:
        """Bytes at a wrong speed: nothing that a servo could take for a packet."""
        self.noise += len(data)

    def drop(self, *, transactions: int | None = None, seconds: float | None = None) -> None:
        """No answers for so many transactions or seconds; without either until ``bus_fault`` is None again."""
        self.bus_fault, self._left = DROPPED, transactions
        self._until = None if seconds is None else self._clock() + seconds

    def feed(self, data: bytes) -> bytes:
        """The answers to what arrived, in their order."""
        with self._lock:
            self.advance()
            found = self._reader.read(data, self._clock())
            self.received += len(found)
            out = b""
            for place, one in enumerate(found):
                if one in found[place + 1 : place + 2]:
                    continue  # a host that waited, gave up and asked again, while this side had no time to read
                answer = self._transaction(one)
                if answer and (place + 1 < len(found) or self._reader.waiting):
                    self.overlapping += 1
                    self._reader.clear()
                    break
                out += answer
            return out

    def advance(self) -> None:
        """Bring loads, supply and heat to the present."""
        with self._lock:
            moments = self.linkage.moments(self.positions()) if self.linkage.given else {}
            sag = self.description["supply"]["ohms"] * sum(servo.current for servo in self.servos.values()) / 1000
            for number, servo in self.servos.items():
                servo.moment, servo.sag = moments.get(number, 0.0), sag
                servo.warm()

    def positions(self) -> dict[int, float]:
        """Where each shaft is, in counts."""
        with self._lock:
            return {number: servo.position for number, servo in self.servos.items()}

    def power_cycle(self) -> None:
        """The supply of the bus was off for a moment."""
        with self._lock:
            for servo in self.servos.values():
                servo.power_cycle()

    def _transaction(self, one: Packet) -> bytes:
        if self._dropping():
            return b""
        if one.instruction == packets.SYNC_WRITE:
            self._sync_write(one.parameters)
            return b""
        if one.instruction == packets.SYNC_READ and len(one.parameters) >= 2:
            address, count = one.parameters[:2]
            asked = [Packet(number, packets.READ, bytes([address, count])) for number in one.parameters[2:]]
            return b"".join(self._answer(read) for read in asked)
        answer = self._answer(one)
        return b"" if one.number == packets.EVERYBODY else answer

    def _dropping(self) -> bool:
        if self.bus_fault != DROPPED:
            return False
        if self._left is not None:
            self._left -= 1
        over = self._left is not None and self._left < 0
        if over or (self._until is not None and self._clock() >= self._until):
            self.bus_fault = None
        return self.bus_fault is not None

    def _answer(self, one: Packet) -> bytes:
        """The answers of all servos that the packet is for; two with one id talk at once, and spoil it."""
        answers = [answer for servo in self._meant(one.number) if (answer := _served(servo, one))]
        if len(answers) < 2:
            return b"".join(answers)
        return bytes(first & second for first, second in zip(*answers[:2], strict=False))

    def _meant(self, number: int) -> Iterator[Servo]:
        for servo in self.servos.values():
            if number in (packets.EVERYBODY, servo.number):
                yield servo

    def _sync_write(self, text: bytes) -> None:
        if len(text) < 2:
            return
        address, count = text[0], text[1]
        parts = [text[place : place + count + 1] for place in range(2, len(text), count + 1)]
        if self.description.get("sync_write") == "first":
            parts = parts[:1]
        for part in parts:
            if len(part) == count + 1:
                for servo in self._meant(part[0]):
                    servo.write(address, part[1:])


def _served(servo: Servo, one: Packet) -> bytes:
    """One servo's answer to one instruction; nothing for one that it does not know."""
    error, found = servo.errors, b""
    if one.instruction == packets.READ and len(one.parameters) == 2:
        found = servo.read(*one.parameters)
    elif one.instruction == packets.WRITE and len(one.parameters) > 1:
        number = servo.number
        error = servo.write(one.parameters[0], one.parameters[1:])
        return _spoilt(servo, packet(number, error))
    elif one.instruction == packets.LATER and len(one.parameters) > 1:
        servo.later(one.parameters[0], one.parameters[1:])
    elif one.instruction == packets.ACTION:
        servo.act()
    elif one.instruction != packets.PING:
        return b""
    return _spoilt(servo, packet(servo.number, error, found))


def _spoilt(servo: Servo, answer: bytes) -> bytes:
    if servo.fault == "mute":
        return b""
    if servo.fault == "corrupt":
        return answer[:-1] + bytes([answer[-1] ^ 0x55])
    return answer[: len(answer) // 2] if servo.fault == "half" else answer
