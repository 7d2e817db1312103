"""The reference rig on a real kernel: arm, rail and camera, each behind its own driver, moved through one endpoint.

What runs on the boards is the simulation that `octoform simulate` runs, so the motors themselves report a movement,
and once more by the camera, whose pictures come through the endpoint as everything else does.
"""

import re
from collections.abc import Callable

import pytest
from vm.contents import Picture, difference
from vm.rig import ARM, CAMERA, RAIL, RigBench
from vm.user import McpClient, Octoform

pytestmark = pytest.mark.vm
See = Callable[[str, str], None]
UNITS = {"shoulder_pan": 1, "shoulder_lift": 2, "elbow_flex": 3, "wrist_flex": 4, "wrist_roll": 5, "gripper": 6}
STEPS = ("arm", "rail", "perceive")
WITHOUT_CLOCK = (0.12, 0.84)
"""The rows of a picture in which only what moves makes a change."""
AWAY = 300
"""Raw counts that a joint is moved."""


def seen_to_move(before: Picture, again: Picture, after: Picture) -> str:
    """What changed in the picture while something moved, against what changes while all stands still."""
    still, moved = difference(before, again, WITHOUT_CLOCK), difference(again, after, WITHOUT_CLOCK)
    assert moved > 0.005, f"only {moved:.2%} of the picture changed"
    assert moved > 3 * still, f"{moved:.2%} of the picture changed, and {still:.2%} while nothing moved"
    return f"{moved:.1%} of the picture changed, {still:.1%} at rest"


def absent(device: str, said: str) -> str:
    """The answer, which states plainly that the device is gone: found by the call itself, or known before it."""
    assert re.search(rf"{device} is not attached|^device absent: ", said), said
    return said


def test_the_rig_is_known_by_its_evidence(rigged: Octoform, see: See) -> None:
    named = {device["id"]: device for device in rigged.artifact("identify")["devices"]}
    found = {device: named[device]["class"] for device in (ARM, RAIL, CAMERA)}
    assert found == {ARM: "register_bus", RAIL: "line_protocol", CAMERA: "camera"}
    tools = {tool["name"]: tool["devices"] for tool in rigged.artifact("interface")["tools"]}
    for name in (
        "arm_status",
        "arm_read_joint",
        "arm_move_joint",
        "arm_move_joints",
        "arm_home",
        "arm_rest",
        "arm_stop",
    ):
        assert tools[name] == [ARM], name
    for name in ("rail_move_x", "rail_move_y", "rail_home", "rail_position", "rail_stop"):
        assert tools[name] == [RAIL], name
    see("rig", f"arm by its strings, rail by one sentence; {len(tools)} tools")


def test_each_step_proved_that_it_moves(rigged: Octoform, rig_bench: RigBench, see: See) -> None:
    for step in STEPS:
        found = rigged.artifact(f"steps/{step}")
        assert (found["step"], found["skipped"]) == (step, []), found
    goals = {name: rig_bench.servos.servos[number].goals for name, number in UNITS.items()}
    assert [name for name, asked in goals.items() if asked.highest - asked.lowest < AWAY / 2] == []
    assert {line.split()[0] for line in rig_bench.line.lines} >= {"MOVE_X", "MOVE_Y"}
    see("steps", f"{', '.join(STEPS)}: proved on this kernel")


def test_the_second_plan_has_nothing_to_do(rigged: Octoform) -> None:
    assert rigged.status("plan", "-detailed-exitcode") == 0, rigged.run("plan")


def test_a_status_is_what_the_motors_have(client: McpClient, rig_bench: RigBench, see: See) -> None:
    found = client.call("arm_status", device=ARM)
    by_name = {unit["joint"]: unit for unit in found["joints"]}
    assert set(by_name) == set(UNITS)
    for name, number in UNITS.items():
        servo, unit = rig_bench.servos.servos[number], by_name[name]
        assert abs(unit["position"] - servo.position) <= 8, (unit, servo.position)
        assert unit["temperature"] == pytest.approx(servo.temperature, abs=3)
        assert unit["voltage"] == pytest.approx(servo.value("voltage") / 10, abs=0.5)
    see("arm, status", f"six joints, {by_name['gripper']['voltage']} V, as the motors have it")


def test_a_joint_moves_and_the_camera_sees_it(client: McpClient, rig_bench: RigBench, see: See) -> None:
    client.call("rail_home", device=RAIL)  # else it goes to and fro by itself, as it does until its port is opened
    servo, still = rig_bench.servos.servos[UNITS["elbow_flex"]], rest_of(rig_bench)
    begun = servo.position
    goal = round(begun) + (AWAY if begun + AWAY < servo.value("highest") else -AWAY)
    before, again = client.picture(CAMERA), client.picture(CAMERA)
    found = client.call("arm_move_joint", device=ARM, joint="elbow_flex", position=goal)
    after = client.picture(CAMERA)
    assert found["moved"] is True
    assert abs(servo.position - goal) <= 10, (servo.position, goal)
    assert abs(found["position"] - servo.position) <= 10, found
    assert all(abs(was - now) <= 20 for was, now in zip(still, rest_of(rig_bench), strict=True)), "another joint moved"
    see("arm, one joint", f"elbow_flex from {begun:.0f} to {servo.position:.0f}; {seen_to_move(before, again, after)}")


