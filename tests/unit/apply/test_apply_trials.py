"""Trials on simulated firmware, in virtual time: what really moved counts, never what was acknowledged."""

import random
import statistics
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from octoform.apply.camera_trial import by_frame, by_view
from octoform.apply.context import Clock
from octoform.apply.reading_trial import Bench, Tried, by_reading
from octoform.apply.trial_tools import Seen, ToolAnswer, Value, fitting
from octoform.endpoint.scripts.picture import digest, grain_of
from octoform.perception.capture import Picture
from octoform.protocol.model import Proof
from octoform.simulation import servo
from octoform.simulation.rail_firmware import LineDevice
from octoform.simulation.rig import load
from octoform.simulation.scene import Scene, Sensor
from octoform.simulation.servos import ServoBus

JOINTS = {"shoulder_pan": 1, "shoulder_lift": 2, "elbow_flex": 3, "wrist_flex": 4, "wrist_roll": 5, "gripper": 6}
RIG = load("reference")["devices"]
POSITION = {"type": "integer", "minimum": 0, "maximum": 4095}
STEPS = {"type": "integer", "minimum": -2000, "maximum": 2000}
TOOLS: dict[str, dict[str, Any]] = {
    "arm_move_joint": {"input_schema": {"properties": {"position": POSITION}}},
    "arm_set_torque": {"input_schema": {"properties": {"on": {"type": "boolean"}}}},
    "rail_move_x": {"input_schema": {"properties": {"steps": STEPS}}},
}
READING = Proof("reading", 50, "raw", 2.0)
VIEW = Proof("view", 3, "levels", 3.0)


class Time:
    """Seconds that pass when somebody waits."""

    def __init__(self) -> None:
        self.now = 100.0

    def wait(self, seconds: float) -> None:
        self.now += seconds


def read(bus: ServoBus, number: int, address: int, size: int) -> int:
    answer = bus.feed(servo.packet(number, servo.READ, bytes([address, size])))
    assert answer, "the servo does not answer"
    return int.from_bytes(answer[5:-1], "little")


def write(bus: ServoBus, number: int, address: int, size: int, value: int) -> None:
    bus.feed(servo.packet(number, servo.WRITE, bytes([address]) + value.to_bytes(size, "little")))


@dataclass
class Arm:
    """The arm's tools as somebody may write them who trusts acknowledgements; ``before`` is what goes out first.

    ``keeps`` is the answer of the tool that does not set the torque.
    """

    time: Time
    bus: ServoBus
    before: Callable[[ServoBus, int], None] = lambda bus, number: write(bus, number, 40, 1, 1)
    skipped: dict[str, str] = field(default_factory=dict)
    refusal: ToolAnswer | None = None
    keeps: ToolAnswer | None = None
    calls: list[tuple[str, dict[str, Any]]] = field(default_factory=list)

    def call(self, tool: str, arguments: Mapping[str, Any]) -> ToolAnswer:
        self.calls.append((tool, dict(arguments)))
        joint = arguments["joint"]
        number = JOINTS[joint]
        self.time.wait(0.01)
        if joint in self.skipped:
            return ToolAnswer({"joint": joint, "position": None, "skipped": self.skipped[joint]})
        if tool == "arm_read_joint":
            fields = {"joint": joint, "position": read(self.bus, number, 56, 2), "skipped": None}
            return ToolAnswer({**fields, "torque": read(self.bus, number, 40, 1)})
        if tool == "arm_set_torque":
            if self.keeps is None:
                write(self.bus, number, 40, 1, int(arguments["on"]))
            return self.keeps or ToolAnswer({"joint": joint})
        if self.refusal is not None:
            return self.refusal
        low, high = read(self.bus, number, 9, 2), read(self.bus, number, 11, 2)
        if not low <= arguments["position"] <= high:
            return ToolAnswer(None, f"{joint} goes from {low} to {high}; nothing was moved")
        self.before(self.bus, number)
        write(self.bus, number, 46, 2, 400)
        write(self.bus, number, 42, 2, arguments["position"])
        return ToolAnswer({"joint": joint, "goal": arguments["position"]})

    def look(self, view: Mapping[str, Any]) -> Seen:
        raise AssertionError(f"no one looks: {view}")


