"""What gets lost between two looks: a manifest, a repair that ended meanwhile, the readings of a process that died."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from daemon_world import DaemonWorld, worked

from octoform.apply.repair_outcome import RepairOutcome
from octoform.daemon.model import Cause, Facts, Finding, Outcome, Repair
from octoform.daemon.reconcile.bench import Ended, Task, Work


@pytest.fixture
def world(tmp_path: Path) -> DaemonWorld:
    return DaemonWorld(tmp_path)


def outcomes(world: DaemonWorld) -> list[tuple[str, str]]:
    return [(item.target, item.outcome) for made in world.rounds for item in made.ended]


class Late:
    """Makes repairs on demand."""

    def __init__(self) -> None:
        self._begun: list[tuple[Task, Work]] = []
        self._ended: list[Ended] = []

    def begin(self, task: Task, work: Work) -> None:
        self._begun.append((task, work))

    def finish(self) -> None:
        """Carry out what was begun."""
        begun, self._begun = self._begun, []
        self._ended += [Ended(task, work(), 0.1) for task, work in begun]

    def under_way(self) -> tuple[Task, ...]:
        return tuple(task for task, _ in self._begun)

    def ended(self) -> tuple[Ended, ...]:
        found, self._ended = tuple(self._ended), []
        return found

    def waiting(self) -> bool:
        return bool(self._ended)


def test_an_endpoint_whose_manifest_is_lost_is_published_again(world: DaemonWorld) -> None:
    def republish(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        world.truth.applied = True
        return worked("put back manifest.json")

    world.mends[Repair.REPUBLISH] = republish
    world.start()
    world.truth.applied = False
    world.happens(Cause.FILES)
    assert world.repairs() == [Repair.REPUBLISH]
    assert outcomes(world) == [("endpoint:files", Outcome.REPAIRED)]


def test_a_repair_that_ends_while_somebody_looks_is_written_down(tmp_path: Path) -> None:
    """What a look sees may be newer than what the loop knows of its own repairs."""
    bench = Late()
    world = DaemonWorld(tmp_path, bench=bench)
    world.start()
    bench.finish()
    world.happens(Cause.PING)
    world.truth.damaged = {"state/bench/serve/server.py": "changed"}
    world.happens(Cause.FILES)
    assert [task.repair for task in bench.under_way()] == [Repair.RESTORE]
    look = world.look

    def slowly(causes: frozenset[Cause]) -> Facts:
        bench.finish()
        return look(causes)

    world.supervisor._ports = replace(world.supervisor._ports, look=slowly)
    world.happens(Cause.FILES)
    world.advance(1)
    (episode,) = (item for made in world.rounds for item in made.ended)
    assert (episode.outcome, [made.repair for made in episode.tries]) == (Outcome.REPAIRED, ["restore"])


def test_readings_are_taken_once_when_the_process_is_back(world: DaemonWorld) -> None:
    world.truth.sensors[("status", "/volts")] = 7.4
    world.start()
    world.happens(Cause.PING)
    taken: list[float] = []
    sample = world.sample
    ports = world.supervisor._ports

    def taking() -> Any:
        taken.append(world.now)
        return sample()

    world.supervisor._ports = replace(ports, sample=taking)
    world.at(10, world.die, Cause.PROCESS)
    world.advance(60)
    assert taken == [1010.0]