def rest_of(rig_bench: RigBench) -> list[float]:
    """Where all joints but the elbow are."""
    return [place for number, place in rig_bench.servos.positions().items() if number != UNITS["elbow_flex"]]


def test_the_rail_moves_and_the_camera_sees_it(client: McpClient, rig_bench: RigBench, see: See) -> None:
    client.call("rail_home", device=RAIL)
    assert rig_bench.line.position == {"X": 0, "Y": 0}
    before, again = client.picture(CAMERA), client.picture(CAMERA)
    client.call("rail_move_x", device=RAIL, steps=900)
    client.call("rail_move_y", device=RAIL, steps=-150)
    after = client.picture(CAMERA)
    assert rig_bench.line.position == {"X": 900, "Y": -150}
    found = client.call("rail_position", device=RAIL)
    assert (found["x"], found["y"]) == (900, -150), found
    see("rail", f"at X 900, Y -150; {seen_to_move(before, again, after)}")


def test_what_is_outside_of_the_limits_never_reaches_the_motors(client: McpClient, rig_bench: RigBench) -> None:
    lines, goals = len(rig_bench.line.lines), rig_bench.servos.servos[UNITS["gripper"]].goals.highest
    client.refused("rail_move_x", device=RAIL, steps=2001)
    client.refused("arm_move_joint", device=ARM, joint="gripper", position=4096)
    assert len(rig_bench.line.lines) == lines
    assert rig_bench.servos.servos[UNITS["gripper"]].goals.highest == goals


def test_a_pulled_arm_is_told_of_and_found_in_another_port(
    client: McpClient, rigged: Octoform, rig_bench: RigBench, see: See
) -> None:
    before = rigged.attempts()
    servo = rig_bench.servos.servos[UNITS["wrist_flex"]]
    goal = round(servo.position) + (AWAY if servo.position + AWAY < servo.value("highest") else -AWAY)
    with rig_bench.pulled("arm", "/dev/ttyACM0", "/dev/ttyACM2", 9):
        found = absent(ARM, client.refused("arm_move_joint", device=ARM, joint="wrist_flex", position=goal))
        assert client.picture(CAMERA).width == 320, "the camera went with the arm"
    client.call("arm_move_joint", device=ARM, joint="wrist_flex", position=goal)
    assert abs(servo.position - goal) <= 10, (servo.position, goal)
    assert rigged.status("plan", "-detailed-exitcode") == 0, rigged.run("plan")
    assert rigged.attempts() == before, "an agent ran"
    see("arm, pulled", f"{found[:80]!r}; moves again at ttyACM2")


def test_rail_and_camera_come_back_under_other_names(
    client: McpClient, rigged: Octoform, rig_bench: RigBench, see: See
) -> None:
    before = rigged.attempts()
    # The rail comes back under the name that the arm had.
    with rig_bench.pulled("rail", "/dev/ttyACM1", "/dev/ttyACM0", 10):
        absent(RAIL, client.refused("rail_move_x", device=RAIL, steps=10))
    with rig_bench.pulled("camera", "/dev/video0", "/dev/video2", 11):
        absent(CAMERA, client.refused("capture_image", device=CAMERA))
    client.call("rail_home", device=RAIL)
    assert rig_bench.line.position == {"X": 0, "Y": 0}
    first, again = client.picture(CAMERA), client.picture(CAMERA)
    client.call("rail_move_x", device=RAIL, steps=-900)
    assert rig_bench.line.position == {"X": -900, "Y": 0}
    moved = seen_to_move(first, again, client.picture(CAMERA))
    assert rigged.status("plan", "-detailed-exitcode") == 0, rigged.run("plan")
    assert rigged.attempts() == before, "an agent ran"
    see("rig, plugged again", f"rail at ttyACM0, camera at video2: {moved}; no changes, no agent ran")


def test_no_packet_was_corrupted(rig_bench: RigBench, see: See) -> None:
    bus = rig_bench.servos
    assert bus.received > 100, "hardly anything was said"
    assert (bus.broken, bus.noise) == (0, 0)
    see("servo bus", f"{bus.received} packets at {bus.baud} baud, none corrupted")


def test_at_another_rate_the_servos_hear_noise(rig_bench: RigBench, see: See) -> None:
    bus = rig_bench.servos
    assert pinged(rig_bench, 1_000_000) == "ffff010200fc"
    before = bus.noise
    assert pinged(rig_bench, 115_200) == ""
    assert (bus.noise - before, bus.broken) == (6, 0)
    see("servo bus", "at 115200 baud no answer")


def pinged(rig_bench: RigBench, baud: int) -> str:
    """What the first servo answers to a ping at this rate, in hexadecimal digits."""
    program = (
        "import os, select, termios, tty\n"
        "port = os.open(os.popen('ls /dev/serial/by-id/*SO-ARM101*').read().strip(), os.O_RDWR | os.O_NOCTTY)\n"
        "tty.setraw(port)\n"
        "settings = termios.tcgetattr(port)\n"
        f"settings[4] = settings[5] = termios.B{baud}\n"
        "termios.tcsetattr(port, termios.TCSAFLUSH, settings)\n"
        "os.write(port, bytes.fromhex('ffff010201fb'))\n"
        "while select.select([port], [], [], 2)[0]:\n"
        "    print(os.read(port, 64).hex(), end='')\n"
    )
    return rig_bench.guest.run("python3 -", stdin=program.encode())
