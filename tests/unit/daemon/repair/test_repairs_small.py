"""The small repairs: room on the disk, a log, where a device is, and which job each repair is."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from octoform.apply.repair_outcome import Cost, RepairOutcome
from octoform.daemon.model import FaultClass, Finding, Kind, Repair
from octoform.daemon.repair import upkeep
from octoform.daemon.repair.playbook import Means, carry_out
from octoform.daemon.repair.upkeep import free, rebind, rotate
from octoform.daemon.repair.worker import JOBS
from octoform.diagnostics import error
from octoform.endpoint.environment.model import MARKER
from octoform.state.artifact_cache import read_instances, write_instances
from octoform.state.layout import Layout

OLD = 1_000_000_000
MANIFEST: dict[str, Any] = {
    **{"format": 1, "files": {}, "lock": "", "tools": [], "server": ""},
    **{"runtime": None, "launcher": None},
}


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    return Layout(tmp_path, "bench")


def finding(kind: Kind, target: str, repair: Repair) -> Finding:
    return Finding(kind, FaultClass.NONE, target, "something", (), repair)


def test_each_repair_is_a_job_of_the_child_with_what_it_needs() -> None:
    asked: list[tuple[str, dict[str, Any]]] = []

    def run(job: str, brief: Mapping[str, Any], seconds: float) -> dict[str, Any]:
        assert seconds > 0
        asked.append((job, dict(brief)))
        return RepairOutcome.done("test.end", "done").to_json()

    means = Means("bench", run, "ask")
    for kind, target, repair in (
        (Kind.PROCESS_DEAD, "endpoint", Repair.RESTART),
        (Kind.PROCESS_HUNG, "endpoint", Repair.RESTART),
        (Kind.DISK_FULL, "disk", Repair.ROTATE),
        (Kind.LOG_OVERGROWN, "log:server.log", Repair.ROTATE),
        (Kind.DEVICE_MOVED, "device:usb-1f00-00a1", Repair.REBIND),
        (Kind.HARDWARE_CHANGED, "hardware", Repair.REDISCOVER),
        (Kind.FILE_DAMAGED, "file:x", Repair.RESTORE),
    ):
        assert carry_out(finding(kind, target, repair), repair, means).ok
    host = {"host": "bench"}
    assert asked == [
        ("restart", {**host, "hung": False}),
        ("restart", {**host, "hung": True}),
        ("rotate", host),
        ("rotate", {**host, "log": "server.log"}),
        ("rebind", {**host, "device": "usb-1f00-00a1"}),
        ("rediscover", {**host, "apply": "ask"}),
        ("restore", host),
    ]
    assert {job for job, _ in asked} <= set(JOBS)
    refused = carry_out(finding(Kind.TOOL_FAILING, "tool:x", Repair.PERSON), Repair.PERSON, means)
    assert (refused.ok, refused.again) == (False, False)


def test_a_result_is_believed_only_where_it_says_so() -> None:
    done = RepairOutcome.from_json
    assert not done({}).ok and done({}).again
    assert not done({"ok": "yes"}).ok
    found = done({"ok": False, "again": False, "detail": "x", "cost": {"calls": 2, "input_tokens": None, "usd": None}})
    assert (found.again, found.detail, found.cost) == (False, "x", Cost(2, 0, 0, None))


def test_room_is_made_of_what_can_be_made_again_until_there_is_enough(
    layout: Layout, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ("aaaaaaaaaaaa", "bbbbbbbbbbbb", "cccccccccccc")
    for name in names:
        (layout.environments / name).mkdir(parents=True)
        (layout.environments / name / MARKER).write_text("{}")
    layout.endpoint.mkdir(parents=True)
    places = {
        "environment": str(layout.environments / names[0]),
        "previous_environment": str(layout.environments / names[1]),
    }
    (layout.endpoint / "manifest.json").write_text(json.dumps({**MANIFEST, **places}))
    for number in range(1, 7):
        folder = layout.attempts / f"{number:06}-serve-1"
        folder.mkdir(parents=True)
        os.utime(folder, (OLD, OLD) if number != 2 else None)
    layout.logs.mkdir()
    (layout.logs / "server.log.1").write_bytes(b"an Error\n")
    (layout.local / "results").mkdir()
    (layout.local / "results" / "picture.jpg").write_bytes(b"a person's")
    rooms = iter([0] * 100)
    monkeypatch.setattr(upkeep, "room", lambda _: next(rooms))
    done = free(layout)
    assert (done.ok, done.again) == (False, False) and "free some space on that disk" in done.detail
    assert [path.name for path in layout.environments.iterdir() if not path.name.startswith(".")] == [names[0]]
    assert sorted(path.name[:6] for path in layout.attempts.iterdir()) == ["000002", "000005", "000006"]
    assert (layout.local / "results" / "picture.jpg").exists()
    assert [path.name for path in layout.logs.iterdir()] == ["server.errors"]
    for name in (*names[1:], "000001-serve-1", "server.log.1"):
        assert name in done.detail


def test_nothing_more_is_dropped_than_is_needed(layout: Layout, monkeypatch: pytest.MonkeyPatch) -> None:
    layout.logs.mkdir(parents=True)
    for number in (1, 2, 3):
        (layout.logs / f"server.log.{number}").write_bytes(b"x")
    rooms = iter([0, 0, 10, 10, 10])
    monkeypatch.setattr(upkeep, "room", lambda _: next(rooms))
    assert free(layout, wanted=5).ok
    assert len(list(layout.logs.iterdir())) == 2


def test_a_log_is_set_aside_by_name_and_never_through_a_link_or_out_of_its_folder(layout: Layout) -> None:
    layout.logs.mkdir(parents=True)
    outside = layout.local / "instances.json"
    outside.write_text("{}")
    layout.server_log.write_bytes(b"x" * 3000)
    assert rotate(layout, "server.log").ok
    assert (layout.logs / "server.log.1").stat().st_size == 3000
    assert rotate(layout, "../instances.json").detail == "there is no instances.json"
    layout.call_log.symlink_to(outside)
    assert not rotate(layout, layout.call_log.name).ok
    assert outside.read_text() == "{}"


def told(strength: str = "strong", doubt: str = "", attached: bool = True, port: str = "1-8") -> dict[str, Any]:
    where = {"attached": attached, "port": port, "sysfs": f"/sys/devices/usb1/{port}", "nodes": []}
    return {**where, "strength": strength, "doubt": doubt}


@pytest.mark.parametrize(
    ("answer", "twin", "written"),
    [
        (told(), True, True),
        (told("positional"), True, True),
        (told("weak"), False, True),
        (told("weak"), True, False),
        (told(doubt="it may be any of 2 equal devices"), False, False),
        (told(attached=False), False, False),
        (None, False, False),
    ],
)
def test_a_place_is_written_down_only_where_it_is_certain(
    layout: Layout, answer: dict[str, Any] | None, twin: bool, written: bool
) -> None:
    before: dict[str, object] = {"usb-1f00-00b1": {"port": "1-1", "sysfs": "/sys/devices/usb1/1-1", "strength": "weak"}}
    before |= {"usb-1f00-00b1-2": {"port": "1-2"}} if twin else {"usb-1f00-00c1": {"port": "1-3"}}
    write_instances(layout, before)

    def where(ids: Sequence[str]) -> dict[str, dict[str, Any]] | None:
        return {ids[0]: answer} if answer is not None else None

    assert rebind(layout, "usb-1f00-00b1", where).ok == written
    after, _ = read_instances(layout)
    assert after is not None
    assert (after == before) != written
    if written:
        assert after["usb-1f00-00b1"] == {"port": "1-8", "sysfs": "/sys/devices/usb1/1-8", "strength": "weak"}
        assert rebind(layout, "usb-1f00-00b1", where).detail.endswith("is where it was written down: 1-8")


def test_a_place_that_could_not_be_written_down_is_reported(layout: Layout, monkeypatch: pytest.MonkeyPatch) -> None:
    write_instances(layout, {"usb-1f00-00b1": {"port": "1-1", "sysfs": "/sys/devices/usb1/1-1"}})
    monkeypatch.setattr(upkeep, "write_instances", lambda *_: [error("STATE-WRITE-FAILED", "the disk is full")])
    assert rebind(layout, "usb-1f00-00b1", lambda ids: {ids[0]: told()}).detail == "the disk is full"


def test_a_device_that_this_machine_does_not_know_is_for_a_person(layout: Layout) -> None:
    refused = rebind(layout, "usb-1f00-00b1", lambda _: {})
    assert (refused.ok, refused.again) == (False, False)


def test_the_endpoint_is_started_again_without_a_child_where_the_daemon_does_it_itself() -> None:
    lines: list[bool] = []

    def restarted(hung: bool) -> RepairOutcome:
        lines.append(hung)
        return RepairOutcome.done("restart.serves", "process 7 serves it")

    def run(job: str, brief: Mapping[str, Any], seconds: float) -> dict[str, Any]:
        raise AssertionError(f"a child was started for {job}")

    means = Means("bench", run, "ask", restarted)
    for kind in (Kind.PROCESS_DEAD, Kind.PROCESS_HUNG):
        assert carry_out(finding(kind, "endpoint", Repair.RESTART), Repair.RESTART, means).ok
    assert lines == [False, True]
