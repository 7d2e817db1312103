"""One outcome from a decision to the incident's record: nothing of why a repair was refused or did not hold is lost."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from daemon_world import BOOT, DaemonWorld, failed, worked

from octoform.apply.repair_outcome import Cost, Reason, RepairOutcome, RepairVerdict
from octoform.daemon.main import _log_entries
from octoform.daemon.model import Cause, Facts, Finding, Repair
from octoform.daemon.repair.playbook import PLAYBOOK, RepairKind
from octoform.daemon.store import incidents, instance_lock
from octoform.daemon.store.incidents import Incident, Incidents
from octoform.manifest.model import Daemon

TOOL = "read_joints"
FILE = "state/bench/serve/server.py"
ERROR = {"tool": TOOL, "device": None, "class": "broken_tool", "message": "m", "severity": "recoverable"}
REPORT = {"status": "error", "summary": "s", "errors": [ERROR]}


@pytest.fixture
def world(tmp_path: Path) -> DaemonWorld:
    return DaemonWorld(tmp_path)


def kept(world: DaemonWorld) -> Incident:
    """The only incident, as the disk has it."""
    (found,) = incidents.read(world.memory.shelf)
    return found


def summed(episode: Incident) -> list[tuple[str, str, list[str]]]:
    return [(each.repair, str(each.verdict), [reason.rule for reason in each.reasons]) for each in episode.outcomes]


PRECONDITIONS: dict[str, tuple[dict[str, Any], set[Repair]]] = {
    "loop.paused": ({"paused": True}, set(PLAYBOOK)),
    "loop.busy": ({"busy": "apply"}, set(PLAYBOOK)),
    "loop.stopped": ({"stopped_by": "alice"}, set(PLAYBOOK) - {Repair.ROTATE, Repair.REBIND}),
    "loop.estop": ({"latched": True}, {Repair.HEAL, Repair.REDISCOVER}),
}


@pytest.mark.parametrize("rule", PRECONDITIONS)
def test_each_precondition_speaks_against_the_repairs_that_it_is_about(rule: str) -> None:
    given, expected = PRECONDITIONS[rule]
    facts = replace(Facts(1.0, "", "bench"), **{name: value for name, value in given.items() if name != "paused"})

    def reasons(kind: RepairKind) -> list[str]:
        return [each.rule for each in kind.preconditions(facts, paused="paused" in given, ours=False)]

    assert {name for name, kind in PLAYBOOK.items() if reasons(kind) == [rule]} == expected
    assert all(reasons(kind) == [] for name, kind in PLAYBOOK.items() if name not in expected)
    assert not list(PLAYBOOK[Repair.RESTORE].preconditions(replace(facts, busy="heal"), paused=False, ours=True)) or (
        rule in ("loop.paused", "loop.stopped")
    )


def test_a_refusal_is_kept_once_with_its_incident_and_stands_in_the_log(world: DaemonWorld) -> None:
    world.start()
    instance_lock.pause(world.layout, world.stamp())
    world.die()
    world.happens(Cause.PROCESS)
    world.advance(1000)
    assert summed(kept(world)) == [("restart", "refused", ["loop.paused"])]
    instance_lock.resume(world.layout)
    world.happens(Cause.FILES)
    assert summed(kept(world)) == [("restart", "refused", ["loop.paused"]), ("restart", "done", ["repair.made"])]
    first, second = kept(world).outcomes
    assert (first.begun, second.begun, first.at < second.at) == (False, True, True)
    lines = [line for made in world.rounds for line in _log_entries(made)]
    (refused,) = (line for line in lines if line["event"] == "repair_refused")
    assert (refused["repair"], refused["verdict"], refused["rules"]) == ("restart", "refused", ["loop.paused"])
    assert refused["detail"] == "paused by a person"
    (ended,) = (line for line in lines if line["event"] == "repair_end")
    assert (ended["verdict"], ended["ok"], ended["detail"]) == ("done", True, "started")


def test_each_decision_against_a_repair_has_its_rule(tmp_path: Path) -> None:
    world = DaemonWorld(tmp_path, Daemon(calls_per_hour=1))
    world.mends[Repair.WATCH] = lambda world, finding: failed("no report", cost=Cost(1, 1, 1, 0.0))
    world.start()
    for tool in ("a", "b"):
        world.fail(tool)
    world.happens(Cause.LOG)
    world.advance(7200)
    world.truth.damaged[FILE] = "changed"
    world.mends[Repair.RESTORE] = lambda world, finding: failed("it was edited and stays", again=False)
    world.happens(Cause.FILES)
    found = {
        each.target: [rule for _, _, rules in summed(each) for rule in rules]
        for each in incidents.read(world.memory.shelf)
    }
    assert "loop.lane" in found["tool:b"] and "loop.agent-calls" in found["tool:b"]
    assert found[f"file:{FILE}"] == ["repair.not-made", "loop.given-up"]


def test_success_that_facts_contradict_has_failed_and_keeps_its_own_word(world: DaemonWorld) -> None:
    world.mends[Repair.RESTORE] = lambda world, finding: worked("put back")
    world.start()
    world.truth.damaged[FILE] = "changed"
    world.happens(Cause.FILES)
    world.advance(300)
    tries = kept(world).tries
    assert {(each.verdict, each.ok, each.detail) for each in tries} == {(RepairVerdict.FAILED, True, "put back")}
    assert [each.reasons[-1] for each in tries] == [Reason("check.still-there", "the problem is still there")] * 2


def test_what_heal_made_worse_is_rolled_back_with_both_reasons(world: DaemonWorld) -> None:
    def heals(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        world.truth.sensors[("status", "/volts")] = None
        return worked("rewritten", cost=Cost(1), report={"claims": [], "action": "rewrite"}, changed=True)

    def back(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        world.truth.sensors[("status", "/volts")] = 7.4
        return worked("the former server is the accepted one again", changed=True)

    world.mends |= {
        Repair.WATCH: lambda world, finding: worked("a report", cost=Cost(1), report=REPORT),
        Repair.HEAL: heals,
        Repair.ROLL_BACK: back,
    }
    world.truth.sensors[("status", "/volts")] = 7.4
    world.start()
    world.advance(301)
    world.fail(TOOL)
    world.happens(Cause.LOG)
    world.advance(400)
    assert world.repairs() == [Repair.WATCH, Repair.HEAL, Repair.ROLL_BACK]
    heal = next(each for each in kept_of(world, f"tool:{TOOL}").tries if each.repair == "heal")
    assert (heal.verdict, heal.ok) == (RepairVerdict.ROLLED_BACK, True)
    assert [each.rule for each in heal.reasons] == ["repair.made", "check.worse", "check.rolled-back"]
    assert "status/volts" in heal.reasons[1].text


def kept_of(world: DaemonWorld, target: str) -> Incident:
    return next(each for each in incidents.read(world.memory.shelf) if each.target == target)


def test_an_outcome_crosses_processes_and_records_as_it_is() -> None:
    made = RepairOutcome.failed("rebuild.altered", "files differ", cost=Cost(1, 2, 3, None), changed=True, again=False)
    made = replace(made.because("check.still-there", "it is"), repair="rebuild", at="2026", seconds=1.5)
    assert RepairOutcome.from_json(json.loads(json.dumps(made.to_json()))) == made
    asked = RepairOutcome.refused("rediscover.asks", "shall it be?", asked=True, cost=None)
    assert RepairOutcome.from_json(json.loads(json.dumps(asked.to_json()))) == asked
    heard = RepairOutcome.done("watch.report", "s", report={"status": "ok"})
    assert RepairOutcome.from_json(json.loads(json.dumps(heard.to_json()))) == heard


def test_a_refusal_after_another_try_is_another_one(world: DaemonWorld) -> None:
    world.mends[Repair.RESTORE] = lambda world, finding: failed("the disk does not answer")
    world.start()
    for _ in range(2):
        instance_lock.pause(world.layout, world.stamp())
        world.truth.damaged[FILE] = "changed"
        world.happens(Cause.FILES)
        world.advance(20)
        world.happens(Cause.FILES)
        instance_lock.resume(world.layout)
        world.happens(Cause.FILES)
    refused, tried = ("restore", "refused", ["loop.paused"]), ("restore", "failed", ["repair.not-made"])
    assert summed(kept(world))[:4] == [refused, tried, refused, tried]


def test_refusals_take_no_place_of_tries(world: DaemonWorld) -> None:
    world.start()
    world.die()
    instance_lock.pause(world.layout, world.stamp())
    world.happens(Cause.PROCESS)
    (episode,) = world.memory.episodes.open.values()
    known = Incidents(world.memory.shelf, BOOT)
    known.load()
    for number in range(120):
        known.refused(episode, RepairOutcome.refused(f"loop.r{number}", "no", repair="restart"))
        known.tried(episode, RepairOutcome.failed("restart.start", str(number), repair="restart", seconds=0.1))
    assert [each.detail for each in episode.tries] == [str(number) for number in range(70, 120)]
    assert len(episode.outcomes) == 100
