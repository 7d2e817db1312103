"""What a daemon knew of a trouble is what the next one knows: after a restart, a reboot, an edit of the manifest."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from daemon_world import DaemonWorld, failed, worked

from octoform.apply.repair_outcome import Cost, RepairOutcome
from octoform.claims.model import Channel, Signal
from octoform.daemon.model import Cause, Finding, Outcome, Repair
from octoform.daemon.store import instance_lock

TOOL = "read_joints"
Again = Callable[[DaemonWorld], None]


def restarted(world: DaemonWorld) -> None:
    """The daemon alone, as after an edit of the manifest too."""
    world.begun()
    world.start()


def rebooted(world: DaemonWorld) -> None:
    world.reboot()
    world.start()


@pytest.fixture
def world(tmp_path: Path) -> DaemonWorld:
    return DaemonWorld(tmp_path)


@pytest.fixture(params=[restarted, rebooted])
def again(request: pytest.FixtureRequest) -> Again:
    found: Again = request.param
    return found


class Agent:
    """An agent of WATCH or HEAL that keeps what it was given."""

    def __init__(self, answer: Callable[[], RepairOutcome]) -> None:
        self.briefs: list[dict[str, Any]] = []
        self.answer = answer

    def __call__(self, world: DaemonWorld, finding: Finding) -> RepairOutcome:
        self.briefs.append(finding.data["brief"])
        return self.answer()


def report(klass: str = "broken_tool", *, severity: str = "recoverable", more: str | None = None) -> RepairOutcome:
    """WATCH names the tool, and perhaps another one."""
    names = [TOOL] if more is None else [TOOL, more]
    errors: list[dict[str, Any]] = [
        {"tool": name, "device": None, "class": klass, "message": "it is so", "severity": severity, "cites": []}
        for name in names
    ]
    found = {"status": "error", "summary": "the elbow is warm", "errors": errors}
    return worked("a report", cost=Cost(1, 100, 10, 0.01), report=found)


def nothing() -> RepairOutcome:
    return failed("no report", cost=Cost(1, 100, 10, 0.01))


def useless() -> RepairOutcome:
    return failed("it cannot be rewritten so", cost=Cost(1, 100, 10, 0.01))


def broken(world: DaemonWorld, times: int = 1) -> None:
    world.start()
    for _ in range(times):
        world.fail(TOOL)
    world.happens(Cause.LOG)


def test_an_agent_is_given_each_failure_that_triage_knows(world: DaemonWorld, again: Again) -> None:
    watch = Agent(nothing)
    world.mends[Repair.WATCH] = watch
    broken(world, 3)
    again(world)
    world.advance(120)
    before, after = watch.briefs[0], watch.briefs[-1]
    assert len(watch.briefs) == 3
    (failure,) = after["failures"]
    assert failure["tool"] == TOOL and failure["count"] == 3 and failure["error"] == "NameError"
    assert failure["first"] == before["failures"][0]["first"] and failure["last"] == before["failures"][0]["last"]
    cited = {each["id"]: each for each in after["readings"]}
    assert cited[failure["id"]]["value"] is False and cited[failure["id"]]["source"] == TOOL


def test_the_repair_cites_what_is_known_too(world: DaemonWorld, again: Again) -> None:
    heal = Agent(useless)
    world.mends |= {Repair.WATCH: Agent(report), Repair.HEAL: heal}
    broken(world)
    again(world)
    world.advance(600)
    for brief in heal.briefs:
        assert [each["tool"] for each in brief["failures"]] == [TOOL]
        assert brief["failures"][0]["id"] in {each["id"] for each in brief["readings"]}


def test_the_words_of_the_last_report_are_not_forgotten(world: DaemonWorld, again: Again) -> None:
    watch = Agent(report)
    world.mends |= {Repair.WATCH: watch, Repair.HEAL: Agent(useless)}
    broken(world)
    again(world)
    world.fail("another")
    world.happens(Cause.LOG)
    assert watch.briefs[-1]["summary"] == "the elbow is warm"
    assert watch.briefs[-1]["since"] >= watch.briefs[0]["failures"][0]["last"]


def test_a_diagnosis_is_paid_once(world: DaemonWorld, again: Again) -> None:
    world.mends |= {Repair.WATCH: Agent(report), Repair.HEAL: lambda world, finding: useless()}
    broken(world)
    count = world.repairs().count(Repair.HEAL)
    again(world)
    world.advance(600)
    assert world.repairs().count(Repair.WATCH) == 1
    assert world.repairs().count(Repair.HEAL) == 3 > count


@pytest.mark.parametrize("times", [1, 3])
def test_what_was_given_up_stays_so_until_a_person_asks(world: DaemonWorld, again: Again, times: int) -> None:
    world.mends |= {Repair.WATCH: Agent(report), Repair.HEAL: Agent(useless)}
    broken(world)
    world.advance(3600)
    made = list(world.repairs(f"tool:{TOOL}"))
    (episode,) = world.memory.episodes.open.values()
    assert episode.outcome is Outcome.FROZEN
    for _ in range(times):
        again(world)
        world.fail(TOOL)
        world.happens(Cause.LOG)
        world.advance(7200)
    assert world.repairs(f"tool:{TOOL}") == made
    (same,) = world.memory.episodes.open.values()
    assert (same.id, same.outcome) == (episode.id, Outcome.FROZEN)
    assert [alert.event for alert in world.alerts if alert.target == same.target] == ["opened", "frozen"]
    instance_lock.ask(world.layout, ("*",))
    world.happens(Cause.ASKED)
    world.advance(3600)
    assert world.repairs(f"tool:{TOOL}") == made * 2


def test_what_a_person_has_to_do_is_not_asked_about_again(world: DaemonWorld, again: Again) -> None:
    world.mends[Repair.WATCH] = Agent(lambda: report(severity="fatal"))
    broken(world)
    again(world)
    world.advance(7200)
    assert world.repairs(f"tool:{TOOL}") == [Repair.WATCH]
    (episode,) = world.memory.episodes.open.values()
    assert episode.outcome is Outcome.SURFACED


def test_what_else_a_report_named_lasts_as_long_as_its_word(world: DaemonWorld, again: Again) -> None:
    world.mends[Repair.WATCH] = Agent(lambda: report("none", more="other"))
    broken(world)
    assert {each.target for each in world.memory.episodes.open.values()} == {f"tool:{TOOL}", "tool:other"}
    again(world)
    assert {each.target for each in world.memory.episodes.open.values()} == {f"tool:{TOOL}", "tool:other"}
    world.advance(2 * world.settings.claim_seconds)
    assert {each.target for each in world.memory.episodes.open.values()} == {f"tool:{TOOL}"}


@pytest.mark.parametrize("error", ["NameError", "OSError"])
def test_a_freeze_holds_while_the_endpoint_is_down(world: DaemonWorld, again: Again, error: str) -> None:
    """What cannot be seen for a while is not over."""
    world.mends[Repair.WATCH] = Agent(nothing)
    world.start()
    for _ in range(2):
        world.fail(TOOL, error, "it is broken")
    world.happens(Cause.LOG)
    world.advance(3600)
    world.truth.stopped_by = "a person"
    world.die()
    world.happens(Cause.PROCESS)
    world.advance(7200)
    again(world)
    world.truth.stopped_by = None
    world.live()
    world.happens(Cause.PROCESS, Cause.FILES)
    world.advance(7200)
    assert world.repairs(f"tool:{TOOL}") == [Repair.WATCH] * 3
    assert [alert.event for alert in world.alerts if alert.target == f"tool:{TOOL}"] == ["opened", "frozen"]
    world.truth.worked.append(TOOL)
    world.happens(Cause.LOG)
    assert f"tool:{TOOL}" not in {each.target for each in world.memory.episodes.open.values()}


def test_both_pictures_have_their_reading_and_a_lost_value_its_reason(
    world: DaemonWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(world, "promised", lambda: frozenset({Signal(Channel.FRAME, "", "")}))
    world.begun()
    watch = Agent(nothing)
    world.mends[Repair.WATCH] = watch
    world.start()
    trouble, volts = Signal(Channel.FRAME, "cam", "/trouble"), Signal(Channel.SENSOR, "status", "/volts")
    for value in (7, None):
        world.now += 1
        made = [world.ledger.make(trouble, ""), world.ledger.make(volts, value)]
        world.ledger.record([*made, world.ledger.make(Signal(Channel.SENSOR, "status", "/owner"), None)])
    world.fail(TOOL)
    world.happens(Cause.LOG)
    rows = watch.briefs[0]["readings"]
    assert len([row for row in rows if row["path"] == "/trouble"]) == 2
    whys = {row["path"]: row["why"] for row in rows if row["value"] is None}
    assert whys == {"/volts": "it reported before and has no value now", "/owner": ""}
