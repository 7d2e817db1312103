"""Units on a bus in the generated server: its adapter to a library, and its tools before simulated servos."""

import re
import sys
import types
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import octoform.runtime
from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.serve.stage import render
from octoform.contracts.model import Artifacts
from octoform.contracts.rules.serve.device_rules import RULES as DEVICE_RULES
from octoform.contracts.rules.serve.serve_rules import ACTUATE_RULES
from octoform.profiles import for_task, load
from octoform.runtime import DeviceFault
from octoform.simulation import servo
from octoform.simulation.rig import load as rig
from octoform.simulation.servo import Reader, packet
from octoform.simulation.servos import ServoBus

DEVICE = "usb-1a86-55d3"
BOARD = {"id": DEVICE, "name": "arm", "interface": "usb", "raw_descriptor": "product: arm", "classes": ["tty"]}
(ARM,), _ = load([Path(__file__).parents[3] / "profiles" / "so-arm101.md"])
TIMEOUT, CORRUPT = -6, -7


class Library:
    """A servo library's own two classes and the results that they give, over the simulated bus."""

    def __init__(self) -> None:
        self.now, self.late = 0.0, b""
        self.ports: list[Any] = []
        self.bus = ServoBus(rig("reference")["devices"]["arm"], lambda: self.now)
        self.sound = True
        self.short = False
        library = self

        class Port:
            tx_time_per_byte = 0.01

            def __init__(self, node: str) -> None:
                self.node, self.is_open, self.baud, self.closed = node, False, 0, 0
                self.ser = types.SimpleNamespace(reset_input_buffer=lambda: setattr(library, "late", b""))
                library.ports.append(self)

            def setBaudRate(self, baud: int) -> bool:
                self.baud, self.is_open = baud, library.sound
                return library.sound

            def closePort(self) -> None:
                self.is_open, self.closed = False, self.closed + 1

        self.module = types.SimpleNamespace(PortHandler=Port, PacketHandler=lambda end: Packets(library, end))

    def sleep(self, seconds: float) -> None:
        self.now += seconds


class Packets:
    def __init__(self, library: Library, end: int) -> None:
        assert end == 0
        self._library = library
        for size in (1, 2, 4):
            setattr(self, f"read{size}ByteTxRx", partial(self._read, size))
            setattr(self, f"write{size}ByteTxRx", partial(self._write, size))

    def _read(self, size: int, port: Any, unit: int, address: int) -> tuple[int, int, int]:
        found = self._answer(port, packet(unit, servo.READ, bytes([address, size])))
        if isinstance(found, int):
            return 0, found, 0
        if self._library.short:
            return found.parameters[size], 0, 0  # as the library does for a sound packet that is too short
        return int.from_bytes(found.parameters[:size], "little"), 0, found.instruction

    def _write(self, size: int, port: Any, unit: int, address: int, value: int) -> tuple[int, int]:
        found = self._answer(port, packet(unit, servo.WRITE, bytes([address]) + value.to_bytes(size, "little")))
        return (found, 0) if isinstance(found, int) else (0, found.instruction)

    def _answer(self, port: Any, data: bytes) -> servo.Packet | int:
        assert port.is_open and port.baud == 1_000_000
        self._library.now += 0.001
        text = self._library.late + self._library.bus.feed(data)
        found = Reader(1.0).read(text, self._library.now)
        if not found:
            return CORRUPT if text else TIMEOUT
        return found[0]


@pytest.fixture(scope="module")
def source() -> str:
    assert ARM is not None
    task = [for_task(ARM, {DEVICE})]
    named = identify({"devices": [BOARD]}, IdDatabases(Path("/nonexistent")), task)
    return render(declare(named, 30, task), task)


@pytest.fixture
def library() -> Library:
    return Library()


