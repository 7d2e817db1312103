"""The simulated servos of the reference rig, the runtime's units before them, and a clock that both look at."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from octoform.runtime import registers
from octoform.runtime.registers import Field, Map, Motion, NoReply, Protect
from octoform.runtime.units import Units
from octoform.simulation import servo
from octoform.simulation.rig import load
from octoform.simulation.servo import Reader, packet
from octoform.simulation.servos import ServoBus

NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
FIELDS = {
    "lowest": Field(9, 2),
    "highest": Field(11, 2),
    "torque": Field(40),
    "acceleration": Field(41),
    "goal": Field(42, 2),
    "speed": Field(46, 2),
    "position": Field(56, 2),
    "present_speed": Field(58, 2, sign_bit=15),
    "load": Field(60, 2, scale=0.1, sign_bit=10),
    "voltage": Field(62, scale=0.1),
    "temperature": Field(63),
    "moving": Field(66),
}
ARM = Map(
    unit="joint",
    units={name: number for number, name in enumerate(NAMES, 1)},
    fields=FIELDS,
    motion=Motion(
        goal="goal",
        present="position",
        lowest="lowest",
        highest="highest",
        minimum=0,
        maximum=4095,
        moved=50,
        within=4.0,
        before=(("torque", 1), ("acceleration", 20), ("speed", "speed")),
        release=(("torque", 0),),
        speeds=(50, 1500),
    ),
    protect=Protect("temperature", 65, 55, "Cel"),
)


@dataclass
class Bench:
    """``events`` are called once, at a moment of the clock or when the bus is free after it; ``signals`` in any case.

    ``writes`` are (id, address, value) in their order.
    """

    map: Map = ARM
    device: str = "usb-1a86-55d3"
    now: float = 0.0
    broken: int = 0
    opened: int = 0
    held: bool = False
    made: type[ServoBus] = ServoBus
    events: list[tuple[float, Callable[[], Any]]] = field(default_factory=list)
    signals: list[tuple[float, Callable[[], Any]]] = field(default_factory=list)
    writes: list[tuple[int, int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.bus = self.made(load("reference")["devices"]["arm"], lambda: self.now)
        registers._known.pop(self.device, None)

    def sleep(self, seconds: float) -> None:
        assert not self.held or seconds <= registers.PAUSE  # no wait for a movement with the bus held
        self.now += seconds
        for waiting in (self.signals, self.events):
            while (waiting is self.signals or not self.held) and (
                due := [item for item in waiting if item[0] <= self.now]
            ):
                waiting.remove(due[0])
                due[0][1]()

    @contextmanager
    def open(self) -> Iterator["Bench"]:
        assert not self.held, "the bus is taken twice"
        self.opened += 1
        if self.broken:
            self.broken -= 1
            raise OSError(5, "gone")
        self.held = True
        try:
            yield self
        finally:
            self.held = False

    def units(self) -> Units:
        return Units(self.map, self.device, self.open, clock=lambda: self.now, sleep=self.sleep)

    def joint(self, name: str) -> Any:
        return self.bus.servos[ARM.units[name]]

    def read(self, unit_id: int, address: int, size: int) -> int:
        return int.from_bytes(self._asked(unit_id, servo.READ, bytes([address, size])).parameters, "little")

    def write(self, unit_id: int, address: int, size: int, value: int) -> int:
        self.writes.append((unit_id, address, value))
        answer = self._asked(unit_id, servo.WRITE, bytes([address]) + value.to_bytes(size, "little"))
        return answer.instruction

    def _asked(self, unit_id: int, instruction: int, parameters: bytes) -> servo.Packet:
        self.now += 0.001
        answer = self.bus.feed(packet(unit_id, instruction, parameters))
        found = Reader(1.0).read(answer, self.now)
        if len(found) != 1:
            raise NoReply("no answer" if not answer else "a broken answer")
        return found[0]
