"""Nothing moves on unsupervised: calls that are given up, units that fail on their way. No real time passes."""

import os
from pathlib import Path
from typing import Any

import pytest
from unit.runtime.servo_bench import Bench

from octoform.runtime import DeviceFault, registers

ELBOW, WRIST = "elbow_flex", "wrist_flex"


class GivenUp(BaseException):
    """What the launcher raises in the code of a call that was cancelled, that took too long or that has to end."""


@pytest.fixture
def bench() -> Bench:
    return Bench()


def gives_up(bench: Bench, *, broken: int = 0) -> None:
    bench.broken = broken
    raise GivenUp


def stands(bench: Bench, name: str) -> int:
    """Where the joint is, after time in which it would have come to its goal."""
    joint, bench.now = bench.joint(name), bench.now + 30
    assert joint.speed == 0
    return int(joint.position)


@pytest.mark.parametrize("again", [False, True])
def test_a_call_that_is_given_up_leaves_its_units_holding_where_they_were(bench: Bench, again: bool) -> None:
    bench.signals.append((1.0, lambda: gives_up(bench, broken=again)))
    if again:  # in the pause before the line that broke just now is opened anew
        bench.signals.append((1.05, lambda: gives_up(bench)))
    with pytest.raises(GivenUp):
        bench.units().move_many({ELBOW: 1100, WRIST: 1000}, 400)
    assert bench.signals == []
    assert 2600 < stands(bench, ELBOW) < 3080 and 2100 < stands(bench, WRIST) < 2600


def test_a_unit_that_cannot_be_read_on_its_way_is_held_once_it_answers(bench: Bench) -> None:
    def heard(fault: Any) -> None:
        bench.joint(ELBOW).fault = fault

    bench.signals += [(1.0, lambda: heard("mute")), (1.2, lambda: heard(None))]
    with pytest.raises(DeviceFault, match="no sound reply"):
        bench.units().move(ELBOW, 1100, 400)
    assert 2500 < stands(bench, ELBOW) < 3080


def test_what_stuck_does_not_set_off_when_it_comes_free(bench: Bench) -> None:
    bench.joint(ELBOW).fault = "stuck"
    with pytest.raises(DeviceFault, match="did not move"):
        bench.units().move(ELBOW, 1100, 400)
    assert bench.joint(ELBOW).value("goal") == 3080


@pytest.mark.parametrize("place", [4120, 60000])
def test_a_unit_outside_of_all_it_can_be_told_is_not_sent_off_by_a_stop(bench: Bench, place: int) -> None:
    bench.joint(ELBOW).position = place
    with pytest.raises(DeviceFault, match=f"elbow_flex is at {place}, where it cannot be set to hold"):
        bench.units().stop()
    assert [number for number, _, _ in bench.writes] == [1, 2, 4, 5, 6]


def test_an_arm_that_is_gone_on_its_way_is_not_said_to_stand(bench: Bench) -> None:
    bench.signals.append((1.0, lambda: setattr(bench, "broken", 99)))
    with pytest.raises(DeviceFault, match="not known: whether elbow_flex goes on to 1100"):
        bench.units().move(ELBOW, 1100, 400)


@pytest.mark.parametrize("kind", ["pipe", "folder", "depths", "device"])
def test_no_calibration_file_keeps_a_call_waiting_or_breaks_it(bench: Bench, tmp_path: Path, kind: str) -> None:
    place = tmp_path / "arm.json"
    if kind == "pipe":
        os.mkfifo(place)
    elif kind == "folder":
        place.mkdir()
    elif kind == "depths":
        place.write_text("[" * 60000)
    else:
        place.symlink_to("/dev/zero")
    found = registers.find([str(tmp_path / "*.json")], bench.map.units)
    assert found.ranges == {} and "no calibration file that can be used" in found.note
