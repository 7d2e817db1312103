"""A problem that gave up blocks no other repair."""

from dataclasses import replace
from pathlib import Path

import pytest
from daemon_world import DaemonWorld, failed

from octoform.apply.repair_outcome import RepairOutcome
from octoform.daemon.model import Cause, Facts, Finding, Repair
from octoform.engine.apply import approval
from octoform.engine.apply.approval import Question


@pytest.fixture
def world(tmp_path: Path) -> DaemonWorld:
    return DaemonWorld(tmp_path)


def test_a_process_that_dies_beside_an_edited_file_is_started_with_it(world: DaemonWorld) -> None:
    world.mends[Repair.RESTORE] = lambda world, finding: RepairOutcome.failed(
        "test", "it was edited and stays", again=False
    )
    world.truth.damaged = {"state/bench/serve/server.py": "changed"}
    world.start()
    world.advance(60)
    assert [each.target for each in world.memory.breakers.frozen()] == ["file:state/bench/serve/server.py"]
    assert world.repairs() == [Repair.RESTORE], "an edit is a person's: one try tells that"
    world.die()
    world.happens(Cause.PROCESS)
    assert world.repairs() == [Repair.RESTORE, Repair.RESTART]
    assert world.truth.pid is not None


def test_a_start_still_waits_for_a_file_that_is_being_put_back(world: DaemonWorld) -> None:
    world.mends[Repair.RESTORE] = lambda world, finding: failed("the disk does not answer")
    world.start()
    world.truth.damaged = {"state/bench/serve/server.py": "missing"}
    world.die()
    world.happens(Cause.PROCESS, Cause.FILES)
    assert world.repairs() == [Repair.RESTORE]


def test_a_question_is_told_once_and_taken_back_when_the_hardware_is_as_it_was(world: DaemonWorld) -> None:
    def asks(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        fresh, problem = approval.ask(world.layout, Question(("create class:hwmon",), ("probe",), ("it moves",)))
        assert problem is None
        return failed("shall it be onboarded?", again=False, asked=fresh)

    world.mends[Repair.REDISCOVER] = asks
    world.start()
    world.truth.appeared = ("usb:1f00:00a1",)
    world.happens(Cause.HARDWARE)
    world.advance(120)
    assert approval.read(world.layout) is not None
    assert [(each.summary, each.hint) for each in world.alerts if each.event == "asks"] == [
        ("shall it be onboarded?", "octoform apply")
    ]
    world.truth.appeared = ()
    world.happens(Cause.HARDWARE)
    assert approval.read(world.layout) is None


OTHER = "server.py is not the one that the endpoint was made for"


def test_an_adopted_edit_of_the_server_is_told_once_and_never_republished(
    world: DaemonWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    look, adopted = world.look, [True]

    def looks(causes: frozenset[Cause]) -> Facts:
        return replace(look(causes), endpoint=(OTHER,) if adopted else ())

    monkeypatch.setattr(world, "look", looks)
    world.begun()
    world.start()
    world.happens(Cause.FILES)
    world.advance(3600)
    assert world.repairs() == []
    assert [(each.event, each.target) for each in world.alerts] == [
        ("opened", "file:state/bench/serve/server.py"),
        ("surfaced", "file:state/bench/serve/server.py"),
    ]
    assert "octoform apply" in world.alerts[-1].hint
    adopted.clear()
    world.happens(Cause.FILES)
    assert world.memory.episodes.open == {}


def test_an_edit_that_nobody_adopted_is_told_by_its_file_alone(
    world: DaemonWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    look = world.look
    monkeypatch.setattr(world, "look", lambda causes: replace(look(causes), endpoint=(OTHER,)))
    world.mends[Repair.RESTORE] = lambda world, finding: RepairOutcome.failed(
        "test", "it was edited and stays", again=False
    )
    world.truth.damaged = {"state/bench/serve/server.py": "changed"}
    world.begun()
    world.start()
    world.advance(600)
    assert world.repairs() == [Repair.RESTORE]
