"""One cause is one trouble: a tool that fails is not also a unit that is silent."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest
from daemon_world import INTERVAL, DaemonWorld, failed, first, worked

from octoform.apply.repair_outcome import RepairOutcome
from octoform.base.health_status import Status
from octoform.claims.model import Channel, Reading, Signal
from octoform.daemon.model import Cause, Facts, Finding, LastSeen, Repair
from octoform.daemon.reconcile.bench import AtOnce, Ended

SOURCES = ("read_joints",)


class Failing(DaemonWorld):
    """A reading tool that fails each time the daemon calls it, and is logged as by the gate."""

    error = "NameError"
    broken = True
    sources: tuple[str, ...] = SOURCES

    def promised(self) -> frozenset[Signal]:
        return frozenset(Signal(Channel.SENSOR, source, "") for source in self.sources)

    def sample(self) -> Iterable[Reading]:
        made = []
        for number, source in enumerate(self.sources):
            if self.broken and number == 0:
                self.fail("read_joints", self.error, "it broke")
                made.append(self.ledger.make(Signal(Channel.SENSOR, source, ""), None, "it broke"))
            else:
                self.truth.worked.append("read_joints")
                made.append(self.ledger.make(Signal(Channel.SENSOR, source, "/heat"), 31))
        return made


@pytest.fixture
def world(tmp_path: Path) -> Failing:
    return Failing(tmp_path)


def opened(world: DaemonWorld) -> list[tuple[str, str]]:
    return [(alert.event, alert.target) for alert in world.alerts]


def status(world: DaemonWorld) -> Status:
    health = world.rounds[-1].health
    assert health is not None
    return health.status


@pytest.mark.parametrize("error", ["NameError", "OSError"])
def test_a_tool_that_fails_is_one_episode_and_one_message(world: Failing, error: str) -> None:
    world.error = error
    world.mends = {}
    world.start()
    assert status(world) is not Status.HEALTHY
    world.advance(2 * INTERVAL)
    targets = {item.target for made in world.rounds for item in made.opened}
    assert targets == {"tool:read_joints"}
    assert opened(world) == [("opened", "tool:read_joints"), ("frozen", "tool:read_joints")]
    assert status(world) is not Status.HEALTHY


def test_what_fails_once_is_unknown_and_no_trouble_of_its_own(world: Failing) -> None:
    world.error = "OSError"
    world.start()
    assert status(world) is Status.UNKNOWN and world.memory.episodes.open == {}
    world.broken = False
    world.advance(INTERVAL + 1)
    assert status(world) is Status.HEALTHY and world.alerts == []


def test_one_of_several_devices_that_cannot_be_read_is_a_trouble_of_its_own(world: Failing) -> None:
    world.error = "OSError"
    world.sources = ("read_joints(left)", "read_joints(right)")
    world.start()
    assert opened(world) == [("opened", "unit:read_joints(left)")]


def test_the_log_is_read_with_the_readings(world: Failing, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the unit is reported before its tool, and both are."""
    looks: list[frozenset[Cause]] = []

    def look(causes: frozenset[Cause]) -> Facts:
        looks.append(causes)
        return DaemonWorld.look(world, causes)

    monkeypatch.setattr(world, "look", look)
    world.mends = {}
    world.begun()
    world.happens(Cause.INTERVAL)
    assert Cause.LOG in looks[1]


def test_a_unit_that_is_silent_by_itself_is_told(world: Failing) -> None:
    skipped = Signal(Channel.SENSOR, "read_joints", "/joints/elbow/skipped")
    world.broken = False
    world.start()
    world.ledger.record([world.ledger.make(skipped, "its owner disabled it")])
    world.happens(Cause.LOG)
    assert opened(world) == [("opened", "unit:read_joints/joints/elbow")]
    world.broken = True
    world.advance(INTERVAL + 1)
    assert [each for each in opened(world) if each[0] == "cleared"] == [], "its owner has not enabled it since"


