"""The servo bus in virtual time: what a host sees on the wire, and what the hardware did."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.simulation.rig import load
from octoform.simulation.servo import (
    ACTION,
    ANGLE,
    EVERYBODY,
    LATER,
    OVERHEAT,
    PING,
    READ,
    SYNC_READ,
    SYNC_WRITE,
    WRITE,
    packet,
    planned,
    resting,
)
from octoform.simulation.servos import ServoBus

ARM: dict[str, Any] = load("reference")["devices"]["arm"]
FIELDS = ARM["registers"]["fields"]
CENTRE = 2048


class Bench:
    """A bus with a hand on its clock. ``changes`` are other values in the description."""

    def __init__(self, **changes: Any) -> None:
        self.now = 1000.0
        self.bus = ServoBus({**ARM, **changes}, lambda: self.now)

    def send(self, number: int, instruction: int, *parameters: int) -> bytes:
        return self.bus.feed(packet(number, instruction, bytes(parameters)))

    def read(self, number: int, name: str) -> int:
        field = FIELDS[name]
        answer = self.send(number, READ, field["address"], field["bytes"])
        assert answer == packet(number, answer[4], answer[5:-1])
        return int.from_bytes(answer[5:-1], "little")

    def write(self, number: int, name: str, value: int) -> bytes:
        field = FIELDS[name]
        return self.send(number, WRITE, field["address"], *value.to_bytes(field["bytes"], "little"))

    def move(self, number: int, goal: int, *, speed: int = 1000, acceleration: int = 20) -> bytes:
        for name, value in {"torque": 1, "acceleration": acceleration, "speed": speed}.items():
            assert self.write(number, name, value)[4] == 0
        return self.write(number, "goal", goal)

    def wait(self, seconds: float, step: float = 0.05) -> list[float]:
        """Let time pass; the positions of servo 1 on the way."""
        found = []
        for _ in range(round(seconds / step)):
            self.now += step
            found.append(self.bus.servos[1].position)
        return found


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_ping_is_answered_and_a_broadcast_never(bench: Bench) -> None:
    assert bench.send(1, PING) == bytes.fromhex("ffff010200fc")
    assert bench.send(EVERYBODY, PING) == b""
    assert bench.send(9, PING) == b""
    assert bench.send(EVERYBODY, WRITE, FIELDS["torque"]["address"], 1) == b""
    assert all(servo.torque for servo in bench.bus.servos.values())
    assert (bench.bus.received, bench.bus.broken) == (4, 0)


def test_a_wrong_checksum_is_ignored_and_counted(bench: Bench) -> None:
    wrong = packet(1, PING)[:-1] + b"\x00"
    assert bench.bus.feed(wrong) == b""
    assert (bench.bus.received, bench.bus.corrupt) == (0, 1)
    assert bench.send(1, PING) and bench.bus.corrupt == 1


def test_a_packet_may_come_in_parts_but_not_for_ever(bench: Bench) -> None:
    whole = packet(1, PING)
    assert [bench.bus.feed(whole[at : at + 1]) for at in range(len(whole))][-1]
    bench.bus.feed(whole[:3])
    bench.now += 1
    assert bench.bus.feed(whole) and bench.bus.corrupt == 1


def test_two_hosts_at_once_lose_both_packets_and_are_counted(bench: Bench) -> None:
    read = packet(1, READ, bytes([56, 2]))
    assert bench.bus.feed(read + packet(2, PING)) == b""
    assert bench.bus.overlapping == 1
    bench.bus.feed(read[:4] + packet(2, PING) + read[4:])
    assert bench.bus.corrupt > 0


def test_a_question_that_was_asked_again_before_anybody_could_read_it_is_answered_once(bench: Bench) -> None:
    read = packet(1, READ, bytes([56, 2]))
    assert bench.bus.feed(read + read) == bench.bus.feed(read) != b""
    assert bench.bus.broken == 0


def test_a_goal_is_reached_at_the_speed_that_was_asked_for(bench: Bench) -> None:
    bench.move(1, 1048, speed=500, acceleration=50)
    way = bench.wait(3.0)
    steps = [abs(after - before) / 0.05 for before, after in pairwise(way)]
    assert way[-1] == bench.read(1, "position") == 1048
    assert max(steps) == pytest.approx(500, rel=0.01)
    assert steps[0] < 400 and way == sorted(way, reverse=True)  # it speeds up, and never turns back


def test_while_it_moves_it_says_so(bench: Bench) -> None:
    bench.move(1, 1048, speed=500)
    bench.wait(1.0)
    assert bench.read(1, "moving") == 1 and bench.read(1, "present_speed") == 500 | 1 << 15
    bench.wait(3.0)
    assert bench.read(1, "moving") == 0 and bench.read(1, "present_speed") == 0


def test_without_torque_a_goal_is_acknowledged_and_ignored(bench: Bench) -> None:
    assert bench.write(1, "goal", 1500)[4] == 0
    assert bench.read(1, "goal") == CENTRE
    bench.wait(3.0)
    assert bench.bus.servos[1].position == CENTRE
    bench.write(1, "torque", 1)  # holds where it is: the goal from before does not come back
    bench.wait(3.0)
    assert bench.bus.servos[1].position == CENTRE and bench.read(1, "goal") == CENTRE


def test_a_goal_outside_of_the_limits_is_clamped_and_the_answer_says_so(bench: Bench) -> None:
    lowest = bench.read(1, "lowest")
    assert bench.move(1, lowest - 100)[4] == ANGLE
    bench.wait(5.0)
    servo = bench.bus.servos[1]
    assert servo.position == lowest == bench.read(1, "goal")
    assert (servo.goals.lowest, servo.reached.lowest) == (lowest - 100, lowest)
    assert bench.move(1, CENTRE)[4] == 0


def test_without_torque_the_arm_drops_and_lies_on_its_stop_without_load(bench: Bench) -> None:
    bench.move(2, CENTRE)
    bench.wait(4.0)
    bench.write(2, "torque", 0)
    bench.wait(1.0)
    assert 900 < bench.bus.servos[2].position < CENTRE
    bench.wait(5.0)
    bench.write(2, "torque", 1)
    assert bench.bus.servos[2].position == 900 and bench.read(2, "load") == 0


def stretched(bench: Bench) -> None:
    """The upper arm level, the rest of the arm in line with it: the most that the shoulder ever holds."""
    bench.move(2, CENTRE + 1024)
    bench.move(3, CENTRE - 1024)
    bench.move(4, CENTRE)
    bench.wait(5.0)


def test_load_current_and_supply_follow_from_the_pose(bench: Bench) -> None:
    for number in (2, 3, 4):
        bench.move(number, CENTRE)
    bench.wait(5.0)
    upright = {name: bench.read(2, name) for name in ("load", "current", "voltage")}
    stretched(bench)
    level = {name: bench.read(2, name) & 0x3FF for name in ("load", "current", "voltage")}
    assert 250 < level["load"] < 400 and level["load"] > 2 * (upright["load"] & 0x3FF)
    assert level["current"] > (upright["current"] & 0x3FF) and level["voltage"] < upright["voltage"]


def test_the_joint_that_holds_the_arm_gets_hot_and_cools_again(bench: Bench) -> None:
    stretched(bench)
    bench.now += 1800
    bench.bus.advance()
    bench.now += 1800
    assert 60 <= bench.read(2, "temperature") < 70
    assert bench.read(1, "temperature") < 40
    bench.write(2, "torque", 0)
    bench.now += 1800
    assert bench.read(2, "temperature") < 30


def test_at_its_highest_temperature_a_motor_lets_go_and_says_so(bench: Bench) -> None:
    stretched(bench)
    bench.bus.servos[2].temperature = 71.0
    assert bench.send(2, PING)[4] == OVERHEAT
    assert bench.read(2, "torque") == 0
    bench.wait(5.0)
    assert bench.bus.servos[2].position == 900


def test_sync_write_reaches_only_the_first_servo_on_this_rig(bench: Bench) -> None:
    address = FIELDS["torque"]["address"]
    assert bench.send(EVERYBODY, SYNC_WRITE, address, 1, 1, 1, 2, 1) == b""
    assert [bench.bus.servos[number].torque for number in (1, 2)] == [True, False]
    all_of_them = Bench(sync_write="all")
    all_of_them.send(EVERYBODY, SYNC_WRITE, address, 1, 1, 1, 2, 1)
    assert all_of_them.bus.servos[2].torque


def test_sync_read_is_answered_by_each_in_turn(bench: Bench) -> None:
    field = FIELDS["position"]
    answers = bench.send(EVERYBODY, SYNC_READ, field["address"], 2, 3, 1)
    assert answers == packet(3, 0, (3080).to_bytes(2, "little")) + packet(1, 0, CENTRE.to_bytes(2, "little"))


def test_a_write_can_be_kept_for_later(bench: Bench) -> None:
    assert bench.send(1, LATER, FIELDS["torque"]["address"], 1)
    assert not bench.bus.servos[1].torque
    bench.send(EVERYBODY, ACTION)
    assert bench.bus.servos[1].torque


def test_what_is_written_below_the_lock_is_gone_after_a_power_cut(bench: Bench) -> None:
    bench.write(1, "lowest", 900)
    bench.bus.power_cycle()
    assert bench.read(1, "lowest") == 740
    bench.write(1, "lock", 0)
    bench.write(1, "lowest", 900)
    bench.bus.power_cycle()
    assert bench.read(1, "lowest") == 900 and bench.read(1, "lock") == 1


def test_ids_can_be_swapped_and_two_of_one_id_spoil_each_others_answers(bench: Bench) -> None:
    bench.bus.servos[4].position = 1111
    assert bench.write(4, "id", 5)[2] == 4
    answer = bench.send(5, READ, FIELDS["position"]["address"], 2)
    assert len(answer) == 8 and answer != packet(5, 0, answer[5:-1])
    assert bench.send(4, PING) == b""


def test_what_can_only_be_read_stays(bench: Bench) -> None:
    beyond = ARM["registers"]["read_only_from"] + 8
    assert bench.send(1, WRITE, beyond - 9, 0, *range(1, 10)) == packet(1, 0)
    assert bench.send(1, READ, beyond, 1) == packet(1, 0, b"\0")
    assert bench.read(1, "position") == CENTRE


@pytest.mark.parametrize(
    ("fault", "seen"),
    [
        ("mute", lambda answer: answer == b""),
        ("corrupt", lambda answer: len(answer) == 6 and answer != packet(1, 0)),
        ("half", lambda answer: packet(1, 0).startswith(answer) and 0 < len(answer) < 6),
    ],
)
def test_a_servo_that_talks_badly(bench: Bench, fault: str, seen: Callable[[bytes], bool]) -> None:
    bench.bus.servos[1].fault = fault
    assert seen(bench.write(1, "torque", 1))
    assert bench.bus.servos[1].torque  # it has obeyed all the same
    assert bench.send(2, PING) == packet(2, 0)


@pytest.mark.parametrize("fault", ["stuck", "deaf_torque"])
def test_a_servo_that_acknowledges_and_does_not_move(bench: Bench, fault: str) -> None:
    bench.bus.servos[1].fault = fault
    assert bench.move(1, 1048)[4] == 0
    bench.wait(5.0)
    assert bench.bus.servos[1].position == CENTRE
    assert bench.read(1, "torque") == (1 if fault == "stuck" else 0)


def test_a_bus_that_drops_comes_back(bench: Bench) -> None:
    bench.bus.drop(transactions=2)
    assert [bool(bench.send(1, PING)) for _ in range(3)] == [False, False, True]
    bench.bus.drop(seconds=1.0)
    assert not bench.send(1, PING)
    bench.now += 1.1
    assert bench.send(1, PING) and bench.bus.bus_fault is None


def test_faster_than_life() -> None:
    bench = Bench(speedup=20)
    bench.move(1, 1048, speed=500)
    bench.wait(0.2)
    assert bench.bus.servos[1].position == 1048


def test_a_shaft_that_is_told_late_to_turn_round_still_stops_before_its_limit(bench: Bench) -> None:
    lowest = bench.read(1, "lowest")
    bench.move(1, lowest, speed=3000, acceleration=200)
    bench.wait(0.4)
    assert bench.bus.servos[1].speed < -2000
    bench.move(1, CENTRE, acceleration=1)
    bench.wait(60, step=1)
    assert lowest - 1e-6 <= bench.bus.servos[1].reached.lowest < lowest + 5
    assert bench.bus.servos[1].position == CENTRE


COMMANDS = st.lists(
    st.tuples(
        st.sampled_from([1, 2, 3]),
        st.sampled_from(["goal", "goal", "torque", "speed", "acceleration"]),
        st.integers(0, 65535),
        st.floats(0, 1.5),
    ),
    max_size=40,
)


@given(COMMANDS)
def test_whatever_is_written_no_shaft_leaves_its_limits(commands: list[tuple[int, str, int, float]]) -> None:
    bench = Bench()
    for number, name, value, seconds in commands:
        bench.write(number, name, value % 256 if FIELDS[name]["bytes"] == 1 else value)
        if name == "torque" and value % 2:
            bench.write(number, "torque", 1)
        bench.now += seconds
    for number in (1, 2, 3):
        reached = bench.bus.servos[number].reached
        assert reached.lowest >= bench.read(number, "lowest") - 1e-6
        assert reached.highest <= bench.read(number, "highest") + 1e-6


@given(st.floats(0, 4095), st.floats(0, 4095), st.floats(0, 2), st.floats(50, 3400), st.floats(100, 20000))
def test_a_new_goal_in_the_middle_changes_speed_gently(
    first: float, second: float, after: float, top: float, gain: float
) -> None:
    one = planned(resting(2000.0, 0.0), 0.0, first, 1500.0, gain)
    two = planned(one, after, second, top, gain)
    assert two.at(after) == pytest.approx(one.at(after), abs=1e-3)
    assert two.at(two.ends + 1) == (second, 0.0)
    assert two.at(two.ends - 1e-7)[0] == pytest.approx(second, abs=0.1)
    times = [after + (two.ends - after) * part / 50 for part in range(51)]
    within = [two.start, two.goal, *two.turns()]
    assert all(min(within) - 0.1 <= two.at(time)[0] <= max(within) + 0.1 for time in times)
    assert all(abs(two.at(time)[1]) <= max(top, 1500.0) + 1e-3 for time in times)


def test_a_joint_that_is_made_limp_on_its_way_stays_where_it_is(bench: Bench) -> None:
    bench.move(5, 3000, speed=400)
    bench.now += 1
    bench.write(5, "torque", 0)
    place = bench.read(5, "position")
    bench.now += 5
    assert 2100 < place < 2900 and bench.read(5, "position") == place and bench.read(5, "moving") == 0
