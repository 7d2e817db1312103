"""One incident on a terminal and as JSON: what was noticed, each repair with its reasons, what is left to do."""

import io
import json
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from daemon_world import DaemonWorld, failed, worked
from zones import in_zone

from octoform.apply.repair_outcome import WAITS, Cost, Reason, RepairOutcome, RepairVerdict
from octoform.cli.dispatch import dispatch
from octoform.daemon.model import Cause, Finding, LastSeen, Repair
from octoform.daemon.status import incident
from octoform.daemon.store import instance_lock
from octoform.views.daemon import health
from octoform.views.format.console import Console

DOCS = Path(__file__).parents[3] / "docs" / "daemon.md"
TOOL = "read_joints"


@pytest.fixture(autouse=True)
def utc() -> Iterator[None]:
    with in_zone("UTC"):
        yield


@pytest.fixture
def world(tmp_path: Path) -> DaemonWorld:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\n")
    return DaemonWorld(tmp_path)


def shown(world: DaemonWorld, name: str) -> str:
    """What the command prints, a minute after the last thing that happened."""
    found, diagnostics = incident(world.layout.project, {}, name)
    assert found is not None, diagnostics
    out = io.StringIO()
    screen = Console(out, io.StringIO(), colour=False, colour_err=False, interactive=False)
    now = datetime.fromisoformat(world.stamp()).astimezone(UTC)
    assert health.incident(screen, found, diagnostics, as_json=False, now=now) == 0
    return out.getvalue()


def bad_day(world: DaemonWorld) -> None:
    """A tool fails while repairs are paused; WATCH names the class, and neither HEAL helps."""
    error: dict[str, Any] = {
        "tool": TOOL,
        "device": None,
        "class": "broken_tool",
        "severity": "recoverable",
        "cites": [],
    }
    error |= {"message": "it divides by the number of joints, which is 0 while the arm is off", "suggested_fix": ""}
    report = {"status": "error", "summary": "s", "errors": [error]}
    heals = iter(
        (
            RepairOutcome(
                RepairVerdict.FAILED,
                (Reason("HEAL-UNCHANGED", "the rewritten server is the accepted one"),),
                cost=Cost(1, 12_000, 900, 0.031),
            ),
            RepairOutcome.done(
                "heal.rewrite", "repaired: the joints are counted first", cost=Cost(2, 24_000, 1900, 0.061)
            ),
            RepairOutcome.refused("DUTY-CHANGED", "the endpoint is not what the manifest makes of it now"),
        )
    )

    def watches(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        world.now += 41.0
        text = "error: read_joints fails while the arm is off"
        return RepairOutcome.done("watch.report", text, cost=Cost(1, 4210, 312, 0.012), report=report)

    def heal(world: DaemonWorld, finding: Finding) -> RepairOutcome:
        world.now += 95.0
        made = next(heals)
        if made.ok:
            world.fail(TOOL, "ZeroDivisionError", "division by zero")
        return made

    world.mends |= {Repair.WATCH: watches, Repair.HEAL: heal}
    world.start()
    instance_lock.pause(world.layout, world.stamp())
    world.fail(TOOL, "ZeroDivisionError", "division by zero")
    world.happens(Cause.LOG)
    world.advance(30)
    instance_lock.resume(world.layout)
    world.happens(Cause.FILES)
    world.advance(600)


def test_the_example_of_the_documentation_is_what_the_command_prints(world: DaemonWorld) -> None:
    bad_day(world)
    printed = shown(world, "e1")
    (block,) = [each for each in DOCS.read_text().split("```") if each.startswith("\nincident e1:")]
    assert block.lstrip("\n") == printed


def test_what_only_the_hardware_changes_and_what_is_over_say_so(world: DaemonWorld) -> None:
    world.start()
    world.die()
    world.happens(Cause.PROCESS)
    world.truth.devices["usb-1f00-00a1"] = LastSeen(False)
    world.happens(Cause.HARDWARE)
    over, waits = shown(world, "1"), shown(world, "e2")
    assert "  repaired after 0.0 s\n" in over and "to do" not in over and "  not tried   rebuild\n" in over
    assert "  considered  restart up to 2 times, then rebuild\n" in over
    assert "restart done in 0.0 s\n    repair.made  started\n" in over
    assert "  considered  none: only the hardware can change it\n" in waits
    assert "  now         no daemon runs (octoform watch)\n  to do       put it back\n" in waits


def test_a_rewrite_that_waits_for_a_person_names_its_command(world: DaemonWorld) -> None:
    command = "octoform confirm r1 shows what it changes and puts it in service"
    made = RepairOutcome.refused("HEAL-WAITS", "it changes rail_move_x", again=False).because(WAITS, command)
    report = {"status": "error", "errors": [{"tool": TOOL, "class": "broken_tool", "message": "m"}]}
    world.mends |= {
        Repair.WATCH: lambda world, finding: worked("a report", report=report),
        Repair.HEAL: lambda world, finding: made,
    }
    world.start()
    world.fail(TOOL)
    world.happens(Cause.LOG)
    world.advance(60)
    assert f"  to do       {command}\n" in shown(world, "e1")


def test_hostile_words_act_on_no_terminal(world: DaemonWorld) -> None:
    world.mends[Repair.RESTORE] = lambda world, finding: failed(f"there is \x1b[2Jno \u202ecopy {'x' * 5000}")
    world.truth.damaged["state/bench/serve/server.py"] = "changed"
    world.start()
    printed = shown(world, "e1")
    assert "\x1b" not in printed and "\u202e" not in printed and "there is \\x1b[2Jno \\u202ecopy" in printed
    assert max(map(len, printed.splitlines())) <= 110


def test_the_command_shows_it_as_json_and_knows_what_is_not_kept(
    world: DaemonWorld, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bad_day(world)
    monkeypatch.chdir(world.layout.project)
    assert dispatch(["incidents", "show", "1", "-json"]) == 0
    document = json.loads(capsys.readouterr().out)
    episode = document["episode"]
    assert document["do"] == f"fix the cause, then: octoform heal -retry tool:{TOOL}"
    assert document["waits"] == "given up: 3 tries did not help"
    assert [(made["repair"], made["verdict"]) for made in episode["tries"]] == [
        ("watch", "done"),
        ("heal", "failed"),
        ("heal", "failed"),
        ("heal", "refused"),
    ]
    assert [reason["rule"] for reason in episode["tries"][2]["reasons"]] == ["heal.rewrite", "check.still-there"]
    assert episode["tries"][2]["ok"] is True, "its own word"
    assert [each["reasons"][0]["rule"] for each in episode["refused"]] == ["loop.paused", "loop.given-up"]
    assert episode["tries"][1]["cost"] == {"calls": 1, "input_tokens": 12000, "output_tokens": 900, "usd": 0.031}
    assert dispatch(["incidents", "show", "7"]) == 1
    assert "DAEMON-NO-SUCH-INCIDENT" in capsys.readouterr().err
    for words in (["show"], ["shw", "1"], ["show", "1", "2"]):
        assert dispatch(["incidents", *words]) == 1
        assert "usage: octoform incidents" in capsys.readouterr().err
