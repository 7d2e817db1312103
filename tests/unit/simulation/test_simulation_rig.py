"""A rig behind real terminals: the public servo library, unmodified, and any program that opens a tty."""

import os
import select
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import scservo_sdk as sdk
from scservo_sdk import port_handler

from octoform.simulation.rig import Rig, load

GIVEN = load("reference")
FIELDS = GIVEN["devices"]["arm"]["registers"]["fields"]


def described(**changes: dict[str, Any]) -> dict[str, Any]:
    """The reference rig, small and fast; ``changes`` are other values by device."""
    small: dict[str, dict[str, Any]] = {
        "arm": {"speedup": 20},
        "rail": {"speedup": 100, "sweep": None},
        "camera": {"width": 64, "height": 48, "frames": 1},
    }
    devices = {name: {**device, **small[name], **changes.get(name, {})} for name, device in GIVEN["devices"].items()}
    return {**GIVEN, "devices": devices}


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    one = Rig(described(), tmp_path / "tree")
    one.start()
    yield one
    one.stop()


def until(condition: Callable[[], bool]) -> None:
    """Wait for it; a test that waits too long fails."""
    ends = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < ends
        time.sleep(0.005)


class Arm:
    """What a program has of the arm: the library, as its makers publish it."""

    def __init__(self, node: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        # The library's own patience is 34 ms, less than what a busy machine sometimes takes to switch threads.
        monkeypatch.setattr(port_handler, "LATENCY_TIMER", 5000)
        self.port, self.packets = sdk.PortHandler(str(node)), sdk.PacketHandler(0)
        assert self.port.openPort() and self.port.setBaudRate(1_000_000)

    def read(self, number: int, name: str) -> int:
        read = self.packets.read1ByteTxRx if FIELDS[name]["bytes"] == 1 else self.packets.read2ByteTxRx
        value, result, error = read(self.port, number, FIELDS[name]["address"])
        assert (result, error) == (sdk.COMM_SUCCESS, 0), self.packets.getTxRxResult(result)
        return int(value)

    def write(self, number: int, name: str, value: int) -> int:
        """The error bits of the answer."""
        write = self.packets.write1ByteTxRx if FIELDS[name]["bytes"] == 1 else self.packets.write2ByteTxRx
        result, error = write(self.port, number, FIELDS[name]["address"], value)
        assert result == sdk.COMM_SUCCESS, self.packets.getTxRxResult(result)
        return int(error)


@pytest.fixture
def arm(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> Iterator[Arm]:
    one = Arm(rig.folder / "dev" / "ttyACM0", monkeypatch)
    yield one
    one.port.closePort()


def test_the_public_library_moves_a_servo(rig: Rig, arm: Arm) -> None:
    assert rig.servos is not None
    assert [arm.packets.ping(arm.port, number) for number in range(1, 7)] == [(777, sdk.COMM_SUCCESS, 0)] * 6
    for name, value in {"torque": 1, "acceleration": 20, "speed": 1000, "goal": 1500}.items():
        assert arm.write(1, name, value) == 0
    until(lambda: arm.read(1, "moving") == 0)
    assert (arm.read(1, "position"), arm.read(1, "temperature"), arm.read(1, "voltage")) == (1500, 25, 120)
    assert arm.write(1, "goal", 4000) == 2  # outside of the limits
    assert (rig.servos.servos[1].goals.highest, rig.servos.broken) == (4000, 0)


def test_the_public_library_talks_to_many_at_a_time(rig: Rig, arm: Arm) -> None:
    assert rig.servos is not None
    torque = sdk.GroupSyncWrite(arm.port, arm.packets, FIELDS["torque"]["address"], 1)
    for number in (3, 4):
        assert torque.addParam(number, [1])
    assert torque.txPacket() == sdk.COMM_SUCCESS
    until(lambda: arm.read(3, "torque") == 1)
    assert arm.read(4, "torque") == 0  # this rig's firmware hears only the first
    positions = sdk.GroupSyncRead(arm.port, arm.packets, FIELDS["position"]["address"], 2)
    for number in (1, 4):
        assert positions.addParam(number)
    assert positions.txRxPacket() == sdk.COMM_SUCCESS
    assert [positions.getData(number, FIELDS["position"]["address"], 2) for number in (1, 4)] == [2048, 2600]
    assert rig.servos.broken == 0


def test_a_corrupt_answer_and_a_mute_servo_are_what_the_library_calls_them(
    rig: Rig, arm: Arm, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert rig.servos is not None
    monkeypatch.setattr(port_handler, "LATENCY_TIMER", 16)
    seen = {}
    for fault in ("mute", "corrupt", "half"):
        rig.servos.servos[2].fault = fault
        _, seen[fault], _ = arm.packets.read2ByteTxRx(arm.port, 2, FIELDS["position"]["address"])
        arm.port.ser.reset_input_buffer()
    assert seen["mute"] == sdk.COMM_RX_TIMEOUT
    assert seen["half"] in (sdk.COMM_RX_CORRUPT, sdk.COMM_RX_TIMEOUT)
    assert seen["corrupt"] != sdk.COMM_SUCCESS


def test_at_a_wrong_speed_nobody_answers(rig: Rig, arm: Arm, monkeypatch: pytest.MonkeyPatch) -> None:
    assert rig.servos is not None
    monkeypatch.setattr(port_handler, "LATENCY_TIMER", 16)
    assert arm.port.setBaudRate(115_200)
    assert arm.packets.ping(arm.port, 1)[1] == sdk.COMM_RX_TIMEOUT
    until(lambda: rig.servos is not None and rig.servos.noise == 6)
    assert rig.servos.received == 0


def line_of(descriptor: int) -> bytes:
    """The next line; b"" when the line is dead."""
    text = b""
    while not text.endswith(b"\n"):
        assert select.select([descriptor], [], [], 20)[0]
        try:
            more = os.read(descriptor, 1)
        except OSError:
            more = b""
        if not more:
            return b""
        text += more
    return text


def test_the_rail_answers_and_its_sweep_yields_to_who_opens_the_port(tmp_path: Path) -> None:
    rig = Rig(described(rail={"speedup": 1, "sweep": {"X": 1500}}), tmp_path)
    rig.start()
    rail = rig.line
    assert rail is not None
    until(lambda: rail.position["X"] > 5)
    descriptor = os.open(tmp_path / "dev" / "ttyACM1", os.O_RDWR | os.O_NOCTTY)
    os.write(descriptor, b"MOVE_Y -10\n")
    assert line_of(descriptor) == b"OK\n"
    there = rail.position
    assert there["Y"] == -10 and rail.position == there
    os.write(descriptor, b"HOME\n")
    assert line_of(descriptor) == b"OK\n" and rail.position == {"X": 0, "Y": 0}
    os.close(descriptor)
    until(lambda: rail.position["X"] > 5)
    rig.stop()


def test_what_nobody_read_is_not_the_answer_of_the_next_one(rig: Rig) -> None:
    assert rig.line is not None
    node = rig.folder / "dev" / "ttyACM1"
    first = os.open(node, os.O_RDWR | os.O_NOCTTY)
    os.write(first, b"NONSENSE\nNONSENSE\n")
    until(lambda: rig.line is not None and len(rig.line.lines) == 2)
    os.close(first)
    until(lambda: not rig.line or rig.line.alone)
    second = os.open(node, os.O_RDWR | os.O_NOCTTY)
    os.write(second, b"HOME\n")
    assert line_of(second) == b"OK\n"
    os.close(second)


def usb(rig: Rig) -> list[str]:
    return sorted(path.name for path in (rig.folder / "sys" / "bus" / "usb" / "devices").iterdir())


def test_unplugged_the_line_is_dead_and_plugged_elsewhere_the_device_is_the_same(rig: Rig) -> None:
    node = rig.folder / "dev" / "ttyACM1"
    descriptor = os.open(node, os.O_RDWR | os.O_NOCTTY)
    os.write(descriptor, b"MOVE_X 7\n")
    assert line_of(descriptor) == b"OK\n"
    rig.unplug("rail")
    assert line_of(descriptor) == b"" and not node.is_symlink()
    assert rig.line is not None and rig.line.alone
    os.close(descriptor)
    assert usb(rig) == ["1-4", "1-4:1.0", "2-1", "2-1:1.0"]
    rig.plug("rail", port="1-7", node="ttyACM5")
    assert rig.places["rail"] == ("1-7", "ttyACM5") and "1-7:1.0" in usb(rig)
    device = (rig.folder / "sys/class/tty/ttyACM5").resolve()
    assert (device / "dev").read_text() == "166:5\n"
    assert (device.parents[2] / "serial").read_text() == (GIVEN["devices"]["rail"]["strings"]["serial"] + "\n")
    assert rig.line.position["X"] == 7


def test_a_device_that_unplugs_itself_is_gone_from_the_tree(rig: Rig) -> None:
    assert rig.line is not None
    rig.line.fault = "gone"
    descriptor = os.open(rig.folder / "dev" / "ttyACM1", os.O_RDWR | os.O_NOCTTY)
    os.write(descriptor, b"MOVE_X 7\n")
    assert line_of(descriptor) == b""
    os.close(descriptor)
    until(lambda: "1-6" not in usb(rig))
    rig.line.fault = None
    rig.plug("rail")
    assert rig.line.position["X"] == 0 and "1-6" in usb(rig)


def test_a_port_that_is_taken_is_refused(rig: Rig) -> None:
    rig.unplug("rail")
    with pytest.raises(ValueError, match="1-4 is taken"):
        rig.plug("rail", port="1-4")
    with pytest.raises(ValueError, match="ttyACM0 is taken"):
        rig.plug("rail", node="ttyACM0")
    with pytest.raises(ValueError, match="plugged already"):
        rig.plug("arm")


@pytest.mark.parametrize(("changes", "named"), [({}, True), ({"arm": {"anonymous": True}}, False)])
def test_the_strings_name_the_arm_unless_they_shall_not(tmp_path: Path, changes: dict[str, Any], named: bool) -> None:
    unplugged = {name: {"unplugged": True} for name in ("rail", "camera")}
    rig = Rig(described(**unplugged, **changes), tmp_path)
    rig.start()
    folder = (tmp_path / "sys/bus/usb/devices/1-4").resolve()
    text = " ".join((folder / name).read_text() for name in ("manufacturer", "product", "serial"))
    rig.stop()
    assert ("SO-ARM101" in text, (folder / "product").exists()) == (named, False)


def test_nothing_is_left_of_it(rig: Rig) -> None:
    rig.stop()
    assert [path for path in rig.folder.rglob("*") if path.is_symlink() or path.is_file()] == []
