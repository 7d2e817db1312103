"""The caps of an hour hold for whatever asks agents: a re-discovery gets what is left and counts first."""

from pathlib import Path
from typing import Any

import pytest
from daemon_world import DaemonWorld, failed, worked

from octoform.apply.repair_outcome import Cost, RepairOutcome
from octoform.daemon.model import Cause, Finding, Repair
from octoform.daemon.repair.playbook import PLAYBOOK
from octoform.manifest.model import Daemon


@pytest.fixture
def world(tmp_path: Path) -> DaemonWorld:
    return DaemonWorld(tmp_path, Daemon(calls_per_hour=6, usd_per_hour=2.0))


def plugged(world: DaemonWorld, number: int) -> None:
    world.truth.appeared = (f"usb:1f00:{number:04x}",)
    world.happens(Cause.HARDWARE)


def test_a_rediscovery_is_told_what_the_hour_has_left_and_what_it_took_is_counted(world: DaemonWorld) -> None:
    given: list[tuple[Any, Any]] = []

    def onboards(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        given.append((finding.data["brief"]["calls"], finding.data["brief"]["usd"]))
        world.truth.appeared = ()
        return worked("onboarded", cost=Cost(4, 10, 10, 0.5))

    world.mends[Repair.REDISCOVER] = onboards
    world.start()
    plugged(world, 1)
    world.advance(200)
    plugged(world, 2)
    assert given == [(6, 2.0), (2, 1.5)]
    world.advance(200)
    plugged(world, 3)
    assert len(given) == 2 and "the hour's agent calls are spent" in world.rounds[-1].waits.values()
    world.advance(3600)
    assert given[2:] == [(2, 1.5)], "the second is younger than an hour still"


@pytest.mark.parametrize("repair", [Repair.REDISCOVER, Repair.HEAL])
def test_one_that_ends_without_a_word_may_have_used_all_that_it_was_given(world: DaemonWorld, repair: Repair) -> None:
    """HEAL may go on to a re-discovery, so it may use as much."""

    def killed(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        return failed("the child ended without a result", cost=None)

    def named(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        error = {"tool": "x", "device": None, "class": "broken_tool", "message": "m", "severity": "recoverable"}
        return RepairOutcome.done(
            "test", "a report", cost=Cost(1, 1, 1, 0.0), report={"status": "error", "errors": [error]}
        )

    world.mends |= {repair: killed, Repair.WATCH: named}
    world.start()
    if repair is Repair.HEAL:
        world.fail("x")
        world.happens(Cause.LOG)
    else:
        plugged(world, 1)
    world.advance(1200)
    assert world.repairs().count(repair) == 1
    assert world.memory.purse.left(world.now, world.stamp()) == 0


@pytest.mark.parametrize(
    ("repair", "report", "expected"),
    [
        (Repair.REDISCOVER, None, True),
        (Repair.HEAL, {"action": "rediscover"}, True),
        (Repair.HEAL, {"action": "rewrite"}, False),
        (Repair.HEAL, None, False),
        (Repair.RESTART, {"action": "rediscover"}, False),
    ],
)
def test_a_try_counts_as_a_rediscovery_by_its_repair_or_what_heal_asks_for(
    repair: Repair, report: dict[str, str] | None, expected: bool
) -> None:
    assert PLAYBOOK[repair].rediscovers(worked("done", report=report)) is expected
