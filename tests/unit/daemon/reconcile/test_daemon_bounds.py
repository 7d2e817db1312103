"""Enough is enough: other words are no new tries for ever, and what can never help is not tried again."""

from pathlib import Path

import pytest
from daemon_world import DaemonWorld, failed, worked

from octoform.apply.repair_outcome import Cost, RepairOutcome
from octoform.daemon.model import Alert, Cause, Finding, Outcome, Repair
from octoform.daemon.store import instance_lock
from octoform.manifest.model import Daemon

WORDS = (
    "aleph",
    "beth",
    "gimel",
    "daleth",
    "he",
    "waw",
    "zayin",
    "heth",
    "teth",
    "yodh",
    "kaph",
    "lamedh",
    "mem",
    "nun",
)


@pytest.fixture
def world(tmp_path: Path) -> DaemonWorld:
    return DaemonWorld(tmp_path, Daemon(calls_per_hour=1000))


def refused(world: DaemonWorld, finding: Finding) -> RepairOutcome:
    return failed("no report", cost=Cost(1, 1, 1, 0.0))


def said_anew(world: DaemonWorld, number: int) -> None:
    world.fail("read_joints", "ValueError", f"it says {WORDS[number % len(WORDS)]} {'x' * (number // len(WORDS))}")
    world.fail("read_joints", "ValueError", f"it says {WORDS[number % len(WORDS)]} {'x' * (number // len(WORDS))}")
    world.happens(Cause.LOG)


def events(alerts: list[Alert]) -> list[str]:
    return [each.event for each in alerts]


def test_words_that_change_each_time_have_nine_tries_in_an_hour_and_then_a_person(world: DaemonWorld) -> None:
    world.mends[Repair.WATCH] = refused
    world.start()
    for number in range(40):
        said_anew(world, number)
        world.now += 30
    assert world.repairs() == [Repair.WATCH] * 9
    (episode,) = world.memory.episodes.open.values()
    assert (episode.outcome, episode.target) == (Outcome.FROZEN, "tool:read_joints")
    assert "9 tries in an hour" in world.alerts[-1].summary + world.alerts[-1].hint
    assert events(world.alerts).count("frozen") == 1, "what it says after that is the same trouble"
    assert events(world.alerts)[-1] == "frozen"


def test_the_bound_survives_restarts_and_a_reboot_and_a_person_lifts_it(world: DaemonWorld) -> None:
    world.mends[Repair.WATCH] = refused
    world.start()
    for number in range(14):
        said_anew(world, number)
        world.begun()
        world.now += 30
    assert len(world.made) == 9
    world.reboot()
    world.truth.pid = 7
    world.start()
    for number in range(14, 20):
        said_anew(world, number)
    assert len(world.made) == 9
    assert instance_lock.ask(world.layout, ["tool:read_joints"]) is None
    world.happens(Cause.ASKED)
    assert len(world.made) == 10


def test_tries_of_more_than_an_hour_ago_and_of_other_targets_do_not_count(world: DaemonWorld) -> None:
    world.mends[Repair.WATCH] = refused
    world.start()
    for number in range(20):
        said_anew(world, number)
        world.truth.worked.append("read_joints")
        world.happens(Cause.LOG)
        world.now += 460
    assert len(world.made) == 20, "eight an hour"
    for tool in ("a", "b", "c"):
        world.fail(tool)
        world.happens(Cause.LOG)
    assert len(world.made) == 23


def test_what_can_never_help_is_not_tried_again_wherever_it_stands_in_the_chain(world: DaemonWorld) -> None:
    world.mends[Repair.RESTART] = lambda world, finding: RepairOutcome.failed(
        "test", "it cannot be started", again=False
    )
    world.mends[Repair.REBUILD] = lambda world, finding: failed("not yet")
    world.start()
    world.die()
    world.happens(Cause.PROCESS)
    assert world.repairs() == [Repair.RESTART, Repair.REBUILD], "and the next one is tried at once"
    world.begun()
    world.start()
    world.advance(2000)
    assert world.repairs() == [Repair.RESTART, Repair.REBUILD, Repair.REBUILD]


def asks(world: DaemonWorld, finding: Finding) -> RepairOutcome:
    return failed("shall it be onboarded?", again=False, asked=True)


