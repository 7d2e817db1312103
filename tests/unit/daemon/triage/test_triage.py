"""Each fault that code can determine gives its one finding, and nothing else is made of it."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.claims.model import Channel, Reading, Signal
from octoform.daemon.model import Facts, FaultClass, Kind, LastSeen, Repair
from octoform.daemon.triage import Recall, failure_history, judge, remember
from octoform.daemon.triage.agent_report import findings_of
from octoform.endpoint.logs import LoggedCall
from octoform.endpoint.process.record import Running

PROCESS = Running(10, 20, ("launch",), "one", "2026-01-01T00:00:00Z", "local", None)
WELL = Facts(100.0, "2026-01-01T00:01:40Z", "bench", process=PROCESS, answers=True)
DEAD = replace(WELL, process=None, answers=None)
NO_START = replace(DEAD, start_failed="ImportError: cannot import name 'x'")


def failed(tool: str, error: str, message: str = "it broke", times: int = 1) -> tuple[LoggedCall, ...]:
    return tuple(LoggedCall(tool, True, False, error, message) for _ in range(times))


def said(facts: Facts, before: Facts | None = None, readings: tuple[Reading, ...] = ()) -> list[tuple[str, str, str]]:
    """(kind, target, repair) of each finding of one look."""
    found = judge(facts, before, remember(Recall(), facts), readings)
    return [(each.kind, each.target, each.repair) for each in found]


def reading(
    path: str, value: object, why: str = "", channel: Channel = Channel.SENSOR, source: str = "read"
) -> Reading:
    return Reading("r1", "", 1.0, Signal(channel, source, path), value, why)  # type: ignore[arg-type]


ONE = [
    (DEAD, Kind.PROCESS_DEAD, "endpoint", Repair.RESTART),
    (replace(WELL, answers=False), Kind.PROCESS_HUNG, "endpoint", Repair.RESTART),
    (
        replace(WELL, reported={"gate": {"stuck": [{"tool": "move", "seconds": 9.1}]}}),
        Kind.PROCESS_HUNG,
        "tool:move",
        Repair.RESTART,
    ),
    (
        replace(WELL, reported={"outside": {"move": {"elbow": "at 9000 raw, outside of its range"}}}),
        Kind.BEYOND_LIMIT,
        "tool:move",
        Repair.PERSON,
    ),
    (replace(WELL, disk_free=1_000_000), Kind.DISK_FULL, "disk", Repair.ROTATE),
    (replace(WELL, log_bytes={"server.log": 11_000_000}), Kind.LOG_OVERGROWN, "log:server.log", Repair.ROTATE),
    (
        replace(DEAD, start_failed="refused: no port from 7777 to 7796 is free"),
        Kind.PORT_TAKEN,
        "endpoint",
        Repair.RESTART,
    ),
    (
        replace(WELL, damaged={"state/bench/serve/server.py": "link"}),
        Kind.FILE_DAMAGED,
        "file:state/bench/serve/server.py",
        Repair.RESTORE,
    ),
    (
        replace(WELL, endpoint=("the launcher is missing", "the endpoint is not running")),
        Kind.FILE_DAMAGED,
        "endpoint:files",
        Repair.REPUBLISH,
    ),
    (
        replace(WELL, damaged={"state/bench/serve/notes.txt": "foreign"}),
        Kind.FILE_DAMAGED,
        "file:state/bench/serve/notes.txt",
        Repair.PERSON,
    ),
    (
        replace(WELL, damaged={"octopus.yaml": "line 3: no such key"}),
        Kind.STATE_DAMAGED,
        "file:octopus.yaml",
        Repair.PERSON,
    ),
    (
        replace(WELL, damaged={"state/bench/state.json": "it is cut off"}),
        Kind.STATE_DAMAGED,
        "file:state/bench/state.json",
        Repair.PERSON,
    ),
    (
        replace(WELL, environment=("attrs 25.1 is gone from the serving environment",)),
        Kind.PACKAGE_DAMAGED,
        "package:attrs",
        Repair.REBUILD,
    ),
    (
        replace(WELL, environment=("cam-full 4.1 was added to the serving environment",)),
        Kind.PACKAGE_CONFLICT,
        "package:cam-full",
        Repair.REBUILD,
    ),
    (
        replace(WELL, failures=failed("look", "ModuleNotFoundError", "No module named 'cam.inner'")),
        Kind.PACKAGE_DAMAGED,
        "package:cam",
        Repair.REBUILD,
    ),
    (
        NO_START,
        Kind.PACKAGE_DAMAGED,
        "environment",
        Repair.REBUILD,
    ),
    (replace(WELL, devices={"usb-1": LastSeen(False)}), Kind.DEVICE_GONE, "device:usb-1", Repair.WAIT),
    (
        replace(WELL, devices={"usb-1": LastSeen(True, "b", recorded="a")}),
        Kind.DEVICE_MOVED,
        "device:usb-1",
        Repair.REBIND,
    ),
    (
        replace(WELL, devices={"usb-1": LastSeen(True, "b", "one of 2")}),
        Kind.DEVICE_DOUBTFUL,
        "device:usb-1",
        Repair.PERSON,
    ),
    (replace(WELL, appeared=("usb:v1F00p00D1",)), Kind.HARDWARE_CHANGED, "hardware", Repair.REDISCOVER),
    (replace(WELL, failures=failed("look", "KeyError")), Kind.TOOL_FAILING, "tool:look", Repair.WATCH),
    (replace(WELL, failures=failed("look", "OSError", times=2)), Kind.TOOL_FAILING, "tool:look", Repair.WATCH),
    (replace(WELL, failures=failed("look", "PermissionError", times=2)), Kind.TOOL_FAILING, "tool:look", Repair.PERSON),
    (replace(WELL, failures=failed("move", "AmbiguousDevice")), Kind.DEVICE_DOUBTFUL, "tool:move", Repair.PERSON),
    (replace(WELL, failures=failed("look", "DeviceAbsent")), Kind.DEVICE_GONE, "tool:look", Repair.WAIT),
    (replace(WELL, reported={"tunnel": {"state": "not running"}}), Kind.TUNNEL_DOWN, "tunnel", Repair.WAIT),
]


@pytest.mark.parametrize(("facts", "kind", "target", "repair"), ONE, ids=[f"{each[1]}-{each[2]}" for each in ONE])
def test_a_fault_gives_its_finding_and_no_other(facts: Facts, kind: Kind, target: str, repair: Repair) -> None:
    started = (
        [(Kind.PROCESS_DEAD, "endpoint", Repair.RESTART)] if kind is Kind.PACKAGE_DAMAGED and facts == NO_START else []
    )
    assert said(facts) == [(kind, target, repair), *started]


def test_what_is_well_gives_nothing_and_so_does_a_host_that_is_being_applied() -> None:
    assert said(WELL) == []
    assert said(replace(DEAD, busy="apply")) == []
    assert said(replace(DEAD, applied=False)) == []
    assert said(replace(DEAD, stopped_by="a person")) == []
    assert said(replace(DEAD, stopped_by="a person", start_failed="ImportError")) == []
    assert said(replace(WELL, latched=True)) == []
    for of_a_person in ("published by another version of octoform", "built for another set of packages"):
        assert said(replace(WELL, endpoint=(f"the endpoint was {of_a_person}",))) == []


def test_a_process_is_not_started_on_what_is_damaged_and_is_once_that_is_repaired() -> None:
    torn = replace(DEAD, damaged={"state/bench/serve/server.py": "changed"})
    assert [each[0] for each in said(torn)] == [Kind.FILE_DAMAGED]
    assert [each[0] for each in said(DEAD)] == [Kind.PROCESS_DEAD]


def test_short_lives_in_a_row_are_a_loop_and_no_longer_a_matter_of_starting_again() -> None:
    known, uptime = Recall(), 0.0
    for number in range(3):
        lives = replace(WELL, uptime=uptime, process=replace(PROCESS, instance=str(number)))
        known = remember(known, lives)
        uptime += 2.0
        known = remember(known, replace(DEAD, uptime=uptime))
    found = judge(replace(DEAD, uptime=uptime), None, known)
    assert [(each.kind, each.repair) for each in found] == [(Kind.CRASH_LOOP, Repair.REBUILD)]
    later = replace(DEAD, uptime=uptime + failure_history.CRASH_WINDOW + 1)
    assert [each.kind for each in judge(later, None, remember(known, later))] == [Kind.PROCESS_DEAD]


def test_a_process_that_a_person_ended_is_no_crash() -> None:
    known = remember(Recall(), WELL)
    known = remember(known, replace(DEAD, uptime=101.0, stopped_by="a person"))
    assert known.ends == ()


def test_a_device_that_is_gone_explains_hardware_that_went_and_tools_that_fail() -> None:
    gone = replace(
        WELL,
        devices={"usb-1": LastSeen(False)},
        gone=("class:tty:2", "usb:v1F00p00B1"),
        appeared=("class:tty:1",),
        failures=failed("look", "DeviceAbsent") + failed("ask", "OSError", times=3),
    )
    assert [each[0] for each in said(gone, gone)] == [Kind.DEVICE_GONE]
    other = replace(gone, appeared=("class:tty:1", "usb:v1F00p00D1"))
    assert [each[0] for each in said(other)] == [Kind.DEVICE_GONE, Kind.HARDWARE_CHANGED]


def test_hardware_that_went_and_was_no_device_of_the_endpoint_is_discovered_again() -> None:
    fewer = replace(WELL, gone=("class:leds:3",), appeared=("class:leds:2",))
    assert [each[0] for each in said(fewer, fewer)] == [Kind.HARDWARE_CHANGED]
    assert said(fewer) == said(fewer, WELL) == []  # a loose plug


def test_a_device_that_comes_back_elsewhere_is_bound_again_and_one_in_its_place_is_not() -> None:
    before = replace(WELL, devices={"usb-1": LastSeen(False, "a")})
    back = replace(WELL, devices={"usb-1": LastSeen(True, "b", recorded="a")})
    assert said(back, before) == [(Kind.DEVICE_BACK, "device:usb-1", Repair.REBIND)]
    moved = judge(back, back, remember(Recall(), back))
    assert [each.kind for each in moved] == [Kind.DEVICE_MOVED]
    assert judge(back, before)[0].key == moved[0].key
    assert said(replace(back, devices={"usb-1": LastSeen(True, "a", recorded="a")}), before) == []


def test_a_tool_is_broken_until_it_works_again() -> None:
    known = remember(Recall(), replace(WELL, failures=failed("look", "KeyError", "'a1b2c3d4e5' at 17")))
    first = judge(WELL, None, known)
    known = remember(known, WELL)
    assert judge(WELL, None, known) == first
    known = remember(known, replace(WELL, failures=failed("look", "KeyError", "'ffffffffff' at 18")))
    assert judge(WELL, None, known)[0].key == first[0].key
    assert judge(WELL, None, remember(known, replace(WELL, worked=("look",)))) == ()


def test_one_failure_of_the_room_costs_no_agent() -> None:
    assert said(replace(WELL, failures=failed("look", "OSError"))) == []
    assert said(replace(WELL, failures=failed("look", "BusBusy", times=4))) == []


def test_a_call_that_never_ended_is_told_the_first_time() -> None:
    late = replace(WELL, failures=(LoggedCall("look", False, False),))
    assert said(late) == [(Kind.TOOL_FAILING, "tool:look", Repair.WATCH)]


def test_an_endpoint_whose_manifest_is_gone_is_no_host_without_an_endpoint() -> None:
    known = remember(remember(Recall(), WELL), replace(WELL, applied=False))
    found = judge(replace(WELL, applied=False), WELL, known)
    assert [(each.kind, each.repair) for each in found] == [(Kind.FILE_DAMAGED, Repair.REPUBLISH)]
    known = remember(known, replace(DEAD, applied=False, busy="destroy"))
    assert judge(replace(DEAD, applied=False), None, remember(known, replace(DEAD, applied=False))) == ()


@pytest.mark.parametrize("error", ["AmbiguousDevice", "DeviceAbsent"])
def test_what_a_call_said_of_a_device_is_over_once_all_of_them_are_certain(error: str) -> None:
    known = remember(Recall(), replace(WELL, failures=failed("move", error)))
    for sightings in (
        {},
        {"a": LastSeen(None)},
        {"a": LastSeen(True), "b": LastSeen(False)},
        {"a": LastSeen(True, doubt="?")},
    ):
        assert "move" in remember(known, replace(WELL, devices=sightings)).failing, sightings
    there = replace(WELL, devices={"a": LastSeen(True), "b": LastSeen(True)})
    assert remember(known, there).failing == {}, "no one has to move something to find out"
    assert "move" in remember(known, replace(there, failures=failed("move", error))).failing
    broken = remember(Recall(), replace(WELL, failures=failed("move", "KeyError")))
    assert "move" in remember(broken, there).failing


def test_a_tool_that_is_not_offered_any_more_fails_no_more() -> None:
    known = remember(Recall(), replace(WELL, failures=failed("gone_by", "KeyError")))
    assert "gone_by" in remember(known, WELL).failing, "no one knows what is offered"
    assert "gone_by" in remember(known, replace(WELL, offered=frozenset({"gone_by", "look"}))).failing
    assert remember(known, replace(WELL, offered=frozenset({"look"}))).failing == {}


def test_pictures_that_show_nothing_wait_for_light_and_a_camera_that_stands_still_is_asked_about() -> None:
    dark = reading("/trouble", "black", channel=Channel.FRAME, source="usb-1")
    assert said(WELL, readings=(dark,)) == [(Kind.PICTURE_ODD, "device:usb-1", Repair.WAIT)]
    still = reading("/trouble", "frozen", channel=Channel.FRAME, source="usb-1")
    assert said(WELL, readings=(still,)) == [(Kind.PICTURE_ODD, "device:usb-1", Repair.WATCH)]
    assert said(WELL, readings=(reading("/trouble", None, channel=Channel.FRAME, source="usb-1"),)) == []


def test_a_unit_that_was_left_out_is_told_once_with_all_its_members() -> None:
    unit = [reading("/joints/elbow/skipped", "disabled by the owner"), reading("/joints/elbow/heat", None, "skipped")]
    well = [reading("/joints/wrist/skipped", None), reading("/joints/wrist/heat", 30)]
    assert said(WELL, readings=(*unit, *well)) == [(Kind.UNCOVERED, "unit:read/joints/elbow", Repair.WAIT)]


@given(st.binary(max_size=300), st.binary(max_size=300))
def test_a_tool_may_say_anything(error: bytes, message: bytes) -> None:
    call = LoggedCall("look", True, False, error.decode("latin-1"), message.decode("latin-1"))
    known = remember(Recall(), replace(WELL, failures=(call, call)))
    found = judge(WELL, None, known)
    assert all("\x1b" not in each.summary and len(each.summary) <= 400 for each in found)
    assert failure_history.from_json(failure_history.as_json(known)) == known


CLASSES = [
    ("dependency", Repair.REBUILD, Repair.HEAL),
    ("broken_tool", Repair.HEAL, Repair.HEAL),
    ("dead_process", Repair.RESTART, Repair.RESTART),
    ("device_moved", Repair.REBIND, Repair.REDISCOVER),
    ("none", Repair.PERSON, None),
    ("HEALTHY", Repair.PERSON, None),
]


@pytest.mark.parametrize(("word", "first", "then"), CLASSES)
def test_a_reported_class_leads_to_its_entry_of_the_playbook(word: str, first: Repair, then: Repair | None) -> None:
    error = {"class": word, "tool": "look", "severity": "recoverable", "message": "m\x1b[2J"}
    (found,) = findings_of({"status": "error", "errors": [error]}, DEAD)
    assert (found.repair, found.then[:1]) == (first, (then,) if then else ())
    assert "\x1b" not in found.summary
    assert found.data["error"] == error


def test_a_reported_file_is_restored_only_where_one_is_seen_to_be_damaged() -> None:
    error = {"class": "corrupted_file", "tool": "look", "severity": "recoverable", "message": "syntax"}
    report = {"status": "error", "errors": [error]}
    assert findings_of(report, WELL)[0].repair is Repair.HEAL
    assert findings_of(report, replace(WELL, damaged={"a": "changed"}))[0].repair is Repair.RESTORE


def test_fatal_errors_are_for_a_person_and_no_report_is_never_healthy() -> None:
    error = {"class": "broken_tool", "tool": "look", "severity": "fatal", "message": "smoke"}
    assert findings_of({"status": "down", "errors": [error]}, WELL)[0].repair is Repair.PERSON
    for report in (None, {}, {"status": "unknown", "errors": []}, {"status": "error", "errors": "x"}):
        (found,) = findings_of(report, WELL)
        assert (found.kind, found.repair) == (Kind.UNCOVERED, Repair.PERSON)
    assert findings_of({"status": "healthy", "errors": []}, WELL) == ()


def test_an_agent_does_not_restart_what_is_seen_to_run() -> None:
    error = {"class": "dead_process", "severity": "recoverable", "message": "it is dead"}
    assert findings_of({"status": "down", "errors": [error]}, WELL)[0].repair is Repair.PERSON


def test_every_kind_is_judged_somewhere() -> None:
    names = {each[1] for each in ONE} | {Kind.CRASH_LOOP, Kind.DEVICE_BACK, Kind.PICTURE_ODD, Kind.UNCOVERED}
    assert names == set(Kind)
    assert {each.value for each in FaultClass} >= {word for word, *_ in CLASSES[:-1]}


def test_what_a_former_process_could_not_read_is_no_fault_of_this_one() -> None:
    late = replace(WELL, process=replace(PROCESS, start=5000))
    failed = reading("", None, "the endpoint takes no client")
    assert said(late, readings=(failed,)) == []
    assert [each[0] for each in said(late, readings=(replace(failed, uptime=60.0),))] == [Kind.UNCOVERED]


def test_a_folder_that_is_gone_is_one_trouble() -> None:
    lost = {f"state/bench/serve/runtime/{name}.py": "missing" for name in "abcd"}
    assert said(replace(WELL, damaged=lost)) == [(Kind.FILE_DAMAGED, "file:state/bench/serve", Repair.RESTORE)]


def test_a_log_that_was_set_aside_is_not_set_aside_again() -> None:
    assert said(replace(WELL, log_bytes={"server.log.1": 12_000_000, "octoform.jsonl.12.gz": 12_000_000})) == []
