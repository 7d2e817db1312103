"""The camera rail's firmware in virtual time: its grammar, its limits, the sweep of the unattended rail, its faults."""

from typing import Any

import pytest

from octoform.simulation.rail_firmware import LineDevice, Unplugged
from octoform.simulation.rig import load

RAIL: dict[str, Any] = load("reference")["devices"]["rail"]
STEP = 2 * RAIL["half_period"]


class Bench:
    """A rail with a hand on its clock; the port is open unless ``alone``."""

    def __init__(self, *, alone: bool = False, **changes: Any) -> None:
        self.now = 50.0
        self.rail = LineDevice({**RAIL, **changes}, lambda: self.now)
        if not alone:
            self.rail.opened()

    def say(self, line: str) -> str:
        """What is answered at once."""
        return self.rail.feed(f"{line}\n".encode()).decode()

    def do(self, line: str) -> str:
        """What is answered in the end."""
        answer = self.say(line)
        while self.rail.due is not None:
            self.now = self.rail.due
            answer += self.rail.feed(b"").decode()
        return answer


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_movement_takes_its_time_and_is_answered_when_it_is_over(bench: Bench) -> None:
    assert bench.say("MOVE_X -1000") == ""
    bench.now += 500 * STEP + 1e-9
    assert bench.rail.feed(b"") == b"" and bench.rail.position == {"X": -500, "Y": 0}
    bench.now += 500 * STEP
    assert bench.rail.feed(b"") == b"OK\n" and bench.rail.position == {"X": -1000, "Y": 0}
    assert bench.rail.due is None and bench.rail.lines == ["MOVE_X -1000"]


def test_lines_that_come_meanwhile_wait(bench: Bench) -> None:
    bench.rail.feed(b"MOVE_X 100\nMOVE_Y 50\nNO")
    bench.now += 100 * STEP
    assert bench.rail.feed(b"NSENSE\n") == b"OK\n"
    assert bench.rail.lines == ["MOVE_X 100", "MOVE_Y 50"]
    bench.now += 50 * STEP + 1e-9
    assert bench.rail.feed(b"") == b"OK\nERR unknown command\n"


def test_home_takes_both_axes_back_at_a_time(bench: Bench) -> None:
    bench.do("MOVE_X 2000")
    bench.do("MOVE_Y -500")
    assert bench.say("HOME") == ""
    bench.now += 600 * STEP + 1e-9
    assert bench.rail.position == {"X": 1400, "Y": 0}
    bench.now += 1400 * STEP
    assert bench.rail.feed(b"") == b"OK\n" and bench.rail.position == {"X": 0, "Y": 0}


@pytest.mark.parametrize("line", ["MOVE_Z 1", "MOVE_X", "MOVE_X 1 2", "move_x 1", "STOP", "HOME 1"])
def test_what_it_does_not_know_is_an_error(bench: Bench, line: str) -> None:
    assert bench.say(line) == "ERR unknown command\n" and bench.rail.due is None


@pytest.mark.parametrize("steps", ["1.5", "ten", "--1", "1e3"])
def test_what_is_no_number_is_an_error(bench: Bench, steps: str) -> None:
    assert bench.say(f"MOVE_X {steps}") == "ERR not a number of steps\n"


def test_limits_of_a_movement_and_of_the_whole(bench: Bench) -> None:
    assert bench.say("MOVE_X 2001") == "ERR steps out of range, at most 2000\n"
    for _ in range(5):
        assert bench.do("MOVE_X -2000") == "OK\n"
    assert bench.say("MOVE_X -1") == "ERR position out of range, at most 10000\n"
    assert bench.do("MOVE_X 1") == "OK\n" and bench.do("MOVE_Y 2000") == "OK\n"
    assert (bench.rail.longest, bench.rail.farthest) == (2000, 10000)


def test_a_line_without_an_end_is_dropped(bench: Bench) -> None:
    assert bench.rail.feed(b"x" * 100) == b"ERR line too long\n"
    assert bench.do("\r\nMOVE_X 1\r") == "OK\n"


def test_alone_it_sweeps_and_yields_to_a_host() -> None:
    bench = Bench(alone=True)
    seen = []
    for _ in range(400):
        bench.now += 0.05
        seen.append(bench.rail.position)
    assert max(place["X"] for place in seen) == pytest.approx(1500, abs=40)
    assert min(place["Y"] for place in seen) == pytest.approx(-500, abs=40)
    bench.rail.opened()
    there = bench.rail.position
    bench.now += 5
    assert bench.rail.position == there != {"X": 0, "Y": 0}
    assert bench.do("HOME") == "OK\n"  # it has counted its own steps
    assert bench.rail.position == {"X": 0, "Y": 0}


def test_when_the_host_goes_a_movement_ends_and_the_sweep_goes_on_from_there(bench: Bench) -> None:
    bench.do("MOVE_Y 2000")
    bench.say("MOVE_X 100")
    bench.rail.closed()
    bench.now += 100 * STEP + 1e-9
    assert bench.rail.position == {"X": 100, "Y": 2000} and bench.rail.due is not None
    bench.now += 10 * STEP
    assert bench.rail.position == {"X": 110, "Y": 1990}
    bench.rail.opened()
    assert bench.rail.feed(b"") == b""  # the answer was lost with the host
    assert bench.do("HOME") == "OK\n" and bench.rail.position == {"X": 0, "Y": 0}


def test_a_host_that_comes_back_meanwhile_waits_and_gets_no_answer_of_another(bench: Bench) -> None:
    bench.say("MOVE_X 100")
    bench.now += 50 * STEP
    bench.rail.closed()
    bench.rail.opened()
    assert bench.say("MOVE_X 10") == "" and bench.rail.lines == ["MOVE_X 100"]
    bench.now += 50 * STEP + 1e-9
    assert bench.rail.feed(b"") == b"" and bench.rail.lines[1:] == ["MOVE_X 10"]
    bench.now += 10 * STEP + 1e-9
    assert bench.rail.feed(b"") == b"OK\n" and bench.rail.position["X"] == 110


@pytest.mark.parametrize(
    ("fault", "answer"), [("mute", ""), ("odd", "boot v3 \x1b[31m\n"), ("hot", "ERR motor driver is hot\n")]
)
def test_faults_in_which_it_does_not_move(bench: Bench, fault: str, answer: str) -> None:
    bench.rail.fault = fault
    assert bench.do("MOVE_X 100") == answer
    assert bench.rail.position == {"X": 0, "Y": 0} == bench.rail.counted


def test_jammed_it_acknowledges_and_counts_and_does_not_move(bench: Bench) -> None:
    bench.rail.fault = "jammed"
    assert bench.do("MOVE_X 100") == "OK\n"
    assert bench.rail.position == {"X": 0, "Y": 0} and bench.rail.counted == {"X": 100, "Y": 0}


def test_late_it_moves_and_answers_much_later(bench: Bench) -> None:
    bench.rail.fault = "late"
    bench.say("MOVE_X 100")
    bench.now += 1
    assert bench.rail.position["X"] == 100 and bench.rail.feed(b"") == b""
    bench.now += RAIL["late"]
    assert bench.rail.feed(b"") == b"OK\n"


def test_gone_the_next_line_unplugs_it(bench: Bench) -> None:
    bench.rail.fault = "gone"
    with pytest.raises(Unplugged):
        bench.say("MOVE_X 100")
    assert bench.rail.lines == ["MOVE_X 100"]


def test_it_need_take_no_time() -> None:
    bench = Bench(speedup=float("inf"))
    assert bench.say("MOVE_X 2000") == "OK\n" and bench.rail.position["X"] == 2000