def an_arm(**more: Any) -> Arm:
    time = Time()
    return Arm(time, ServoBus(RIG["arm"], lambda: time.now), **more)


def bench(hand: Any, proof: Proof, folder: Path = Path("/nowhere")) -> Bench:
    clock = Clock(monotonic=lambda: hand.time.now, sleep=hand.time.wait)
    return Bench(proof, hand, TOOLS, clock, folder)


def a_trial(joint: str, by: float = 200) -> dict[str, Any]:
    move = {"tool": "arm_move_joint", "arguments": {"joint": joint}, "vary": "position", "by": by, "relative": False}
    return {
        "unit": joint,
        "move": move,
        "read": {"tool": "arm_read_joint", "arguments": {"joint": joint}, "value": "/position"},
        "view": None,
    }


def tried(arm: Arm, joint: str = "elbow_flex", by: float = 200) -> Tried:
    return by_reading(bench(arm, READING), a_trial(joint, by), "/trials/0")


def restored(arm: Arm, joint: str = "elbow_flex", value: str = "/torque") -> Tried:
    """A hardware test that defines how the torque is put back."""
    given = {"joint": joint}
    back = {
        "read": {"tool": "arm_read_joint", "arguments": given, "value": value},
        "set": {"tool": "arm_set_torque", "arguments": given, "vary": "on"},
    }
    return by_reading(bench(arm, READING), {**a_trial(joint), "restore": back}, "/trials/0")


def codes(one: Tried) -> list[str]:
    return [item.code for item in one.found]


@pytest.mark.parametrize("joint", JOINTS)
def test_each_joint_moves_away_and_back(joint: str) -> None:
    arm = an_arm()
    one = tried(arm, joint)
    assert codes(one) == []
    assert one.before is not None and one.after is not None and one.back is not None
    assert abs(one.after - one.before) > 150 and abs(one.back - one.before) < 30
    assert abs(arm.bus.servos[JOINTS[joint]].position - one.before) < 30
    assert one.goal is not None and abs(one.goal - one.before) == 200
    assert len(one.readings) >= 5 and one.readings[0][1] == one.before


def test_a_stuck_servo_acknowledges_and_fails() -> None:
    arm = an_arm()
    arm.bus.servos[3].fault = "stuck"
    one = tried(arm)
    assert codes(one) == ["STEP-NOT-MOVED"]
    (found,) = one.found
    assert found.summary == "elbow_flex did not move: 3080 raw before, goal 2880, 3080 after; at least 50 were wanted"
    assert found.pointer == "/trials/0" and found.detail == "arm_move_joint answered that all is well"
    # It is not left with a goal that it would leap to when it comes free.
    assert arm.calls[-1] == ("arm_move_joint", {"joint": "elbow_flex", "position": 3080})


@pytest.mark.parametrize("manner", ["never written", "deaf"])
def test_torque_that_is_never_on_fails(manner: str) -> None:
    arm = an_arm()
    if manner == "deaf":
        arm.bus.servos[5].fault = "deaf_torque"
    else:
        arm.before = lambda bus, number: None
    one = tried(arm, "wrist_roll")
    assert codes(one) == ["STEP-NOT-MOVED"]
    assert one.before == one.after == 2048 and not arm.bus.servos[5].torque


def test_the_time_to_settle_is_waited_for_and_no_more() -> None:
    arm = an_arm()
    arm.bus.servos[3].fault = "stuck"
    began = arm.time.now
    tried(arm)
    assert 2.0 <= arm.time.now - began < 6.0


