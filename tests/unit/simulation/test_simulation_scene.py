"""The camera's picture: arm, rail and clock are to be seen in it, and it is what a video library expects."""

from operator import sub
from pathlib import Path

import pytest

from octoform.simulation.rail_firmware import LineDevice
from octoform.simulation.rig import load
from octoform.simulation.scene import Camera, Scene
from octoform.simulation.servos import ServoBus

GIVEN = load("reference")["devices"]
WIDE, HIGH = 160, 120


class Bench:
    """Arm and rail before a camera whose clock stands still."""

    def __init__(self) -> None:
        self.now = 0.0
        self.arm = ServoBus(GIVEN["arm"], lambda: 0.0)
        self.rail = LineDevice({**GIVEN["rail"], "speedup": float("inf")}, lambda: 0.0)
        self.scene = Scene(self.arm, self.rail, lambda: self.now)

    def luma(self) -> bytes:
        return self.scene.frame(WIDE, HIGH)[0]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def changed(before: bytes, after: bytes) -> float:
    """The part of the picture that is another one."""
    return sum(1 for one, two in zip(before, after, strict=True) if abs(one - two) > 12) / len(before)


def test_a_frame_has_three_planes_and_stands_still_when_nothing_moves(bench: Bench) -> None:
    luma, blue, red = bench.scene.frame(WIDE, HIGH)
    assert (len(luma), len(blue), len(red)) == (WIDE * HIGH, WIDE * HIGH // 4, WIDE * HIGH // 4)
    assert len(set(luma)) > 20 and luma == bench.luma()


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5, 6])
def test_each_joint_is_to_be_seen(bench: Bench, number: int) -> None:
    for servo in bench.arm.servos.values():
        servo.position = 2048
    before = bench.luma()
    bench.arm.servos[number].position = 2548
    assert changed(before, bench.luma()) > 0.001


def test_the_clock_is_to_be_seen(bench: Bench) -> None:
    before = bench.luma()
    bench.now += 0.2
    assert 0 < changed(before, bench.luma()) < 0.02


@pytest.mark.parametrize("line", [b"MOVE_X 400\n", b"MOVE_Y -400\n"])
def test_the_whole_picture_shifts_with_the_rail_and_comes_back(bench: Bench, line: bytes) -> None:
    bench.rail.opened()
    before = bench.luma()
    bench.rail.feed(line)
    assert changed(before, bench.luma()) > 0.2
    bench.rail.feed(b"HOME\n")
    assert bench.luma() == before


def test_the_picture_goes_to_the_side_that_the_camera_leaves(bench: Bench) -> None:
    bench.rail.opened()
    before = bench.luma()
    bench.rail.feed(b"MOVE_X 800\n")
    shift = 800 * WIDE // 12800
    row = slice(60 * WIDE, 61 * WIDE)
    assert before[row][shift:] == bench.luma()[row][:-shift]


def test_no_place_of_the_rail_has_no_picture(bench: Bench) -> None:
    bench.rail.opened()
    for line in [b"MOVE_X 2000\nMOVE_Y 2000\n"] * 5 + [b"HOME\n"] + [b"MOVE_X -2000\nMOVE_Y -2000\n"] * 5:
        bench.rail.feed(line)
        assert len(bench.luma()) == WIDE * HIGH
    assert bench.rail.position == {"X": -10000, "Y": -10000}


def test_without_arm_and_rail_there_is_still_a_bench() -> None:
    assert len(set(Scene(None, None).frame(WIDE, HIGH)[0])) > 20


def test_the_file_is_a_moving_picture(bench: Bench, tmp_path: Path) -> None:
    camera = Camera(bench.scene, tmp_path / "video0", (WIDE, HIGH))
    camera.write()
    header, _, frames = (tmp_path / "video0").read_bytes().partition(b"\n")
    assert header == b"YUV4MPEG2 W160 H120 F30:1 Ip A1:1 C420jpeg"
    size = len(b"FRAME\n") + WIDE * HIGH * 3 // 2
    seen = [frames[start + 6 : start + size] for start in range(0, len(frames), size)]
    assert len(seen) == 16 == len(set(seen)), "each frame has noise of its own"
    luma, blue, red = bench.scene.frame(WIDE, HIGH)
    for frame in seen:
        assert frame[WIDE * HIGH :] == blue + red
        assert min(map(sub, frame, luma)) >= 0 and max(map(sub, frame, luma)) <= 12
    assert [path.name for path in tmp_path.iterdir()] == ["video0"]


def test_a_camera_that_sees_nothing(bench: Bench, tmp_path: Path) -> None:
    camera = Camera(bench.scene, tmp_path / "video0", (WIDE, HIGH), frames=1)
    for fault, level in (("black", 16), ("uniform", 120)):
        camera.fault = fault
        camera.write()
        assert (tmp_path / "video0").read_bytes()[60:10060] == bytes([level]) * 10000
    camera.fault = "frozen"
    camera.write()
    assert camera.written == 2


def test_the_file_follows_what_moves_and_goes_with_the_camera(bench: Bench, tmp_path: Path) -> None:
    camera = Camera(bench.scene, tmp_path / "video0", (WIDE, HIGH))
    camera.start()
    before = (tmp_path / "video0").read_bytes()
    bench.arm.servos[2].position = 2048
    while (tmp_path / "video0").read_bytes() == before:
        pass
    camera.stop()
    assert list(tmp_path.iterdir()) == []