def onboards(world: DaemonWorld, finding: Finding) -> RepairOutcome:
    world.truth.appeared = ()
    return worked("onboarded")


@pytest.mark.parametrize(
    ("before", "after", "goes_on"),
    [
        (Daemon(apply="ask"), Daemon(apply="auto"), True),
        (Daemon(calls_per_hour=2), Daemon(calls_per_hour=20), True),
        (Daemon(apply="ask"), Daemon(apply="ask", interval=60), False),
        (Daemon(apply="auto"), Daemon(apply="auto", interval=60), False),
        (Daemon(apply="auto"), Daemon(apply="ask"), False),
    ],
)
def test_a_question_that_the_manifest_answers_goes_on(
    tmp_path: Path, before: Daemon, after: Daemon, goes_on: bool
) -> None:
    world = DaemonWorld(tmp_path, before)
    world.mends[Repair.REDISCOVER] = asks
    world.start()
    world.truth.appeared = ("usb:1f00:00a1",)
    world.happens(Cause.HARDWARE)
    world.advance(100)
    (episode,) = world.memory.episodes.open.values()
    assert episode.outcome is Outcome.FROZEN
    world.settings = after  # octopus.yaml was edited: the daemon begins anew with it
    world.begun()
    world.mends[Repair.REDISCOVER] = onboards
    world.start()
    world.advance(100)
    assert len(world.made) == 1 + goes_on
    assert (world.memory.episodes.open == {}) is goes_on
    assert [made.id for each in world.rounds for made in each.opened] == [episode.id], "it is the same episode"


def test_a_question_of_an_hour_that_had_too_little_left_goes_on_with_a_whole_one(tmp_path: Path) -> None:
    world = DaemonWorld(tmp_path, Daemon(calls_per_hour=6, interval=60))
    assert world.memory.purse.begin(world.uptime(), world.stamp(), 2) is not None
    world.mends[Repair.REDISCOVER] = asks
    world.start()
    world.truth.appeared = ("usb:1f00:00a1",)
    world.happens(Cause.HARDWARE)
    world.advance(3000)
    assert len(world.made) == 1
    world.advance(1000)
    assert len(world.made) == 2, "once more, and then a person is needed"
    world.advance(20_000)
    assert len(world.made) == 2


def test_a_heal_that_asked_for_it_goes_on_as_well(tmp_path: Path) -> None:
    def heals(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        return failed("shall it be?", again=False, cost=Cost(1), report={"action": "rediscover"})

    world = DaemonWorld(tmp_path, Daemon(apply="ask", calls_per_hour=100))
    error = {"tool": "x", "device": None, "class": "broken_tool", "message": "m", "severity": "recoverable"}
    report = {"status": "error", "errors": [error]}
    world.mends[Repair.WATCH] = lambda world, finding: RepairOutcome.done(
        "test", "a report", cost=Cost(1), report=report
    )
    world.mends[Repair.HEAL] = heals
    world.start()
    world.fail("x")
    world.happens(Cause.LOG)
    world.advance(1000)
    assert world.repairs() == [Repair.WATCH, Repair.HEAL]
    world.supervisor._trying.apply = "auto"  # the same daemon, so that what WATCH said still holds
    world.advance(1000)
    assert world.repairs() == [Repair.WATCH, Repair.HEAL, Repair.HEAL]


def test_one_more_try_is_made_of_what_was_found_out_as_well(world: DaemonWorld) -> None:
    """WATCH's diagnosis has tries of its own; a person's `retry` means those too."""
    error = {"tool": None, "device": "arm", "class": "dependency", "message": "m", "severity": "recoverable"}
    report = {"status": "error", "errors": [error]}
    world.mends[Repair.WATCH] = lambda world, finding: RepairOutcome.done(
        "test", "a report", cost=Cost(1), report=report
    )
    world.mends[Repair.REBUILD] = world.mends[Repair.HEAL] = refused
    world.start()
    world.fail("x")
    world.happens(Cause.LOG)
    world.advance(2000)
    before = len(world.made)
    assert instance_lock.ask(world.layout, ["tool:x"]) is None
    world.happens(Cause.ASKED)
    world.advance(10)
    assert world.repairs()[before : before + 2] == [Repair.WATCH, Repair.REBUILD]