def test_the_way_is_the_one_with_more_room_and_within_the_bounds() -> None:
    arm = an_arm()
    arm.bus.servos[5].position = 4000
    assert tried(arm, "wrist_roll").goal == 3800
    arm.bus.servos[5].position = 100
    assert tried(arm, "wrist_roll").goal == 300
    assert [given["position"] for tool, given in arm.calls if tool == "arm_move_joint"] == [3800, 4000, 300, 100]
    TOOLS["narrow"] = {"input_schema": {"properties": {"position": {**POSITION, "minimum": 80, "maximum": 120}}}}
    narrow = a_trial("wrist_roll")
    narrow["move"]["tool"] = "narrow"
    one = by_reading(bench(arm, READING), narrow, "/trials/0")
    assert codes(one) == ["STEP-NO-ROOM"] and "position is from 80 to 120" in str(one.found[0].detail)


def test_where_a_unit_holds_a_limit_of_its_own_the_other_way_is_taken() -> None:
    arm = an_arm()
    arm.bus.servos[6].position = 2060
    one = tried(arm, "gripper")
    assert codes(one) == [] and one.goal == 2260
    arm.bus.servos[2].position = 3100  # 3250 is its highest, and more than half of all counts lie below
    write(arm.bus, 2, 9, 2, 3050)
    one = tried(arm, "shoulder_lift", by=120)
    assert codes(one) == [] and one.goal == 3220


def test_a_unit_that_the_tool_skips_is_a_finding() -> None:
    arm = an_arm(skipped={"shoulder_pan": "motor is broken"})
    one = tried(arm, "shoulder_pan")
    assert codes(one) == ["STEP-UNIT-SKIPPED"] and one.found[0].detail == "motor is broken"
    assert [name for name, _ in arm.calls] == ["arm_read_joint"]


def test_a_refusal_of_the_endpoint_is_told_as_such_and_an_emergency_stop_ends_all() -> None:
    one = tried(an_arm(refusal=ToolAnswer(None, "arm_move_joint is denied by policy.tools", refused=True)))
    assert codes(one) == ["STEP-CALL-REFUSED"] and not one.over
    arm = an_arm(refusal=ToolAnswer(None, "emergency stop: engaged", refused=True, over=True))
    one = tried(arm)
    assert codes(one) == ["STEP-CALL-REFUSED"] and one.over
    assert [name for name, _ in arm.calls] == ["arm_read_joint", "arm_move_joint"]


def test_an_emergency_stop_on_the_way_back_is_no_success() -> None:
    class Latched(Arm):
        def call(self, tool: str, arguments: Mapping[str, Any]) -> ToolAnswer:
            if tool == "arm_move_joint" and any(name == tool for name, _ in self.calls):
                return ToolAnswer(None, "emergency stop: engaged", refused=True, over=True)
            return super().call(tool, arguments)

    time = Time()
    one = tried(Latched(time, ServoBus(RIG["arm"], lambda: time.now)))
    assert codes(one) == ["STEP-NOT-BACK"] and one.over
    assert one.found[0].detail == "emergency stop: engaged"


def test_what_a_tool_says_of_a_unit_that_stays_is_kept() -> None:
    one = tried(an_arm(refusal=ToolAnswer(None, "elbow_flex is hot")))
    assert codes(one) == ["STEP-NOT-MOVED"] and one.found[0].detail == "arm_move_joint answered: elbow_flex is hot"


def test_a_unit_that_was_limp_is_limp_again_and_one_that_held_goes_on_holding() -> None:
    arm = an_arm()
    one = restored(arm)
    assert codes(one) == [] and one.restored and one.to_document()["restored"] is True
    assert arm.calls[-2] == ("arm_set_torque", {"joint": "elbow_flex", "on": False})
    assert not arm.bus.servos[3].torque and one.back is not None
    arm.bus.servos[5].registers[40] = 1
    one = restored(arm, "wrist_roll")
    assert codes(one) == [] and arm.bus.servos[5].torque and "restored" not in one.to_document()
    assert [given for tool, given in arm.calls if tool == "arm_set_torque"] == [{"joint": "elbow_flex", "on": False}]
    assert tried(arm, "gripper").restored is False and arm.bus.servos[6].torque


