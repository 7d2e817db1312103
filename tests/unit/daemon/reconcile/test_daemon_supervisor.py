"""The loop in virtual time: what is repaired, what is not, and what is given up."""

from pathlib import Path

import pytest
from daemon_world import DaemonWorld, failed, first, worked

from octoform.apply.repair_outcome import Cost, RepairOutcome
from octoform.base.health_status import Status
from octoform.daemon.model import Cause, Finding, LastSeen, Outcome, Repair
from octoform.daemon.store import instance_lock
from octoform.manifest.model import Daemon


@pytest.fixture
def world(tmp_path: Path) -> DaemonWorld:
    return DaemonWorld(tmp_path)


def outcomes(world: DaemonWorld) -> list[tuple[str, str]]:
    return [(item.target, item.outcome) for made in world.rounds for item in made.ended]


def test_a_quiet_night_costs_no_repair_and_no_agent(world: DaemonWorld) -> None:
    world.start()
    world.truth.sensors[("status", "/volts")] = 7.4
    world.advance(3 * 3600)
    assert world.made == []
    assert world.alerts == []
    assert world.rounds[-1].health is not None
    assert world.rounds[-1].health.status is Status.HEALTHY
    assert world.memory.purse.spent(world.now, world.stamp()) == Cost()


def test_a_dead_process_is_started_at_once_without_an_agent(world: DaemonWorld) -> None:
    world.start()
    world.at(10, world.die, Cause.PROCESS)
    rounds = world.advance(20)
    assert world.repairs() == [Repair.RESTART]
    assert outcomes(world) == [("endpoint", Outcome.REPAIRED)]
    episode = next(item for made in rounds for item in made.ended)
    assert episode.closed_uptime == episode.opened_uptime == 1010.0
    assert [alert.event for alert in world.alerts] == ["opened", "repaired"]


def test_a_repair_is_believed_for_the_facts_alone(world: DaemonWorld) -> None:
    world.mends[Repair.RESTART] = lambda world, finding: worked("I say that it runs")
    world.mends[Repair.REBUILD] = world.mends[Repair.RESTART]
    world.start()
    world.die()
    world.happens(Cause.PROCESS)
    world.advance(1000)
    assert world.repairs() == [Repair.RESTART, Repair.RESTART, Repair.REBUILD]
    (episode,) = world.memory.episodes.open.values()
    assert episode.outcome is Outcome.FROZEN
    assert [made.ok for made in episode.tries] == [True, True, True]
    assert world.alerts[-1].event == "frozen"
    assert "heal -retry endpoint" in world.alerts[-1].hint


def test_tries_come_later_and_later(world: DaemonWorld) -> None:
    world.mends[Repair.RESTART] = lambda world, finding: failed("no")
    world.mends[Repair.REBUILD] = world.mends[Repair.RESTART]
    world.start()
    world.die()
    world.happens(Cause.PROCESS)
    world.advance(4000)
    times = [at - 1000 for at, _, _ in world.made]
    assert times == [0, 5, 25]


