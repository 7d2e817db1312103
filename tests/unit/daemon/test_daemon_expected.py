"""What ought to report: nothing that never measured, nothing that was taken away, and everything else."""

import json
import os
from datetime import UTC, datetime
from pathlib import Path

import pytest

from octoform.base.health_status import Status
from octoform.claims.ledger import Ledger
from octoform.claims.model import Channel, Reading, Signal, Value
from octoform.claims.settings import Settings
from octoform.daemon.evidence import Evidence
from octoform.daemon.health import Health, compose, snapshot, worse
from octoform.daemon.model import Facts
from octoform.daemon.signals import current, measured
from octoform.daemon.status_file import Bulletin
from octoform.daemon.store.memory import Memory
from octoform.endpoint.process.record import Running
from octoform.manifest.model import Daemon
from octoform.state.layout import Layout

PROCESS = Running(10, 20, ("launch",), "one", "2026-01-01T00:00:00Z", "local", None)
MADE = datetime(2026, 1, 1, 12, tzinfo=UTC)
X, WHY = "/x_steps", "/unknown"


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    found = Layout(tmp_path, "bench")
    path = found.output("interface")
    path.parent.mkdir(parents=True)
    chips = {"name": "read_temperature", "devices": ["hwmon-a", "hwmon-b"]}
    path.write_text(json.dumps({"tools": [chips, {"name": "read_joints", "devices": ["arm"]}]}))
    os.utime(path, (MADE.timestamp(),) * 2)
    return found


class Now:
    """A clock that a test moves."""

    def __init__(self) -> None:
        self.now = 100.0

    def uptime(self) -> float:
        return self.now

    def stamp(self) -> str:
        return f"2026-01-01T13:00:{int(self.now) % 60:02}.000Z"


def sensed(path: str, value: Value, uptime: float = 1.0, why: str = "", source: str = "read_joints") -> Reading:
    at = f"2026-01-01T12:00:{int(uptime):02}.000Z"
    return Reading(f"r{source}{path}{uptime}", at, uptime, Signal(Channel.SENSOR, source, path), value, why)


def facts(uptime: float = 100.0) -> Facts:
    return Facts(uptime, "2026-01-01T13:00:00.000Z", "bench", process=PROCESS, answers=True)


def test_only_what_measured_something_is_expected_to_do_so_again() -> None:
    now = [sensed("/heat", None), sensed("/calibrated", None), sensed("/note", None), sensed("/on", False)]
    before = {"/heat": [sensed("/heat", 31)], "/note": [sensed("/note", "it is new")], "/calibrated": []}
    found = measured(now, lambda signal: before[signal.path])
    assert {signal.path for signal in found} == {"/heat", "/on"}


@pytest.mark.parametrize(
    ("source", "there"),
    [
        ("read_joints", True),
        ("read_temperature(hwmon-a)", True),
        ("read_temperature(hwmon-c)", False),
        ("read_rail", False),
    ],
)
def test_what_is_not_offered_any_more_is_missed_by_nobody(layout: Layout, source: str, there: bool) -> None:
    assert bool(current([sensed("/x", 1, source=source)], layout)) is there


def test_a_member_that_new_tools_do_not_have_is_over_and_one_that_fell_silent_is_not(layout: Layout) -> None:
    old = Reading("r1", "2026-01-01T11:59:00.000Z", 1.0, Signal(Channel.SENSOR, "read_joints", "/elbow"), 3)
    assert current([old], layout) == [old], "nothing was read since: it is still the newest that is known"
    fresh = sensed("/wrist", 4)
    assert current([old, fresh], layout) == [fresh]
    younger = sensed("/elbow", 5, 2.0)
    assert current([younger, sensed("/wrist", 4, 3.0)], layout)[0] == younger


def test_where_the_tools_cannot_be_read_nothing_is_forgotten(layout: Layout) -> None:
    layout.output("interface").write_text("{")
    assert current([sensed("/x", 1, source="read_rail")], layout)


def made_of(channel: Channel, source: str, value: Value = True, path: str = "/there", uptime: float = 1.0) -> Reading:
    return Reading(f"r{source}", "2026-01-01T12:00:01.000Z", uptime, Signal(channel, source, path), value, "")


PICTURES = frozenset({Signal(Channel.FRAME, "", "")})


def test_nobody_misses_pictures_while_perception_is_off(layout: Layout) -> None:
    none = made_of(Channel.FRAME, "cam", None, "/trouble")
    assert current([none], layout) == []
    assert current([none], layout, PICTURES) == [none]
    layout.output("interface").unlink()
    assert current([none], layout) == [], "this is the manifest's word, whichever tools there are"


