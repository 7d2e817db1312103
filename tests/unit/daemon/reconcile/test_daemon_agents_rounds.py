"""The loop with agents in it: WATCH is acted upon by the playbook, HEAL is on probation, claims are offered."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from daemon_world import DaemonWorld, failed, first, worked

from octoform.apply.repair_outcome import Cost, RepairOutcome
from octoform.base.health_status import Status
from octoform.claims.model import State
from octoform.daemon.model import Cause, Finding, Outcome, Repair
from octoform.daemon.store import instance_lock

TOOL = "read_joints"


@pytest.fixture
def world(tmp_path: Path) -> DaemonWorld:
    return DaemonWorld(tmp_path)


def said(
    klass: str, tool: str | None = TOOL, severity: str = "recoverable", **more: Any
) -> Callable[..., RepairOutcome]:
    """WATCH that names one error."""
    error = {"tool": tool, "device": None, "class": klass, "message": "it is so", "severity": severity}
    report = {"status": "error", "summary": "s", "errors": [{**error, "suggested_fix": "", "cites": []}], **more}
    return lambda world, finding: worked("a report", cost=Cost(1, 100, 10, 0.01), report=report)


def healed(world: DaemonWorld, finding: Finding) -> RepairOutcome:
    return worked("rewritten", cost=Cost(1, 200, 20, 0.02), report={"claims": []})


def broken(world: DaemonWorld) -> None:
    world.fail(TOOL)


def test_a_broken_tool_goes_to_watch_then_to_heal_in_one_episode(world: DaemonWorld) -> None:
    world.mends |= {Repair.WATCH: said("broken_tool"), Repair.HEAL: healed}
    world.start()
    broken(world)
    world.happens(Cause.LOG)
    world.advance(30)
    assert world.repairs() == [Repair.WATCH, Repair.HEAL]
    (episode,) = [item for made in world.rounds for item in made.ended]
    assert episode.outcome is Outcome.REPAIRED
    assert [made.repair for made in episode.tries] == ["watch", "heal"]
    assert episode.spent == Cost(2, 300, 30, 0.03)


def test_watch_and_heal_are_given_their_briefs(world: DaemonWorld) -> None:
    given: dict[str, Any] = {}

    def keep(repair: str, then: Callable[..., RepairOutcome]) -> Callable[..., RepairOutcome]:
        def kept(world: DaemonWorld, finding: Finding) -> RepairOutcome:
            given[repair] = finding.data["brief"]
            return then(world, finding)

        return kept

    world.mends |= {Repair.WATCH: keep("watch", said("broken_tool")), Repair.HEAL: keep("heal", healed)}
    world.start()
    world.truth.sensors[("status", "/volts")] = 7.4
    world.advance(301)
    broken(world)
    world.happens(Cause.LOG)
    world.advance(30)
    watch, heal = given["watch"], given["heal"]
    assert set(watch) == {"causes", "readings", "failures", "claims", "summary", "since", "target", "calls", "usd"}
    assert watch["target"] == f"tool:{TOOL}" and watch["causes"] == ["log"]
    assert [(item["tool"], item["count"]) for item in watch["failures"]] == [(TOOL, 1)]
    assert watch["failures"][0]["id"] in {item["id"] for item in watch["readings"]}
    assert any(item["path"] == "/volts" and item["value"] == 7.4 for item in watch["readings"])
    assert heal["error"]["class"] == "broken_tool" and heal["target"] == f"tool:{TOOL}"
    assert heal["episode"].startswith("e")
    assert (watch["since"], heal["since"]) == ("", ""), "no one was asked before: all of the log counts"
    asked = watch
    world.fail("another")
    world.happens(Cause.LOG)
    assert given["watch"]["since"] >= asked["failures"][0]["last"]
    assert given["watch"]["summary"] == "s"
    world.set_wall(-7200)
    world.fail("a_third")
    world.happens(Cause.LOG)
    assert given["watch"]["since"] == ""


def test_a_heal_that_does_not_help_is_tried_three_times_and_frozen(world: DaemonWorld) -> None:
    def useless(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        broken(world)  # the smoke call after it fails again
        return healed(world, finding)

    world.mends |= {Repair.WATCH: said("broken_tool"), Repair.HEAL: useless}
    world.start()
    broken(world)
    world.happens(Cause.LOG)
    world.advance(2 * 3600)
    assert world.repairs() == [Repair.WATCH, Repair.HEAL, Repair.HEAL, Repair.HEAL]
    (episode,) = world.memory.episodes.open.values()
    assert episode.outcome is Outcome.FROZEN


def test_what_watch_says_is_missing_is_built_again_before_heal_is_asked(world: DaemonWorld) -> None:
    world.mends |= {Repair.WATCH: said("dependency"), Repair.HEAL: healed}
    world.mends[Repair.REBUILD] = first(broken, worked("built"))
    world.start()
    broken(world)
    world.happens(Cause.LOG)
    world.advance(120)
    assert world.repairs() == [Repair.WATCH, Repair.REBUILD, Repair.HEAL]


@pytest.mark.parametrize(("klass", "severity"), [("none", "recoverable"), ("broken_tool", "fatal")])
def test_what_the_playbook_does_not_know_is_for_a_person(world: DaemonWorld, klass: str, severity: str) -> None:
    world.mends[Repair.WATCH] = said(klass, severity=severity)
    world.start()
    broken(world)
    world.happens(Cause.LOG)
    world.advance(2 * 3600)
    assert world.repairs() == [Repair.WATCH]
    (episode,) = world.memory.episodes.open.values()
    assert episode.outcome is Outcome.SURFACED
    assert [alert.event for alert in world.alerts] == ["opened", "surfaced"]


def test_a_watch_without_a_report_is_tried_three_times(world: DaemonWorld) -> None:
    world.mends[Repair.WATCH] = lambda world, finding: failed("timeout", cost=Cost(1))
    world.start()
    broken(world)
    world.happens(Cause.LOG)
    world.advance(2 * 3600)
    assert world.repairs() == [Repair.WATCH] * 3


def test_heal_that_makes_it_worse_is_taken_back(world: DaemonWorld) -> None:
    def worse(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        world.truth.sensors[("status", "/volts")] = None
        return healed(world, finding)

    def back(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        assert finding.data["brief"]["reason"] and finding.data["brief"]["episode"] == "e1"
        world.truth.sensors[("status", "/volts")] = 7.4
        return worked("as before")

    world.mends |= {Repair.WATCH: said("broken_tool"), Repair.HEAL: worse, Repair.ROLL_BACK: back}
    world.truth.sensors[("status", "/volts")] = 7.4
    world.start()
    broken(world)
    world.happens(Cause.LOG)
    world.advance(3600)
    assert world.repairs() == [Repair.WATCH, Repair.HEAL, Repair.ROLL_BACK]


def test_nothing_is_healed_while_an_emergency_stop_is_latched(world: DaemonWorld) -> None:
    world.mends |= {Repair.WATCH: said("broken_tool"), Repair.HEAL: healed}
    world.truth.latched = True
    world.start()
    broken(world)
    world.happens(Cause.LOG)
    world.advance(600)
    assert world.repairs() == [Repair.WATCH]
    world.truth.latched = False
    world.happens(Cause.FILES)
    assert world.repairs() == [Repair.WATCH, Repair.HEAL]


def test_claims_are_offered_and_declarations_wait_for_a_person(world: DaemonWorld) -> None:
    world.truth.sensors[("status", "/heat")] = 70
    world.start()

    def claiming(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        (reading,) = [item for item in finding.data["brief"]["readings"] if item["path"] == "/heat"]
        signal = {"channel": "sensor", "source": "status", "path": "/heat"}
        claim: dict[str, Any] = {"target": "device:arm", "fault": "none", "statement": "hot", "signal": signal}
        claim |= {"condition": {"op": ">", "value": 60}, "cites": [reading["id"]], "seconds": 600, "restrictions": []}
        wild = {"kind": "fire_risk", "target": "device:arm", "statement": "fire", "cites": [reading["id"]]}
        bare = {**claim, "cites": []}
        return said("none", claims=[claim, bare], declarations=[wild])(world, finding)

    world.mends[Repair.WATCH] = claiming
    broken(world)
    world.happens(Cause.LOG)
    assert [(claim.statement, claim.state) for claim in world.ledger.active()] == [("hot", State.ACTIVE)]
    assert [claim.irreversible for claim in world.ledger.pending()] == ["fire_risk"]
    assert "confirm" in [alert.event for alert in world.alerts]
    assert "CLAIM-NO-READING" in [item.code for made in world.rounds for item in made.problems]
    world.truth.sensors[("status", "/heat")] = 40
    world.advance(301)
    assert world.ledger.active() == (), "a fresh reading that says otherwise ends it"


def test_what_an_agent_says_of_something_else_is_forgotten_in_time(world: DaemonWorld) -> None:
    def two(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        done = said("broken_tool")(world, finding)
        assert done.report is not None
        done.report["errors"].append({**done.report["errors"][0], "tool": "other", "class": "none"})
        return done

    world.mends |= {Repair.WATCH: two, Repair.HEAL: healed}
    world.start()
    broken(world)
    world.happens(Cause.LOG)
    world.advance(60)
    assert [item.target for item in world.memory.episodes.open.values()] == ["tool:other"]
    world.advance(2000)
    assert world.memory.episodes.open == {}


def test_a_tool_that_was_given_up_is_not_well_because_something_else_was_repaired(world: DaemonWorld) -> None:
    world.mends[Repair.WATCH] = lambda world, finding: failed("no report", again=False)
    world.start()
    broken(world)
    world.happens(Cause.LOG)
    world.advance(60)
    (episode,) = world.memory.episodes.open.values()
    assert episode.outcome is Outcome.FROZEN

    def restored(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        world.truth.damaged = {}
        return worked("put back")

    world.mends[Repair.RESTORE] = restored
    world.truth.damaged = {"state/bench/serve/server.py": "lost"}
    world.happens(Cause.FILES)
    world.advance(60)
    assert world.repairs()[-1] is Repair.RESTORE and episode.outcome is Outcome.FROZEN
    health = world.rounds[-1].health
    assert health is not None and health.status is Status.DEGRADED


def test_a_run_that_ends_without_a_word_is_not_free(world: DaemonWorld) -> None:
    """Else an agent that kills what started it could be asked for ever."""
    world.memory.purse.calls_per_hour = 6
    given: list[int] = []

    def killed(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        given.append(finding.data["brief"]["calls"])
        return failed("the child ended without a result", cost=None)

    world.mends[Repair.WATCH] = killed
    world.start()
    for number in range(12):
        world.fail(f"tool_{'abcdefghijkl'[number]}")
        world.happens(Cause.LOG)
        world.advance(60)
    assert given == [6, 3], "each is told how often it may be asked, and counts as all of its attempts"


def test_what_a_person_asks_for_waits_where_it_cannot_be_taken_up(world: DaemonWorld) -> None:
    world.start()
    assert instance_lock.ask(world.memory.shelf.layout, ("*",)) is None
    lock = world.memory.shelf.path("asked.lock")
    lock.unlink()
    lock.mkdir()
    made = world.happens(Cause.ASKED)
    assert [item.code for item in made.problems] == ["STATE-WRITE-FAILED"]
    lock.rmdir()
    assert world.happens(Cause.ASKED).problems == () and not world.memory.shelf.path("asked.json").exists()


def test_no_agent_is_asked_for_what_cannot_be_written_down(world: DaemonWorld) -> None:
    world.mends[Repair.WATCH] = said("broken_tool")
    world.start()
    world.memory.shelf.path("spend.json").mkdir()
    broken(world)
    world.happens(Cause.LOG)
    world.advance(10)
    assert world.repairs() == []
    assert "cannot be written down" in next(iter(world.rounds[-1].waits.values()))


def rewritten(world: DaemonWorld, finding: Finding) -> RepairOutcome:
    return worked("rewritten", cost=Cost(1), report={"claims": [], "action": "rewrite"})


def on_probation(world: DaemonWorld) -> None:
    """A repair of HEAL after which all is well, for now."""
    world.mends |= {Repair.WATCH: said("broken_tool"), Repair.HEAL: rewritten}
    world.mends[Repair.ROLL_BACK] = lambda world, finding: worked("as before")
    world.truth.sensors[("status", "/volts")] = 7.4
    world.start()
    broken(world)
    world.happens(Cause.LOG)
    world.advance(5)
    assert world.repairs() == [Repair.WATCH, Repair.HEAL]


def test_heal_is_on_probation_until_everything_was_read_once_more(world: DaemonWorld) -> None:
    on_probation(world)
    world.truth.sensors[("status", "/volts")] = None
    world.advance(310)
    assert world.repairs() == [Repair.WATCH, Repair.HEAL, Repair.ROLL_BACK]


def test_heal_that_has_held_for_a_round_is_not_blamed_for_what_comes_later(world: DaemonWorld) -> None:
    on_probation(world)
    world.advance(310)
    world.truth.sensors[("status", "/volts")] = None
    world.advance(600)
    assert Repair.ROLL_BACK not in world.repairs()


def test_a_process_that_ends_again_and_again_after_heal_takes_it_back_and_one_end_does_not(world: DaemonWorld) -> None:
    on_probation(world)
    world.die()
    world.happens(Cause.PROCESS)
    world.advance(5)
    assert world.repairs()[2:] == [Repair.RESTART]
    world.die()
    world.happens(Cause.PROCESS)
    world.advance(10)
    assert world.repairs()[2:] == [Repair.RESTART, Repair.RESTART, Repair.ROLL_BACK]


@pytest.mark.parametrize("name", ["breakers.json", "spend.json", "episodes.jsonl", "claims.json", "readings.jsonl"])
def test_an_agent_that_writes_the_daemons_files_has_said_nothing_and_they_are_as_before(
    world: DaemonWorld, name: str
) -> None:
    path = world.layout.daemon / name

    def forging(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        path.write_text('{"format": 1}\n')
        return said("broken_tool")(world, finding)

    world.mends |= {Repair.WATCH: forging, Repair.HEAL: healed}
    world.truth.sensors[("status", "/volts")] = 7.4
    world.start()
    broken(world)
    world.happens(Cause.LOG)
    assert world.repairs() == [Repair.WATCH]
    (tried,) = [made for item in world.rounds for _, made in item.tried]
    assert not tried.ok and "refused" in tried.detail
    codes = {item.code for made in world.rounds for item in made.problems}
    assert codes & {"DAEMON-MEMORY-CHANGED", "CLAIM-LEDGER-CHANGED"}
    again = DaemonWorld.__new__(DaemonWorld)
    again.__dict__ |= world.__dict__
    again.begun()
    assert [item.tries for item in again.memory.breakers.all()] == [1]
    assert again.memory.purse.spent(world.now, world.stamp()).calls == 1
    assert len(again.memory.episodes.open) == 1 and again.ledger.latest()


def test_a_rewrite_of_an_agent_that_writes_the_daemons_files_is_taken_back(world: DaemonWorld) -> None:
    def forging(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        (world.layout.daemon / "breakers.json").unlink()
        return rewritten(world, finding)

    world.mends |= {Repair.WATCH: said("broken_tool"), Repair.HEAL: forging}
    world.mends[Repair.ROLL_BACK] = lambda world, finding: worked("as before")
    world.start()
    broken(world)
    world.happens(Cause.LOG)
    world.advance(5)
    assert world.repairs() == [Repair.WATCH, Repair.HEAL, Repair.ROLL_BACK]