def test_what_crashes_in_a_loop_backs_off_freezes_and_asks_no_agent(world: DaemonWorld) -> None:
    def crashing(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        world.live()
        world.at(1, world.die, Cause.PROCESS)
        return worked("started")

    world.mends[Repair.RESTART] = world.mends[Repair.REBUILD] = crashing
    world.start()
    world.at(1, world.die, Cause.PROCESS)
    world.advance(3 * 3600)
    assert len(world.made) <= 6
    assert not set(world.repairs()) & {Repair.WATCH, Repair.HEAL}
    times = [at for at, _, _ in world.made]
    assert times[-1] - times[0] < 600
    assert any(item.outcome is Outcome.FROZEN for item in world.memory.episodes.open.values())
    assert world.rounds[-1].health is not None
    assert world.rounds[-1].health.status is Status.DOWN


def test_deaths_far_from_each_other_are_each_repaired(world: DaemonWorld) -> None:
    world.start()
    world.every(120, world.die, Cause.PROCESS)
    world.advance(3600)
    assert world.repairs().count(Repair.RESTART) >= 18
    assert world.memory.breakers.of("endpoint").tries == 0


def test_freezes_survive_a_restart_and_a_reboot_and_are_thawed_by_a_person(world: DaemonWorld) -> None:
    world.mends[Repair.RESTORE] = lambda world, finding: failed("no copy")
    world.truth.damaged = {"state/bench/serve/server.py": "changed"}
    world.start()
    world.advance(600)
    made = len(world.made)
    world.begun()
    world.start()
    world.advance(600)
    world.reboot()
    world.truth.pid = 7
    world.start()
    world.advance(600)
    assert len(world.made) == made
    (episode,) = world.memory.episodes.open.values()
    assert episode.outcome is Outcome.FROZEN
    assert instance_lock.ask(world.layout, ["file:state/bench/serve/server.py"]) is None
    world.happens(Cause.ASKED)
    assert len(world.made) == made + 1


def test_a_try_is_counted_before_it_is_made(world: DaemonWorld) -> None:
    def killed(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        raise KeyboardInterrupt

    world.mends[Repair.RESTORE] = killed
    world.truth.damaged = {"state/bench/serve/server.py": "changed"}
    for _ in range(5):
        world.begun()
        try:
            world.start()
            world.advance(200)
        except KeyboardInterrupt:
            world.now += 200
    assert len(world.made) <= 3


@pytest.mark.parametrize("why", ["paused", "busy", "stopped"])
def test_what_must_not_be_done_now_is_done_later(world: DaemonWorld, why: str) -> None:
    world.start()
    world.truth.damaged = {"state/bench/serve/server.py": "changed"}
    if why == "paused":
        assert instance_lock.pause(world.layout, world.stamp()) is None
    world.truth.busy = "apply" if why == "busy" else None
    world.truth.stopped_by = "ada" if why == "stopped" else None
    world.happens(Cause.FILES)
    world.advance(900)
    assert world.made == []
    world.truth.busy = world.truth.stopped_by = None
    instance_lock.resume(world.layout)
    world.happens(Cause.ASKED)
    assert world.repairs() == [Repair.RESTORE]


def test_a_person_who_stopped_the_endpoint_is_obeyed(world: DaemonWorld) -> None:
    world.start()
    world.die()
    world.truth.stopped_by = "ada"
    world.happens(Cause.PROCESS, Cause.FILES)
    world.advance(3600)
    assert world.made == []
    assert world.memory.episodes.open == {}


def test_a_clock_that_is_set_back_and_a_sleep_of_eight_hours_do_no_harm(world: DaemonWorld) -> None:
    world.mends[Repair.RESTART] = lambda world, finding: failed("no")
    world.mends[Repair.REBUILD] = world.mends[Repair.RESTART]
    world.start()
    world.die()
    world.happens(Cause.PROCESS)
    world.set_wall(-3600)
    world.happens(Cause.RESUMED)
    world.advance(2)
    assert len(world.made) == 1
    before = len(world.rounds)
    world.suspend(8 * 3600)
    world.happens(Cause.RESUMED)
    world.advance(10)
    assert len(world.made) == 2
    assert len(world.rounds) - before < 10  # missed hours are not made up for
    world.mends[Repair.REBUILD] = first(DaemonWorld.live, worked("built"))
    world.advance(120)
    assert outcomes(world) == [("endpoint", Outcome.REPAIRED)]


def test_agents_are_capped_by_the_hour_over_restarts(tmp_path: Path) -> None:
    world = DaemonWorld(tmp_path, Daemon(calls_per_hour=2))
    world.mends[Repair.WATCH] = lambda world, finding: RepairOutcome.failed(
        "test", "no report", cost=Cost(1, 10, 10, 0.01)
    )
    world.start()
    for number in range(8):
        world.fail(f"tool_{number}")
        world.happens(Cause.LOG)
        world.begun()
    world.advance(600)
    assert world.repairs() == [Repair.WATCH, Repair.WATCH]
    world.advance(3600)
    assert len(world.made) == 4


def test_agents_are_capped_by_money(tmp_path: Path) -> None:
    world = DaemonWorld(tmp_path, Daemon(calls_per_hour=100, usd_per_hour=0.5))
    world.mends[Repair.WATCH] = lambda world, finding: RepairOutcome.failed(
        "test", "no report", cost=Cost(1, 10, 10, 0.3)
    )
    world.start()
    for number in range(5):
        world.fail(f"tool_{number}")
    world.happens(Cause.LOG)
    world.advance(60)
    assert world.repairs() == [Repair.WATCH, Repair.WATCH]


def test_nothing_is_over_because_nobody_could_look(world: DaemonWorld) -> None:
    world.mends[Repair.RESTORE] = lambda world, finding: failed("no copy")
    world.truth.damaged = {"state/bench/serve/server.py": "changed"}
    world.start()
    world.truth.busy = "apply"
    world.happens(Cause.FILES)
    world.advance(600)
    assert len(world.memory.episodes.open) == 1 and outcomes(world) == []
    world.truth.busy, world.truth.damaged = None, {}
    world.happens(Cause.FILES)
    assert outcomes(world) == [("file:state/bench/serve/server.py", Outcome.CLEARED)]


def test_a_device_that_is_gone_is_not_back_because_nobody_can_tell_and_says_what_told_of_it(world: DaemonWorld) -> None:
    world.start()
    world.truth.devices = {"usb-1": LastSeen(False, recorded="/sys/a")}
    world.happens(Cause.HARDWARE)
    (episode,) = world.memory.episodes.open.values()
    assert episode.causes == ("hardware",)
    world.truth.devices = {"usb-1": LastSeen(None, recorded="/sys/a")}
    world.happens(Cause.LOG)
    assert outcomes(world) == []
    world.truth.devices = {"usb-1": LastSeen(True, "/sys/a", recorded="/sys/a")}
    world.happens(Cause.HARDWARE)
    assert outcomes(world) == [("device:usb-1", Outcome.CLEARED)]


def test_a_host_whose_endpoint_was_destroyed_is_neither_repaired_nor_called_healthy(world: DaemonWorld) -> None:
    world.start()
    world.die()
    world.truth.applied, world.truth.destroyed = False, True
    made = world.happens(Cause.PROCESS, Cause.FILES)
    world.advance(600)
    assert world.made == []
    assert made.health is not None and made.health.status is Status.UNKNOWN
