"""Health from the first round on: what is promised to report and has not is unknown, whatever else is at work."""

from collections.abc import Iterable
from pathlib import Path

import pytest
from daemon_world import INTERVAL, DaemonWorld

from octoform.base.health_status import Status
from octoform.claims.model import Channel, Reading, Signal
from octoform.daemon import signals as expected_signals
from octoform.daemon.model import Cause
from octoform.daemon.reconcile.bench import AtOnce, Ended, Task, Work

VOLTS, HEAT = ("status", "/volts"), ("arm", "/heat")


class Later(AtOnce):
    """Work is reported as ended only once ``open`` is set."""

    open = False

    def ended(self) -> tuple[Ended, ...]:
        return super().ended() if self.open else ()

    def begin(self, task: Task, work: Work) -> None:
        super().begin(task, work)


def told(world: DaemonWorld) -> tuple[Status, int, tuple[str, ...]]:
    health = world.rounds[-1].health
    assert health is not None
    return health.status, health.covered, health.uncovered


@pytest.fixture
def world(tmp_path: Path) -> DaemonWorld:
    return DaemonWorld(tmp_path)


def test_a_daemon_just_started_knows_nothing_of_what_it_has_not_read(tmp_path: Path) -> None:
    world = DaemonWorld(tmp_path)
    world.bench = bench = Later(world.uptime)
    world.begun()
    world.truth.sensors = {VOLTS: 7.4, HEAT: 31}
    world.start()
    assert told(world) == (Status.UNKNOWN, 0, ("arm", "status"))
    bench.open = True
    world.happens(Cause.PING)
    assert told(world) == (Status.HEALTHY, 2, ())


def test_what_stops_being_read_is_unknown_again(world: DaemonWorld) -> None:
    world.truth.sensors = {VOLTS: 7.4}
    world.start()
    assert told(world)[0] is Status.HEALTHY
    world.truth.answers = False
    world.mends.clear()
    world.happens(Cause.PING)
    world.advance(4 * INTERVAL)
    world.truth.answers = True
    world.bench = Later(world.uptime)  # no one reads
    world.begun()
    world.start()
    assert told(world) == (Status.UNKNOWN, 0, ("status",))


def test_new_tools_and_a_new_process_are_read_without_waiting_for_the_interval(world: DaemonWorld) -> None:
    world.truth.sensors = {VOLTS: 7.4}
    world.start()
    world.truth.sensors[HEAT] = 31
    world.happens(Cause.FILES)
    assert told(world) == (Status.HEALTHY, 2, ())
    world.truth.sensors[VOLTS] = 6.0
    world.live()
    world.happens(Cause.PROCESS)
    assert {each.value for each in world.ledger.latest() if each.signal.path == "/volts"} == {6.0}


def test_readings_go_on_while_somebody_is_at_work_on_the_host(world: DaemonWorld) -> None:
    world.truth.sensors = {VOLTS: 7.4}
    world.start()
    world.truth.busy = "heal"
    world.advance(12 * INTERVAL)
    assert told(world) == (Status.HEALTHY, 1, ())
    assert max(each.uptime for each in world.ledger.latest() if each.signal.path == "/volts") >= world.now - INTERVAL


def test_a_sensor_that_never_answers_is_asked_at_the_interval_and_not_at_each_round(world: DaemonWorld) -> None:
    world.truth.sensors = {VOLTS: None}
    asked: list[float] = []
    sample = world.sample

    def sampled() -> Iterable[Reading]:
        asked.append(world.now)
        return sample()

    world.sample = sampled  # type: ignore[method-assign]
    world.begun()
    world.start()
    for _ in range(20):
        world.now += 1
        world.happens(Cause.LOG)
    assert asked == [1000.0] and told(world)[0] is Status.UNKNOWN


def test_a_promise_is_kept_by_any_reading_of_its_source_that_is_young_enough() -> None:
    def read(source: str, uptime: float, channel: Channel = Channel.SENSOR) -> Reading:
        return Reading("r", "", uptime, Signal(channel, source, "/x"), 1)

    promised = [Signal(Channel.SENSOR, "a", ""), Signal(Channel.SENSOR, "b", ""), Signal(Channel.FRAME, "", "")]
    assert expected_signals.unread(promised, [], 5.0) == [
        (source, "", "it has not been read yet") for source in ("a", "b", "frame")
    ]
    seen = [read("a", 4.0), read("b", 6.0), read("camera-1", 5.0, Channel.FRAME)]
    assert expected_signals.unread(promised, seen, 5.0) == [("a", "", "it was not read for a while")]
    assert expected_signals.unread(promised, [read("a", 9.0, Channel.LOG), *seen], 4.0) == []
