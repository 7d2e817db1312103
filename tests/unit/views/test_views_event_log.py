"""What the daemon does on a terminal, as a person sees it, and as JSON lines."""

import io
import json
import re
from dataclasses import replace
from pathlib import Path

import pyte
import pytest
from daemon_world import DaemonWorld

from octoform.apply.repair_outcome import RepairOutcome
from octoform.daemon.model import Cause, Finding, Repair
from octoform.daemon.reconcile.bench import Task
from octoform.daemon.repair.playbook import PLAYBOOK
from octoform.daemon.store import instance_lock
from octoform.views.daemon.event_log import Lines, Objects, named
from octoform.views.format.console import Console

COLUMNS, LINES = 120, 20  # wide enough for the date, which lines of another day have


class Terminal(io.StringIO):
    """An output that reports to be a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def utc(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "UTC")
    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    monkeypatch.setenv("LINES", str(LINES))


def console(out: io.StringIO, *, colour: bool = False) -> Console:
    return Console(out, io.StringIO(), colour=colour, colour_err=False, interactive=out.isatty())


def screen(out: io.StringIO) -> list[str]:
    """What a terminal shows after all that was written."""
    shown = pyte.Screen(COLUMNS, LINES)
    pyte.Stream(shown).feed(out.getvalue().replace("\n", "\r\n"))
    return [line.rstrip() for line in shown.display if line.strip()]


def night(folder: Path) -> DaemonWorld:
    """A start, a death that is repaired, a pause, and a damage that cannot be."""
    world = DaemonWorld(folder)
    world.start()
    world.at(10, world.die, Cause.PROCESS)
    world.advance(20)
    instance_lock.pause(world.layout, world.stamp())
    world.happens(Cause.FILES)
    instance_lock.resume(world.layout)
    world.happens(Cause.FILES)
    world.mends[Repair.RESTORE] = lambda world, finding: RepairOutcome.failed(
        "test", "there is \x1b[2Jno copy", again=False
    )
    world.truth.damaged["state/bench/serve/server.py"] = "changed"
    world.happens(Cause.FILES)
    world.advance(400)
    return world


@pytest.mark.parametrize("colour", [True, False])
def test_a_person_sees_one_line_for_each_event_and_one_that_says_how_it_is(tmp_path: Path, colour: bool) -> None:
    world = night(tmp_path)
    out = Terminal()
    view = Lines(console(out, colour=colour))
    for made in world.rounds:
        view(made)
    seen = [re.sub(r"^([0-9-]{10} )?[0-9:]{8}  ", "", line) for line in screen(out)]
    assert seen[:7] == [
        "endpoint  the endpoint's process is gone",
        "endpoint  restart done in 0.0 s: started",
        "endpoint  repaired after 0.0 s",
        "octoform  repairs are paused: octoform resume lets them go on",
        "octoform  repairs go on",
        "file:state/bench/serve/server.py  state/bench/serve/server.py is not as it was accepted",
        "file:state/bench/serve/server.py  restore failed in 0.0 s: there is \\x1b[2Jno copy",
    ]
    assert any("needs a person (octoform health)" in line for line in seen)
    assert seen[-1].startswith("bench: degraded  0 signals, 1 not well, last check ")
    assert seen[-1].endswith("(Ctrl-C ends)")
    assert ("\x1b[3" in out.getvalue()) is colour
    view.end()
    assert not any("Ctrl-C" in line for line in screen(out))


def test_a_quiet_night_is_one_line(tmp_path: Path) -> None:
    world = DaemonWorld(tmp_path)
    out = Terminal()
    view = Lines(console(out))
    world.start()
    world.advance(3600)
    assert len(world.rounds) > 10
    for made in world.rounds:
        view(made)
    (line,) = screen(out)
    assert line.startswith("bench: healthy")


def test_no_line_is_wider_than_the_terminal(tmp_path: Path) -> None:
    world = DaemonWorld(tmp_path)
    world.truth.damaged[f"state/bench/{'x' * 300}"] = "changed"
    world.start()
    world.advance(400)
    out = Terminal()
    view = Lines(console(out))
    for made in world.rounds:
        view(made)
    assert max(len(line) for line in out.getvalue().replace("\r\x1b[K", "\n").split("\n")) <= COLUMNS


def test_a_program_reads_an_object_for_each_event(tmp_path: Path) -> None:
    world = night(tmp_path)
    out = io.StringIO()
    view = Objects(console(out))
    for made in world.rounds:
        view(made)
    lines = [json.loads(line) for line in out.getvalue().splitlines()]
    kinds = [line["type"] for line in lines]
    assert kinds[:2] == ["version", "health"]
    assert {"noticed", "repair_end", "over", "paused", "resumed", "needs_person"} <= set(kinds)
    assert kinds.count("needs_person") == 1
    noticed = next(line for line in lines if line["type"] == "noticed")
    assert (noticed["episode"]["id"], noticed["episode"]["target"]) == ("e1", "endpoint")
    over = next(line for line in lines if line["type"] == "over")
    assert (over["episode"]["outcome"], over["seconds"]) == ("repaired", 0.0)
    assert kinds.count("health") < len(world.rounds), "health is told when it is another one"
    assert all(line["@message"] and line["@timestamp"] for line in lines)


def test_what_ended_is_told_before_what_was_begun_because_of_it(tmp_path: Path) -> None:
    world = night(tmp_path)
    made = next(each for each in world.rounds if each.tried)
    before = made.tried[0][0]
    finding = Finding(before.kind, before.fault, "tool:read_joints", before.summary, (), Repair.HEAL)
    begun = Task(PLAYBOOK[Repair.HEAL].lane, finding, Repair.HEAL, finding.key, None, made.facts.uptime)
    made = replace(made, begun=(begun,))
    out, lines = io.StringIO(), Terminal()
    Objects(console(out))(made)
    Lines(console(lines))(made)
    items = [json.loads(line)["type"] for line in out.getvalue().splitlines()]
    assert items.index("repair_end") < items.index("repair_start")
    seen = screen(lines)
    assert [("heal ..." in each) for each in seen if "restart done" in each or "heal ..." in each] == [False, True]


def test_whom_it_concerns_is_told_once() -> None:
    assert named("device:usb-1", "usb-1 is not there") == "usb-1 is not there"
    assert named("disk", "less than 64 MB are left") == "disk: less than 64 MB are left"