def test_a_failed_trial_is_restored_too_unless_nothing_can_be_called() -> None:
    arm = an_arm()
    arm.bus.servos[3].fault = "stuck"
    one = restored(arm)
    assert codes(one) == ["STEP-NOT-MOVED"] and one.restored and not arm.bus.servos[3].torque
    arm = an_arm(refusal=ToolAnswer(None, "emergency stop: engaged", refused=True, over=True))
    one = restored(arm)
    assert codes(one) == ["STEP-CALL-REFUSED"] and one.over
    assert arm.calls[-1][0] == "arm_move_joint"


def test_what_is_not_restored_is_a_warning() -> None:
    arm = an_arm(keeps=ToolAnswer(None, "denied by policy.tools", refused=True))
    one = restored(arm)
    (found,) = one.found
    assert (found.code, found.severity, found.pointer) == ("STEP-NOT-RESTORED", "warning", "/trials/0/restore")
    assert found.summary.endswith("/torque of arm_read_joint was 0 before the hardware test, is 1 now, and stays so")
    assert found.detail == "denied by policy.tools" and not one.restored and one.back is not None
    one = restored(an_arm(keeps=ToolAnswer({})))
    assert codes(one) == ["STEP-NOT-RESTORED"] and one.found[0].detail is None
    one = restored(an_arm(keeps=ToolAnswer(None, "emergency stop: engaged", refused=True, over=True)))
    assert codes(one) == ["STEP-NOT-RESTORED"] and one.over and "is unknown now" in one.found[0].summary


def test_what_cannot_be_read_is_not_guessed() -> None:
    arm = an_arm()
    one = restored(arm, value="/joint")
    assert codes(one) == ["STEP-NOT-RESTORED"] and one.back is not None
    assert "/joint of arm_read_joint could not be read before the hardware test" in one.found[0].summary
    assert "arm_set_torque" not in [name for name, _ in arm.calls]


@pytest.mark.parametrize(
    ("kind", "given", "sent"),
    [
        ("boolean", 0, False),
        ("boolean", True, True),
        ("integer", True, 1),
        ("integer", 2.0, 2),
        ("number", False, 0),
        ("number", 2.5, 2.5),
        (["number", "integer"], 3, 3),
    ],
)
def test_a_value_is_set_as_its_parameter_takes_it(kind: object, given: Value, sent: Value) -> None:
    found = fitting(given, {"input_schema": {"properties": {"level": {"type": kind}}}}, "level")
    assert found == sent and type(found) is type(sent)


def test_a_result_without_a_number_is_no_reading() -> None:
    arm = an_arm()
    wrong = a_trial("elbow_flex")
    wrong["read"]["value"] = "/joint"
    one = by_reading(bench(arm, READING), wrong, "/trials/4")
    assert codes(one) == ["STEP-NO-READING"] and one.found[0].pointer == "/trials/4/read/value"


