"""How a host is: believed of a daemon that lives and is fresh, and looked at in every other case."""

import json
import os
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from cases import for_each
from daemon_world import DaemonWorld, failed, worked

import octoform
from octoform.apply.repair_outcome import RepairOutcome
from octoform.base.health_status import Status, basis
from octoform.daemon import requests
from octoform.daemon import status as daemon_status
from octoform.daemon.health import Health
from octoform.daemon.model import Cause, Finding, Repair
from octoform.daemon.observe.clock_jumps import SystemClock
from octoform.daemon.status import survey
from octoform.daemon.status_file import FRESH_SECONDS
from octoform.daemon.store import instance_lock, json_store
from octoform.diagnostics import Diagnostic, error
from octoform.state.layout import Layout


@pytest.fixture
def layout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Layout:
    """A host that nothing was ever applied to; its manifest is not compiled for every test."""
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\ndaemon: {interval: 5m}\n")
    found = Layout(tmp_path, "bench")
    monkeypatch.setattr(daemon_status, "layout_of", lambda *_: (found, []))
    return found


@pytest.fixture
def watched(layout: Layout) -> Iterator[Layout]:
    """A daemon lives: this process."""
    owned, problem = instance_lock.take(layout, "2026-11-22T03:00:00Z", SystemClock().uptime(), octoform.__version__)
    assert owned is not None, problem
    yield layout
    owned.release()


def wrote(layout: Layout, health: Health, **more: object) -> None:
    layout.daemon.mkdir(parents=True, exist_ok=True)
    until = health.uptime + 300 + FRESH_SECONDS
    beside = {"waits": {}, "basis": basis(None, stopped=False, engaged=False), "until": until}
    (layout.daemon / "health.json").write_text(json.dumps({**health.as_json(), **beside, **more}))


def health(age: float = 0.0, status: Status = Status.HEALTHY) -> Health:
    return Health("bench", "2026-11-22T03:00:00Z", SystemClock().uptime() - age, status, covered=5)


def test_a_host_before_its_first_apply_is_unknown_and_says_what_to_do(layout: Layout) -> None:
    found, problems = survey(layout.project, {})
    assert problems == []
    assert found is not None
    assert found.looked
    assert found.health.status is Status.UNKNOWN
    assert found.todo == (("octoform apply", "nothing is applied yet"),)
    assert not layout.local.exists(), "who asks changes nothing"


def test_a_living_daemon_is_believed(watched: Layout) -> None:
    wrote(watched, health(age=2.0))
    found, _ = survey(watched.project, {})
    assert found is not None
    assert (found.looked, found.health.covered, found.watched is not None) == (False, 5, True)
    assert 2.0 <= found.age < 10.0


def test_a_record_without_its_daemon_is_not_believed(layout: Layout) -> None:
    wrote(layout, health())
    found, _ = survey(layout.project, {})
    assert found is not None
    assert (found.looked, found.watched, found.health.status) == (True, None, Status.UNKNOWN)


@pytest.mark.parametrize(
    ("age", "is_believed"), [(FRESH_SECONDS + 1, True), (359.0, True), (300 + FRESH_SECONDS + 5, False), (-30.0, False)]
)
def test_health_is_believed_for_an_interval_and_a_little(watched: Layout, age: float, is_believed: bool) -> None:
    wrote(watched, health(age))
    found, _ = survey(watched.project, {})
    assert found is not None
    assert found.looked is not is_believed


CONTRADICTED = [
    {"basis": basis("another start", stopped=False, engaged=False)},
    {"basis": basis(None, stopped=True, engaged=False)},
    {"basis": basis(None, stopped=False, engaged=True)},
    {"basis": None},
    {"until": None},
    {"status": "splendid"},
]


@for_each("more", CONTRADICTED)
def test_health_that_is_contradicted_or_is_no_record_is_not_believed(watched: Layout, more: dict[str, Any]) -> None:
    wrote(watched, health(), **more)
    found, _ = survey(watched.project, {})
    assert found is not None
    assert found.looked


def test_a_daemon_that_can_write_nothing_down_is_not_believed(watched: Layout, monkeypatch: pytest.MonkeyPatch) -> None:
    wrote(watched, health())
    there = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: path != watched.daemon and there(path, mode))
    found, _ = survey(watched.project, {})
    assert found is not None and found.looked
    assert found.health.status is not Status.HEALTHY


def test_health_that_cannot_be_replaced_does_not_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    world = DaemonWorld(tmp_path)
    world.start()
    path = world.layout.daemon / "health.json"
    assert json.loads(path.read_bytes())["status"] == "healthy"
    refused = error("STATE-DISK-FULL", "cannot be written: No space left on device")
    with monkeypatch.context() as full:
        full.setattr(json_store, "write_atomic", lambda *_: refused)
        world.truth.busy = "apply"  # so that nothing is repaired meanwhile
        world.die()
        world.happens(Cause.PROCESS)
        assert not path.exists()
    world.happens(Cause.LOG)
    assert json.loads(path.read_bytes())["status"] == "down"


def test_health_that_somebody_deleted_is_written_in_the_next_round_although_nothing_changed(tmp_path: Path) -> None:
    world = DaemonWorld(tmp_path)
    world.start()
    path = world.layout.daemon / "health.json"
    path.unlink()
    world.happens(Cause.FILES)
    assert json.loads(path.read_bytes())["status"] == "healthy"


