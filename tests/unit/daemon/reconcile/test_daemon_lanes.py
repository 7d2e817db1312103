"""Repairs beside the loop: a long one delays no check, one target has one repair, a bug ends nothing."""

import threading
from pathlib import Path

import pytest
from daemon_world import DaemonWorld, worked

from octoform.apply.repair_outcome import RepairOutcome
from octoform.daemon.model import Cause, Finding, Outcome, Repair
from octoform.daemon.reconcile.bench import Beside, Product, Task
from octoform.daemon.reconcile.supervisor import Cycle
from octoform.daemon.repair.playbook import Lane

SECONDS = 20.0


class Held:
    """A repair that goes on until the test lets it end."""

    def __init__(self) -> None:
        self.begun, self.release = threading.Event(), threading.Event()

    def __call__(self, world: DaemonWorld, finding: Finding) -> RepairOutcome:
        self.begun.set()
        assert self.release.wait(SECONDS)
        return worked("done at last")


class Beat:
    """A world whose repairs and readings are made in threads; `settle` waits for the end of a repair."""

    def __init__(self, folder: Path) -> None:
        self.ended = threading.Semaphore(0)
        self.bench = Beside(self.ended.release)
        self.world = DaemonWorld(folder, bench=self.bench)
        self.seen = 0
        self.world.start()
        self.next()  # the first readings

    def settle(self) -> None:
        """Wait until a repair has ended, and the loop knows of that and of the readings before it."""
        while not any(made.tried for made in self.world.rounds[self.seen :]):
            self.next()
        self.seen = len(self.world.rounds)

    def next(self) -> Cycle:
        """Wait until a work has ended, and let the loop know."""
        assert self.ended.acquire(timeout=SECONDS)
        return self.world.happens(Cause.PING)


@pytest.fixture
def beat(tmp_path: Path) -> Beat:
    return Beat(tmp_path)


def test_a_process_that_dies_during_a_long_repair_is_started_meanwhile(beat: Beat) -> None:
    world, discovery = beat.world, Held()
    world.mends[Repair.REDISCOVER] = discovery
    world.truth.appeared = ("usb:v1111p2222",)
    world.happens(Cause.HARDWARE)
    assert discovery.begun.wait(SECONDS)
    world.truth.busy = "apply"  # held by the child
    world.now += 60
    world.die()
    world.happens(Cause.PROCESS)
    assert Repair.RESTART not in world.repairs(), "it may be what the repair is just exchanging"
    world.now += 16
    world.happens(Cause.RETRY)
    beat.settle()
    assert world.repairs("endpoint") == [Repair.RESTART]
    assert world.truth.pid is not None
    assert [item.target for item in world.memory.episodes.open.values()] == ["hardware"]
    world.truth.busy, world.truth.appeared = None, ()
    discovery.release.set()
    beat.settle()
    assert world.memory.episodes.open == {}
    assert {item.outcome for made in world.rounds for item in made.ended} == {Outcome.REPAIRED}


def test_a_process_that_dies_while_an_agent_thinks_is_started_at_once(beat: Beat) -> None:
    world, watch = beat.world, Held()
    world.mends[Repair.WATCH] = watch
    world.fail("read_joints")
    world.happens(Cause.LOG)
    assert watch.begun.wait(SECONDS)
    world.die()
    world.happens(Cause.PROCESS)
    beat.settle()
    assert world.repairs() == [Repair.WATCH, Repair.RESTART]
    assert world.truth.pid is not None
    watch.release.set()
    beat.settle()


def test_one_target_has_one_repair_at_a_time_and_one_thing_is_exchanged_at_a_time(beat: Beat) -> None:
    world, restore = beat.world, Held()
    world.mends[Repair.RESTORE] = restore
    world.truth.damaged = {"state/bench/serve/server.py": "changed", "state/bench/probe/output.json": "missing"}
    world.happens(Cause.FILES)
    assert restore.begun.wait(SECONDS)
    for _ in range(5):
        world.now += 100
        world.happens(Cause.FILES)
    assert len(world.made) == 1
    world.truth.damaged = {}
    restore.release.set()
    beat.settle()
    assert world.memory.episodes.open == {}


def test_a_bug_in_a_repair_is_a_try_that_failed(beat: Beat, capfd: pytest.CaptureFixture[str]) -> None:
    world = beat.world

    def bug(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        raise ZeroDivisionError("a bug")

    world.mends[Repair.RESTORE] = bug
    world.truth.damaged = {"state/bench/serve/server.py": "changed"}
    world.happens(Cause.FILES)
    beat.settle()
    (episode,) = world.memory.episodes.open.values()
    assert [made.ok for made in episode.tries] == [False]
    assert "ZeroDivisionError: a bug" in episode.tries[0].detail
    assert "Traceback" in capfd.readouterr().err


def test_a_trouble_is_over_once_its_repair_has_come_to_its_end(beat: Beat) -> None:
    world, start = beat.world, Held()
    world.mends[Repair.RESTART] = start
    world.die()
    world.happens(Cause.PROCESS)
    assert start.begun.wait(SECONDS)
    world.live()
    world.happens(Cause.PING)
    assert len(world.memory.episodes.open) == 1
    start.release.set()
    beat.settle()
    (episode,) = [item for made in world.rounds for item in made.ended]
    assert (episode.outcome, len(episode.tries)) == (Outcome.REPAIRED, 1)


def test_a_repair_that_gets_no_thread_has_failed_and_is_no_longer_under_way(
    beat: Beat, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    task = Task(Lane.ROOM, None, None, "", None, 0.0)
    with monkeypatch.context() as patched:
        patched.setattr(threading.Thread, "start", refuse)
        beat.bench.begin(task, lambda: Product(None))
    assert task not in beat.bench.under_way()
    (ended,) = (item for item in beat.bench.ended() if item.task is task)
    assert ended.product.outcome is not None
    assert ended.product.outcome.detail == "no more processes or threads can be started"