@dataclass
class Rail:
    """The rail's tool, held open as the runtime holds it, and the camera that rides on it."""

    time: Time
    line: LineDevice
    scene: Scene
    dark: bool = False
    flicker: random.Random | None = None
    sensor: Sensor | None = None
    frozen: bool = False
    last: bytes = b""
    exposure: float = 0.3
    looks: list[float] = field(default_factory=list)

    def call(self, tool: str, arguments: Mapping[str, Any]) -> ToolAnswer:
        assert tool == "rail_move_x"
        self.line.opened()
        answer = self.line.feed(f"MOVE_X {arguments['steps']}\n".encode())
        for _ in range(300):
            if answer:
                break
            self.time.wait(0.1)
            answer = self.line.feed(b"")
        text = answer.decode().strip()
        return ToolAnswer({"answer": text}) if text == "OK" else ToolAnswer(None, f"refused: {text}")

    def look(self, view: Mapping[str, Any]) -> Seen:
        assert view == {"tool": "capture_image", "arguments": {}}
        self.looks.append(self.time.now)
        self.time.wait(self.exposure)
        if self.dark:
            return Seen(Picture(1.0, 0.5, bytes(64 * 48)), b"dark", "image/jpeg")
        luma, _, _ = self.scene.frame(320, 240)
        if self.sensor is not None:
            luma = self.last if self.frozen and self.last else self.sensor.exposed(luma)
            self.last = luma
        rows = [luma[place * 320 : place * 320 + 320] for place in range(0, 240, 5)]
        thumb = bytes(sum(row[column : column + 5]) // 5 for row in rows for column in range(0, 320, 5))
        if self.flicker is not None:
            patch = bytes([self.flicker.randrange(256)]) * 2
            thumb = patch + thumb[2:]
        figures = (statistics.fmean(thumb), statistics.pstdev(thumb))
        return Seen(Picture(*figures, thumb, digest(luma), grain_of(luma, 320)), b"picture", "image/jpeg")


def a_rail(**more: Any) -> Rail:
    time = Time()
    line = LineDevice(RIG["rail"], lambda: time.now)
    return Rail(time, line, Scene(None, line, lambda: time.now), **more)


MOVE = {"tool": "rail_move_x", "arguments": {}, "vary": "steps", "by": 500, "relative": True}
SIGHT = {"unit": "x", "move": MOVE, "read": None, "view": {"tool": "capture_image", "arguments": {}}}


def test_the_camera_sees_the_rail_move_and_come_back_although_it_swept_before(tmp_path: Path) -> None:
    rail = a_rail()
    one = by_view(bench(rail, VIEW, tmp_path), SIGHT, "/trials/0")
    assert codes(one) == [], one
    assert one.moved is not None and one.returned is not None and one.moved > 2 * one.returned
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *("x-after.jpg", "x-back.jpg", "x-before.jpg", "x-still.jpg")
    ]


def test_pictures_that_are_compared_are_apart_however_fast_they_come(tmp_path: Path) -> None:
    rail = a_rail(exposure=0.0)
    by_view(bench(rail, VIEW, tmp_path), SIGHT, "/trials/0")
    by_frame(bench(rail, FRAME, tmp_path), CAMERA)
    assert len(rail.looks) >= 10
    assert min(later - earlier for earlier, later in pairwise(rail.looks[:-2])) >= 0.25
    assert rail.looks[-1] - rail.looks[-2] >= 0.25


def test_a_jammed_rail_says_ok_and_is_not_seen_to_move(tmp_path: Path) -> None:
    rail = a_rail()
    rail.line.fault = "jammed"
    one = by_view(bench(rail, VIEW, tmp_path), SIGHT, "/trials/1")
    assert codes(one) == ["STEP-NOT-SEEN"], one
    assert one.found[0].summary.startswith("x did not move in the camera's view: the picture differs by ")
    assert one.found[0].detail == "rail_move_x answered that all is well" and one.again
    assert "has power" in (one.found[0].hint or "")


def test_a_rail_whose_line_is_closed_between_calls_moves_by_itself_and_the_finding_says_so(tmp_path: Path) -> None:
    rail = a_rail()

    def closing(tool: str, arguments: Mapping[str, Any]) -> ToolAnswer:
        answer = Rail.call(rail, tool, arguments)
        rail.line.closed()
        return answer

    rail.call = closing  # type: ignore[method-assign]
    one = by_view(bench(rail, VIEW, tmp_path), SIGHT, "/trials/0")
    assert codes(one) == ["STEP-NOT-SEEN"], one
    assert "the picture changes by itself" in (one.found[0].hint or "")