HERE, THERE = LastSeen(True, "1-1", None, "1-1"), LastSeen(True, "1-2", None, "1-1")


def rebound(world: DaemonWorld, finding: Finding) -> RepairOutcome:
    world.truth.devices = {"cam": replace(world.truth.devices["cam"], recorded=world.truth.devices["cam"].place)}
    return worked("written down")


@pytest.fixture
def plugged(tmp_path: Path) -> DaemonWorld:
    found = DaemonWorld(tmp_path)
    found.mends[Repair.REBIND] = rebound
    found.truth.devices = {"cam": HERE}
    found.start()
    return found


def seen(world: DaemonWorld, sighting: LastSeen) -> None:
    world.truth.devices = {"cam": sighting}
    world.happens(Cause.HARDWARE)
    world.advance(60)


@pytest.mark.parametrize(("back", "end"), [(THERE, "repaired"), (HERE, "cleared")])
def test_one_replug_is_one_trouble_and_two_messages(plugged: DaemonWorld, back: LastSeen, end: str) -> None:
    seen(plugged, LastSeen(False, None, None, "1-1"))
    seen(plugged, back)
    assert opened(plugged) == [("opened", "device:cam"), (end, "device:cam")]
    assert len({item.id for made in plugged.rounds for item in (*made.opened, *made.ended)}) == 1
    assert plugged.memory.episodes.open == {}


def test_a_device_that_is_only_in_another_place_is_one_message(plugged: DaemonWorld) -> None:
    seen(plugged, THERE)
    assert opened(plugged) == [("repaired", "device:cam")]


def test_a_place_that_cannot_be_written_down_is_told(plugged: DaemonWorld) -> None:
    plugged.mends[Repair.REBIND] = lambda world, finding: failed("the disk is full")
    seen(plugged, LastSeen(False, None, None, "1-1"))
    seen(plugged, THERE)
    plugged.advance(3600)
    assert opened(plugged) == [("opened", "device:cam"), ("frozen", "device:cam")]


def test_a_replug_during_a_restart_of_the_daemon_is_the_same_trouble(plugged: DaemonWorld) -> None:
    seen(plugged, LastSeen(False, None, None, "1-1"))
    plugged.begun()
    plugged.truth.devices = {"cam": THERE}
    plugged.start()
    plugged.advance(60)
    assert opened(plugged) == [("opened", "device:cam"), ("repaired", "device:cam")]


class Slow(AtOnce):
    """A restart that others can watch: the process is gone, and the next one is not there yet."""

    held = True

    def ended(self) -> tuple[Ended, ...]:
        return () if self.held else super().ended()


def test_a_hang_that_is_ended_by_its_repair_is_one_trouble(tmp_path: Path) -> None:
    world = DaemonWorld(tmp_path)
    world.bench = bench = Slow(world.uptime)
    world.begun()
    bench.held = False
    world.start()
    bench.held = True
    world.truth.answers = False
    world.mends[Repair.RESTART] = first(DaemonWorld.die, worked("started"))
    world.happens(Cause.PING)
    world.happens(Cause.PROCESS)
    assert opened(world) == [("opened", "endpoint")]
    world.live()
    bench.held = False
    world.happens(Cause.PROCESS)
    assert opened(world) == [("opened", "endpoint"), ("repaired", "endpoint")]


def test_a_hang_whose_end_is_seen_later_is_one_trouble(tmp_path: Path) -> None:
    world = DaemonWorld(tmp_path)
    world.start()
    world.truth.answers = False
    world.mends[Repair.RESTART] = first(DaemonWorld.die, failed("no"))
    world.happens(Cause.PING)
    world.mends[Repair.RESTART] = first(DaemonWorld.live, worked("started"))
    world.advance(120)
    assert opened(world) == [("opened", "endpoint"), ("repaired", "endpoint")]
