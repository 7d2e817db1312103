"""Health is what is seen: nothing that cannot report is healthy, and no word outranks a reading."""

from dataclasses import dataclass, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.base.health_status import Status
from octoform.claims.model import Channel, Claim, Condition, Reading, Signal, State
from octoform.daemon import health
from octoform.daemon.health import HealthSnapshot, compose, snapshot, worse
from octoform.daemon.model import Facts, LastSeen, Outcome
from octoform.endpoint.process.record import Running

PROCESS = Running(10, 20, ("launch",), "one", "2026-01-01T00:00:00Z", "local", None)
WELL = Facts(100.0, "2026-01-01T00:01:40Z", "bench", process=PROCESS, answers=True, devices={"usb-1": LastSeen(True)})
HEAT = Signal(Channel.SENSOR, "arm_read", "/joints/elbow/heat")


def heat(value: float | None, uptime: float = 1.0, why: str = "") -> Reading:
    return Reading(f"r{uptime}", "", uptime, HEAT, value, why)


def claim(state: State = State.ACTIVE) -> Claim:
    hot = Condition(">", 60)
    return Claim("c1", "device:arm/elbow", "none", "the elbow is hot", HEAT, hot, ("r1",), "watch", "", 0, "", 9, state)


@dataclass(frozen=True)
class Episode:
    status: Status
    outcome: Outcome
    target: str = "endpoint"
    summary: str = "something"


NOT_HEALTHY = [
    (replace(WELL, process=None), Status.DOWN),
    (replace(WELL, stopped_by="a person"), Status.DOWN),
    (replace(WELL, answers=False), Status.DOWN),
    (replace(WELL, answers=None), Status.UNKNOWN),
    (replace(WELL, applied=False), Status.UNKNOWN),
    (replace(WELL, latched=True), Status.DEGRADED),
    (replace(WELL, devices={"usb-1": LastSeen(None)}), Status.UNKNOWN),
    (replace(WELL, devices={"usb-1": LastSeen(False)}), Status.DEGRADED),
    (replace(WELL, devices={"usb-1": LastSeen(True, doubt="two")}), Status.DEGRADED),
]


@pytest.mark.parametrize(("facts", "status"), NOT_HEALTHY)
def test_each_thing_that_is_seen_has_its_status(facts: Facts, status: Status) -> None:
    assert compose(facts).status is status


def test_all_seen_and_well_is_healthy() -> None:
    found = compose(WELL, [Episode(Status.DOWN, Outcome.REPAIRED)], readings=[heat(30)], expected=[HEAT])
    assert (found.status, found.parts, found.covered, found.uncovered) == (Status.HEALTHY, (), 1, ())


def test_where_nothing_is_applied_any_more_no_signal_reports() -> None:
    assert compose(replace(WELL, applied=False), readings=[heat(30)]).covered == 0


@pytest.mark.parametrize(
    "readings", [[], [heat(None, why="no answer")], [heat(30), heat(None, 2, "no answer")], [heat(None)]]
)
def test_what_reported_before_and_does_not_now_is_unknown(readings: list[Reading]) -> None:
    found = compose(WELL, readings=readings, expected=[HEAT])
    assert (found.status, found.uncovered) == (Status.UNKNOWN, ("arm_read/joints/elbow/heat",))


def test_a_unit_that_its_owner_disabled_is_not_healthy() -> None:
    skipped = Reading("r2", "", 1, Signal(Channel.SENSOR, "arm_read", "/joints/elbow/skipped"), "disabled by its owner")
    found = compose(WELL, readings=[skipped, heat(None, why="skipped")])
    assert (found.status, found.uncovered) == (Status.UNKNOWN, ("arm_read/joints/elbow",))


def test_what_is_wrong_is_told_before_what_is_unknown() -> None:
    episodes = [Episode(Status.DEGRADED, Outcome.FROZEN), Episode(Status.HEALTHY, Outcome.OPEN)]
    found = compose(WELL, episodes, expected=[HEAT])
    assert [each.status for each in found.parts] == [Status.DEGRADED, Status.UNKNOWN]