def test_a_rail_that_does_not_come_back_fails(tmp_path: Path) -> None:
    rail = a_rail()

    def once(tool: str, arguments: Mapping[str, Any]) -> ToolAnswer:
        answer = Rail.call(rail, tool, arguments)
        rail.line.fault = "jammed"
        return answer

    rail.call = once  # type: ignore[method-assign]
    rail.line.opened()
    assert codes(by_view(bench(rail, VIEW, tmp_path), SIGHT, "/trials/0")) != []


@pytest.mark.parametrize("seed", range(3))
def test_what_flickers_in_the_picture_is_no_movement(tmp_path: Path, seed: int) -> None:
    rail = a_rail(flicker=random.Random(seed))
    assert codes(by_view(bench(rail, VIEW, tmp_path), SIGHT, "/trials/0")) == []
    rail.line.fault = "jammed"
    one = by_view(bench(rail, VIEW, tmp_path), SIGHT, "/trials/0")
    assert codes(one) and set(codes(one)) <= {"STEP-NOT-SEEN", "STEP-NOT-BACK"}


def test_a_refused_movement_is_not_undone(tmp_path: Path) -> None:
    rail = a_rail()
    rail.line.fault = "hot"
    one = by_view(bench(rail, VIEW, tmp_path), SIGHT, "/trials/0")
    assert codes(one) == ["STEP-CALL-FAILED"]
    assert len(rail.line.lines) == 1


def test_a_dark_camera_proves_nothing(tmp_path: Path) -> None:
    rail = a_rail(dark=True)
    assert codes(by_view(bench(rail, VIEW, tmp_path), SIGHT, "/trials/0")) == ["STEP-PICTURE-EMPTY"]
    assert rail.line.lines == []
    camera = {"device": "usb-045e-0772", "tool": "capture_image", "arguments": {}}
    one = by_frame(bench(rail, Proof("frame", 0, "", 2.0), tmp_path), camera)
    assert codes(one) == ["STEP-PICTURE-EMPTY", "STEP-PICTURE-EMPTY"]


CAMERA = {"device": "usb-045e-0772", "tool": "capture_image", "arguments": {}}
FRAME = Proof("frame", 0, "", 2.0)


def test_a_camera_that_shows_something_is_enough_and_one_that_cannot_be_told_is_a_warning(tmp_path: Path) -> None:
    rail = a_rail()
    frame = bench(rail, FRAME, tmp_path)
    assert codes(by_frame(frame, CAMERA)) == []
    rail.line.opened()
    rail.scene = Scene(None, rail.line, lambda: 7.0)
    one = by_frame(frame, CAMERA)
    assert codes(one) == ["STEP-PICTURE-REPEATED"] and one.found[0].severity == "warning"


def test_a_healthy_camera_before_a_still_scene_passes_time_after_time(tmp_path: Path) -> None:
    rail = a_rail(sensor=Sensor())
    rail.line.opened()
    rail.scene = Scene(None, rail.line, lambda: 7.0)
    for _ in range(20):
        assert codes(by_frame(bench(rail, FRAME, tmp_path), CAMERA)) == []


def test_a_frozen_camera_fails_after_some_seconds_of_the_same_noise(tmp_path: Path) -> None:
    rail = a_rail(sensor=Sensor(), frozen=True)
    before = rail.time.now
    one = by_frame(bench(rail, FRAME, tmp_path), CAMERA)
    assert codes(one) == ["STEP-PICTURE-FROZEN"] and one.found[0].severity == "error"
    assert 5 <= rail.time.now - before < 15


def test_a_movement_before_a_frozen_camera_blames_the_camera_and_not_the_rail(tmp_path: Path) -> None:
    rail = a_rail(sensor=Sensor(), frozen=True)
    one = by_view(bench(rail, VIEW, tmp_path), SIGHT, "/trials/0")
    assert codes(one)[0] == "STEP-PICTURE-FROZEN" and "STEP-NOT-SEEN" not in codes(one)