def test_only_the_camera_that_is_looked_through_counts(layout: Layout) -> None:
    former = made_of(Channel.FRAME, "camera", None, "/trouble")
    now = made_of(Channel.FRAME, "cam", "", "/trouble", 2.0)
    assert current([former, now], layout, PICTURES) == [now]


@pytest.mark.parametrize(
    ("reading", "there"),
    [
        (made_of(Channel.KERNEL, "arm", False), True),
        (made_of(Channel.KERNEL, "usb-gone", False), False),
        (made_of(Channel.LOG, "read_joints", False, "/ok"), True),
        (made_of(Channel.LOG, "read_rail", False, "/ok"), False),
        (made_of(Channel.PROCESS, "endpoint", False, "/running"), True),
    ],
)
def test_a_device_or_tool_that_was_taken_out_is_no_evidence_of_now(
    layout: Layout, reading: Reading, there: bool
) -> None:
    assert bool(current([reading], layout)) is there


def test_a_tool_that_the_policy_denies_is_missed_by_nobody(layout: Layout) -> None:
    layout.endpoint.mkdir(parents=True)
    fixed = {"effect": "read", "timeout": None, "buses": None, "limits": None}
    rules = {name: {**fixed, "decision": how} for name, how in (("read_joints", "deny"), ("read_temperature", "allow"))}
    (layout.endpoint / "policy.json").write_text(json.dumps({"mode": "enforce", "tools": rules}))
    readings = [sensed("/elbow", None, why="it is denied"), made_of(Channel.KERNEL, "arm", False)]
    assert current(readings, layout) == []


def test_perception_that_is_switched_off_leaves_no_unknown(layout: Layout) -> None:
    clock = Now()
    memory = Memory.open(layout, "boot", clock.now, Daemon())
    ledger = Ledger.open(layout, clock, Settings(3600.0, boot="boot"))
    ledger.record([ledger.make(Signal(Channel.FRAME, "camera", "/trouble"), None, "it is not there")])
    bulletin = Bulletin(memory, Evidence(ledger), 900.0)
    assert bulletin(facts(clock.now), {}, None, PICTURES).status is Status.UNKNOWN
    assert bulletin(facts(clock.now), {}, None).status is Status.HEALTHY


def test_a_position_that_says_why_it_is_unknown_is_an_answer_and_a_bare_null_is_none() -> None:
    homed = [sensed(X, 1200), sensed(WHY, None)]
    started = [sensed(X, None, 2.0), sensed(WHY, "nothing was counted since this server started", 2.0)]
    expected = [homed[0].signal]
    assert compose(facts(), readings=started, expected=expected).status is Status.HEALTHY
    assert compose(facts(), readings=[started[0]], expected=expected).status is Status.UNKNOWN
    stale = [sensed(X, None, 3.0), sensed(WHY, "it was so once", 2.0)]
    assert compose(facts(), readings=stale, expected=expected).status is Status.UNKNOWN


def test_a_repair_that_starts_the_endpoint_anew_is_not_worse_for_a_position_that_must_be_counted_again() -> None:
    before = snapshot(facts(), [sensed(X, 1200), sensed(WHY, None)])
    assert worse(before, snapshot(facts(), [sensed(X, None, 2.0), sensed(WHY, "home makes it known", 2.0)])) is None
    assert worse(before, snapshot(facts(), [sensed(X, None, 2.0), sensed(WHY, None, 2.0)])) is not None


def test_the_daemon_misses_what_measured_before_and_asks_nothing_of_what_never_did(layout: Layout) -> None:
    clock = Now()
    memory = Memory.open(layout, "boot", clock.now, Daemon())
    ledger = Ledger.open(layout, clock, Settings(3600.0, boot="boot"))
    bulletin = Bulletin(memory, Evidence(ledger), 900.0)

    def told(value: Value) -> Health:
        clock.now += 1
        heat, calibrated = (Signal(Channel.SENSOR, "read_joints", f"/elbow/{name}") for name in ("heat", "calibrated"))
        ledger.record([ledger.make(heat, value), ledger.make(calibrated, None)])
        return bulletin(facts(clock.now), {}, None)

    assert told(None).status is Status.HEALTHY
    assert told(31).status is Status.HEALTHY
    for _ in range(20):  # longer than the ledger remembers each reading
        assert told(None).uncovered == ("read_joints/elbow/heat",)
    assert told(32).status is Status.HEALTHY
