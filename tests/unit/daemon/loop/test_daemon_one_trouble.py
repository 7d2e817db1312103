"""One cause is one trouble: a tool that fails is not also a unit that is silent."""

from collections.abc import Iterable
from pathlib import Path

import pytest
from daemon_world import INTERVAL, DaemonWorld

from octoform.claims.model import Channel, Reading, Signal
from octoform.daemon.model import Cause, Facts, Status

SOURCES = ("read_joints",)


class Failing(DaemonWorld):
    """A reading tool that fails each time the daemon calls it, and says so in the log as the gate does."""

    error = "NameError"
    broken = True
    sources = SOURCES

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
    """Else the unit is told before its tool, and both are."""
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