@pytest.fixture
def server(source: str, library: Library, monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    monkeypatch.setitem(sys.modules, "runtime", octoform.runtime)
    monkeypatch.setitem(sys.modules, "scservo_sdk", library.module)
    monkeypatch.setattr(octoform.runtime.registers, "_known", {})
    loaded = types.ModuleType("server")
    exec(compile(source, "server.py", "exec"), loaded.__dict__)

    def units(known: Any, device: str, opened: Any) -> Any:
        return octoform.runtime.units.Units(known, device, opened, lambda: library.now, library.sleep)

    names = {**octoform.runtime.__dict__, "device": _device, "units": types.SimpleNamespace(Units=units)}
    loaded.runtime = types.SimpleNamespace(**names)  # type: ignore[attr-defined]
    return loaded


def _device(name: str, actuate: bool = False) -> Any:
    @contextmanager
    def bus() -> Iterator[Any]:
        yield types.SimpleNamespace(node=lambda kind: f"/dev/{kind}{'!' if actuate else ''}")

    assert name == DEVICE
    return types.SimpleNamespace(bus=bus)


def test_the_tools_drive_the_servos(server: types.ModuleType, library: Library) -> None:
    assert server.arm_read_joint("elbow_flex")["position"] == 3080
    assert server.arm_move_joint("elbow_flex", 2080)["position"] == 2080
    home = {record["joint"]: record["position"] for record in server.arm_home(speed=1500)["joints"]}
    assert home == dict.fromkeys(home, 2048) | {"elbow_flex": 1100}
    goals = dict.fromkeys(home, 2100) | {"speed": 800}
    assert {record["position"] for record in server.arm_move_joints(**goals)["joints"]} == {2100}
    assert server.arm_set_torque("gripper", on=False)["on"] is False
    assert {record["released"] for record in server.arm_rest(speed=1500)["joints"]} == {True}
    assert len(server.arm_status()["joints"]) == len(server.arm_stop()["joints"]) == 6
    with pytest.raises(DeviceFault, match="no calibrated scale"):
        server.arm_move_joint_calibrated("elbow_flex", 10)
    assert {port.closed for port in library.ports} == {1} and not any(port.is_open for port in library.ports)
    assert {port.node for port in library.ports} == {"/dev/tty", "/dev/tty!"}
    assert all(port.ser.timeout > 0 for port in library.ports), "the library asks for bytes all the time"


def test_results_have_the_members_that_were_promised(server: types.ModuleType) -> None:
    types_of = server.arm_status.__annotations__["return"], server.arm_rest.__annotations__["return"]
    status, rest = server.arm_status(), server.arm_rest()
    for kind, value in zip(types_of, (status, rest), strict=True):
        (record,) = kind.__annotations__["joints"].__args__
        assert kind.__annotations__.keys() == value.keys()
        assert all(record.__annotations__.keys() == item.keys() for item in value["joints"])


def test_a_late_answer_is_not_the_answer_to_the_next_request(server: types.ModuleType, library: Library) -> None:
    library.late = packet(3, 0, bytes([99]))
    assert server.arm_read_joint("elbow_flex")["temperature"] == 25


@pytest.mark.parametrize(
    ("fault", "told"),
    [("mute", "twice (no answer)"), ("corrupt", "twice (a broken answer)"), ("half", "twice (a broken answer)")],
)
def test_what_the_library_calls_no_answer_is_one(
    server: types.ModuleType, library: Library, fault: str, told: str
) -> None:
    library.bus.servos[3].fault = fault
    with pytest.raises(DeviceFault) as problem:
        server.arm_read_joint("elbow_flex")
    assert told in str(problem.value) and library.ports[-1].closed == 1


def test_a_sound_packet_of_another_length_is_no_answer(server: types.ModuleType, library: Library) -> None:
    library.short = True
    with pytest.raises(DeviceFault, match="an answer of another length"):
        server.arm_read_joint("elbow_flex")


def test_the_contract_sees_the_librarys_port_as_a_device(source: str) -> None:
    held = "with runtime.device(device, actuate=actuate).bus() as unit:"
    assert held in source and not codes(source) & {"SERVE-BUS-UNLOCKED", "SERVE-ACTUATE-UNBOUND"}
    bare = source.replace(held, "if unit := runtime.device(device, actuate=actuate):")
    assert "SERVE-BUS-UNLOCKED" in codes(bare)
    assert "SERVE-ACTUATE-UNBOUND" in codes(source.replace("device(device, actuate=actuate).bus", "device(device).bus"))


def codes(source: str) -> set[str]:
    """What the contract of SERVE has against a server."""
    interface = {
        "tools": [
            {"name": f"arm_{name}", "effect": "read" if name in ("status", "read_joint") else "actuate"}
            for name in re.findall(r"runtime.logged\(arm_(\w+)\)", source)
        ]
    }
    found = (rule.check(source, Artifacts(interface=interface)) for rule in (*DEVICE_RULES, *ACTUATE_RULES))
    return {item.code for items in found for item in items}


def test_a_library_that_cannot_talk_at_the_speed_says_so(server: types.ModuleType, library: Library) -> None:
    library.sound = False
    with pytest.raises(DeviceFault, match="cannot talk at 1000000 baud"):
        server.arm_read_joint("elbow_flex")
    assert library.ports[-1].closed == 0  # never was open


def test_a_servo_that_reports_its_own_fault_is_not_moved(server: types.ModuleType, library: Library) -> None:
    library.bus.servos[3].registers[15] = 200  # its lowest voltage, above the supply's
    with pytest.raises(DeviceFault, match=r"reports a fault of its own \(flags 0x01\); it was not moved"):
        server.arm_move_joint("elbow_flex", 2080)
    assert library.bus.servos[3].position == 3080