@pytest.mark.parametrize("text", ["", "{", "[]", "3", '{"format": 2}', '{"format": 1}', "[" * 9000])
def test_a_damaged_record_is_looked_past(watched: Layout, text: str) -> None:
    (watched.daemon / "health.json").write_text(text)
    found, _ = survey(watched.project, {})
    assert found is not None
    assert found.looked


def test_health_of_another_host_is_not_this_ones(watched: Layout) -> None:
    wrote(watched, replace(health(), host="other"))
    found, _ = survey(watched.project, {})
    assert found is not None
    assert found.looked


def given_up(world: DaemonWorld) -> None:
    """The endpoint dies, and no repair helps."""
    for repair in (Repair.RESTART, Repair.REBUILD):
        world.mends[repair] = lambda world, finding: failed("no such file")
    world.start()
    world.die()
    world.happens(Cause.PROCESS)
    world.advance(1000)


def test_what_was_given_up_tells_since_when_what_was_tried_and_the_command(tmp_path: Path, watched: Layout) -> None:
    world = DaemonWorld(tmp_path)
    given_up(world)
    key = next(iter(world.memory.episodes.open))
    wrote(watched, health(status=Status.DOWN), waits={key: "frozen"})
    found, _ = survey(watched.project, {})
    assert found is not None
    (trouble,) = found.problems
    assert (trouble.target, trouble.since) == ("endpoint", world.rounds[1].facts.stamp)
    assert trouble.episode is not None
    assert [made.repair for made in trouble.episode.tries] == ["restart", "restart", "rebuild"]
    assert trouble.waits == "given up: 3 tries did not help"
    assert trouble.do == "fix the cause, then: octoform heal -retry endpoint"


def test_what_a_person_holds_back_is_told_with_its_command(watched: Layout) -> None:
    watched.endpoint.mkdir(parents=True)
    watched.run.mkdir(parents=True)
    watched.stop_mark.write_text('{"by": "kim"}')
    (watched.run / "estop.json").write_text("{}")
    instance_lock.pause(watched, "2026-11-22T03:00:00Z")
    wrote(watched, replace(health(), pending=("c3",)), basis=basis(None, stopped=True, engaged=True))
    found, _ = survey(watched.project, {})
    assert found is not None
    assert [command for command, _ in found.todo] == [
        "octoform start",
        "octoform estop -clear",
        "octoform resume",
        "octoform confirm c3",
    ]
    assert found.paused == "2026-11-22T03:00:00Z"


def test_only_what_lasts_can_be_tried_again(tmp_path: Path, layout: Layout) -> None:
    world = DaemonWorld(tmp_path)
    given_up(world)
    known = requests.given_up(layout)
    assert [each.target for each in known.frozen] == ["endpoint"]
    _, problem = requests.retry(layout, known, "endpont")
    assert isinstance(problem, Diagnostic)
    assert (problem.code, problem.hint) == ("DAEMON-NO-SUCH-TROUBLE", "did you mean endpoint?")
    assert instance_lock.taken_up(layout) == ()
    assert requests.retry(layout, known, "endpoint") == (("endpoint",), None)
    assert requests.retry(layout, known, None) == ((), None)
    assert instance_lock.taken_up(layout) == ("endpoint",)
    assert requests.retry(layout, known, requests.ALL) == (("endpoint",), None)
    assert instance_lock.taken_up(layout) == ("*",)


def test_what_is_over_is_not_listed_as_given_up(tmp_path: Path, layout: Layout) -> None:
    world = DaemonWorld(tmp_path)
    given_up(world)
    world.live()
    world.happens(Cause.PROCESS)
    known = requests.given_up(layout)
    assert (known.frozen, known.targets) == ((), ())
    assert world.memory.breakers.frozen() != (), "it would go on where it was if it came back at once"
    assert json.loads(world.memory.shelf.path("health.json").read_bytes())["frozen"] == []


def test_a_trouble_is_listed_once_under_its_own_target_whatever_an_agent_made_of_it(
    tmp_path: Path, layout: Layout
) -> None:
    world = DaemonWorld(tmp_path)
    error = {"tool": None, "device": "arm", "class": "broken_tool", "message": "m", "severity": "recoverable"}
    report = {"status": "error", "summary": "s", "errors": [{**error, "suggested_fix": None, "cites": []}]}
    world.mends[Repair.WATCH] = lambda world, finding: worked("", report=report)
    world.start()
    world.fail("read_joints")
    world.happens(Cause.LOG)
    world.advance(3600)
    (listed,) = requests.given_up(layout).frozen
    assert (listed.target, bool(listed.since)) == ("tool:read_joints", True)
    requests.retry(layout, requests.given_up(layout), "tool:read_joints")
    made = len(world.made)
    world.happens(Cause.ASKED)
    assert len(world.made) > made


def test_what_a_person_lets_try_again_during_a_repair_leaves_no_entry_without_a_target(
    tmp_path: Path, layout: Layout
) -> None:
    world = DaemonWorld(tmp_path)

    def asks(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        world.supervisor._incidents.reopen("*")
        return failed("no", again=False)

    world.mends[Repair.RESTORE] = asks
    world.start()
    world.truth.damaged = {"state/bench/serve/server.py": "missing"}
    world.happens(Cause.FILES)
    assert all(each.target for each in world.memory.breakers.all())


def test_it_can_be_read_in_time(watched: Layout) -> None:
    """A person at night waits for it: the status of a fresh daemon takes no manifest and no look."""
    wrote(watched, health())
    began = time.process_time()
    survey(watched.project, {})
    assert time.process_time() - began < 0.2