def test_a_claim_counts_until_a_newer_reading_of_its_signal_speaks_against_it() -> None:
    assert compose(WELL, claims=[claim()], readings=[heat(70)]).claims == ("c1",)
    assert compose(WELL, claims=[claim()]).status is Status.DEGRADED
    assert compose(WELL, claims=[claim()], readings=[heat(70), heat(40, 2)]).status is Status.HEALTHY
    assert compose(WELL, claims=[claim(State.RETIRED), claim(State.REFUSED)]).status is Status.HEALTHY
    assert compose(WELL, claims=[claim(State.PENDING)]).pending == ("c1",)


@given(
    st.lists(
        st.builds(heat, st.none() | st.floats(0, 100), st.floats(0, 10), st.sampled_from(["", "no answer"])), max_size=6
    ),
    st.sampled_from([None, True, False]),
    st.sampled_from([None, True, False]),
)
def test_never_healthy_while_something_cannot_report(
    readings: list[Reading], there: bool | None, answers: bool | None
) -> None:
    facts = replace(WELL, devices={"usb-1": LastSeen(there)}, answers=answers)
    found = compose(facts, readings=readings, expected=[HEAT])
    last = max(readings, key=lambda each: each.uptime, default=None)
    reports = last is not None and [each for each in readings if each.uptime == last.uptime][-1].value is not None
    assert (found.status is Status.HEALTHY) == (reports and there is True and answers is True)
    assert health.from_json(found.as_json()) == found


BEFORE = HealthSnapshot(True, True, frozenset({"arm/heat"}), frozenset({"usb-1"}), frozenset({"look"}), {})
WORSE = [
    (replace(BEFORE, running=False), "does not run"),
    (replace(BEFORE, answers=False), "does not answer"),
    (replace(BEFORE, tools=frozenset()), "look is not listed"),
    (replace(BEFORE, there=frozenset()), "usb-1 is not there"),
    (replace(BEFORE, reporting=frozenset()), "arm/heat is not reporting"),
    (replace(BEFORE, failing={"look": 1}), "look fails"),
]


@pytest.mark.parametrize(("after", "words"), WORSE)
def test_what_is_worse_is_told(after: HealthSnapshot, words: str) -> None:
    assert words in (worse(BEFORE, after) or "")
    assert worse(after, after) is None
    assert worse(after, BEFORE) is None


def test_a_stand_is_made_of_facts_and_readings() -> None:
    assert snapshot(WELL, [heat(3)], ["look"], {"look": 1}) == HealthSnapshot(
        True, True, frozenset({"arm_read/joints/elbow/heat"}), frozenset({"usb-1"}), frozenset({"look"}), {"look": 1}
    )


def test_a_tool_that_failed_as_a_whole_is_covered_again_once_it_works() -> None:
    failed = Reading("r1", "", 1.0, Signal(Channel.SENSOR, "arm_read", ""), None, "no answer")
    assert compose(WELL, readings=[heat(30, 0.5), failed]).uncovered == ("arm_read",)
    assert compose(WELL, readings=[heat(30, 0.5), failed]).covered == 0
    assert compose(WELL, readings=[failed, heat(30, 2.0)]).status is Status.HEALTHY
    worked = Reading("r2", "", 2.0, Signal(Channel.LOG, "arm_read", "/ok"), True)
    assert compose(WELL, readings=[failed, worked]).status is Status.HEALTHY
    assert compose(WELL, readings=[failed, replace(worked, uptime=0.5)]).status is Status.UNKNOWN


def test_what_is_seen_and_its_episode_are_told_once() -> None:
    found = compose(replace(WELL, process=None), [Episode(Status.DOWN, Outcome.OPEN)])
    assert [each.why for each in found.parts] == ["its process does not run"]
