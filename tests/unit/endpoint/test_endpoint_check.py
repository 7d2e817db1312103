"""The check: a real client, real servers, good and bad."""

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from unit.endpoint.endpoint_servers import CLOCK, GOOD, HEADER, VOLTAGE, processes_of, publish, tool
from unit.endpoint.endpoint_zoo import PLAIN, SOURCE, TOOLS

from octoform.diagnostics import Diagnostic, Severity
from octoform.endpoint.client.check import CheckReport, SampleCallResult, check, judge_check
from octoform.endpoint.client.check_verdict import NOTHING_ANSWERS
from octoform.endpoint.environment.model import Environment
from octoform.endpoint.logs import LoggedCall, calls_after, mark
from octoform.endpoint.process.start_stop import stop
from octoform.endpoint.published_files import CHECK
from octoform.state.layout import Layout

pytestmark = pytest.mark.usefixtures("forks")

Seen = tuple[CheckReport, list[Diagnostic]]


def checked(layout: Layout, serving: Environment, source: str, *tools: dict[str, Any], **how: Any) -> Seen:
    interface = publish(layout, serving, source, *(tools or (CLOCK, PLAIN)))
    report = check(layout, interface, **how)
    stop(layout)
    assert processes_of(layout) == []
    return report, judge_check(report, interface)


def said(problems: list[Diagnostic]) -> list[tuple[str, str]]:
    return [(item.severity.value, item.code) for item in problems]


@pytest.mark.parametrize(("mode", "protocol"), [("auto", "2026-07-28"), ("legacy", "2025-11-25")])
def test_a_good_endpoint_answers_in_both_eras(layout: Layout, serving: Environment, mode: str, protocol: str) -> None:
    report, problems = checked(layout, serving, GOOD, CLOCK, VOLTAGE, mode=mode)
    assert problems == []
    assert report.answered and report.protocol == protocol
    assert [item["name"] for item in report.tools] == ["read_clock", "read_voltage"]
    assert report.tools[1]["input_schema"]["required"] == ["channel"]
    assert [(call.tool, call.ok, call.logged) for call in report.calls] == [
        ("read_clock", True, True),
        ("read_voltage", True, True),
    ]
    recorded = json.loads((layout.endpoint / CHECK).read_bytes())
    assert recorded["answered"] and recorded["tools"] == ["read_clock", "read_voltage"]
    # The trial call used the schema's lower bound, and the log holds what was sent.
    calls = [json.loads(line) for line in layout.call_log.read_text().splitlines()]
    assert calls[2]["arguments"] == {"channel": 1}


@pytest.fixture(scope="module")
def zoo(serving: Environment, tmp_path_factory: pytest.TempPathFactory) -> Seen:
    """One server with a tool for each way to be wrong, checked once; it also prints while it loads."""
    layout = Layout(tmp_path_factory.mktemp("zoo"), "bench")
    result = checked(layout, serving, SOURCE, *TOOLS)
    assert "mover" not in layout.call_log.read_text()
    return result


def about(found: Seen, name: str) -> list[Diagnostic]:
    return [item for item in found[1] if name in item.summary.split(" ")]


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("missing_library", "ModuleNotFoundError"),
        ("missing_attribute", "AttributeError"),
        ("missing_name", "NameError"),
        ("missing_key", "KeyError"),
    ],
)
def test_a_defect_of_the_code_is_an_error(zoo: Seen, name: str, kind: str) -> None:
    (problem,) = about(zoo, name)
    assert said([problem]) == [("error", "ENDPOINT-TOOL-BROKEN")]
    assert f"{name} fails in its own code: {kind}: " in problem.summary


@pytest.mark.parametrize(("name", "kind"), [("not_permitted", "PermissionError"), ("busy", "BusBusy")])
def test_a_fault_of_the_room_is_a_warning(zoo: Seen, name: str, kind: str) -> None:
    (problem,) = about(zoo, name)
    assert said([problem]) == [("warning", "ENDPOINT-TOOL-FAILED")]
    assert kind in problem.summary


@pytest.mark.parametrize(
    ("name", "code", "words"),
    [
        ("absent", "ENDPOINT-DEVICE-ABSENT", "it is not connected"),
        ("no_program", "ENDPOINT-PROGRAM-MISSING", "the program lampctl"),
        ("no_answer", "ENDPOINT-NETWORK-FAILED", "ConnectionRefusedError"),
    ],
)
def test_what_is_missing_is_told_apart_and_is_an_error_where_probe_saw_the_device(
    zoo: Seen, name: str, code: str, words: str
) -> None:
    (problem,) = about(zoo, name)
    assert said([problem]) == [("warning", code)] and words in problem.summary
    again = judge_check(zoo[0], {"tools": list(TOOLS)}, frozenset({"one"}))
    (problem,) = [item for item in again if item.code == code]
    assert said([problem]) == [("error", code)] and problem.hint is not None


def test_a_program_of_a_recorded_host_of_which_nothing_is_known_is_not_said_to_be_missing(zoo: Seen) -> None:
    found = judge_check(zoo[0], {"tools": list(TOOLS)}, frozenset({"one"}), lambda _: False)
    assert "ENDPOINT-PROGRAM-MISSING" not in [item.code for item in found]
    [result] = [item for item in found if "lampctl" in item.summary]
    assert said([result]) == [("warning", "ENDPOINT-TOOL-FAILED")]


def test_a_number_that_cannot_be_measured_is_an_error(zoo: Seen) -> None:
    (problem,) = about(zoo, "scorching")
    assert said([problem]) == [("error", "ENDPOINT-RESULT-IMPLAUSIBLE")]
    assert "temperature_degc: 53125 degC" in str(problem.detail)


def test_an_answer_for_another_device_is_an_error(zoo: Seen) -> None:
    (problem,) = about(zoo, "mistaken")
    assert said([problem]) == [("error", "ENDPOINT-RESULT-OTHER-DEVICE")] and "for other" in problem.summary


def test_a_constant_beside_a_reading_that_moves_is_an_error(zoo: Seen) -> None:
    (problem,) = about(zoo, "frozen")
    assert said([problem]) == [("error", "ENDPOINT-RESULT-CONSTANT")] and "1000, 2000, 3000" in problem.summary


@pytest.mark.parametrize(
    ("result", "seen", "warned"),
    [
        ({"device": "one", "vendor": None, "name": None}, {"one"}, True),
        ({"device": "one", "vendor": None, "name": None}, set(), False),
        ({"device": "one", "vendor": None, "name": "Heron"}, {"one"}, False),
        ({"device": "one", "events": []}, {"one"}, False),
        ({"device": "one"}, {"one"}, False),
    ],
)
def test_null_alone_from_a_device_that_probe_saw_is_a_warning(result: Any, seen: set[str], warned: bool) -> None:
    call = SampleCallResult("read_one", True, logged=True, ended_well=True, device="one", results=(result,))
    report = CheckReport(True, None, None, None, ({"name": "read_one"},), (call,), 1.0)
    interface = {"tools": [{"name": "read_one", "devices": ["one"]}]}
    found = said(judge_check(report, interface, frozenset(seen)))
    assert found == ([("warning", "ENDPOINT-RESULT-EMPTY")] if warned else [])


def test_each_device_of_a_tool_is_tried(zoo: Seen) -> None:
    assert [(call.device, call.ok) for call in zoo[0].calls if call.tool == "of_two"] == [
        ("first", True),
        ("second", False),
    ]
    (problem,) = about(zoo, "of_two")
    assert said([problem]) == [("warning", "ENDPOINT-TOOL-FAILED")] and "only the first" in problem.summary


@pytest.mark.parametrize(
    ("kinds", "seen", "severity"),
    [
        (("ToolError", "OSError"), frozenset({"one"}), "error"),
        (("ToolError", "OSError"), frozenset(), "warning"),
        (("ToolError", "PermissionError"), frozenset({"one"}), "warning"),
        (("ToolError",), frozenset({"one"}), "warning"),
    ],
)
def test_an_endpoint_whose_tools_all_fail_is_told(kinds: tuple[str, ...], seen: frozenset[str], severity: str) -> None:
    calls = tuple(SampleCallResult(f"tool{n}", False, None, kind, "no", logged=True) for n, kind in enumerate(kinds))
    names = [{"name": call.tool, "devices": ["two"]} for call in calls]
    report = CheckReport(True, None, None, None, tuple(names), calls, 0.0)
    [found] = [item for item in judge_check(report, {"tools": names}, seen) if item.code == NOTHING_ANSWERS]
    assert found.severity.value == severity
    well = replace(report, calls=(*calls, SampleCallResult("tool0", True, logged=True)))
    assert NOTHING_ANSWERS not in [item.code for item in judge_check(well, {"tools": names}, seen)]


def test_a_result_that_breaks_its_schema_is_an_error(zoo: Seen) -> None:
    (problem,) = about(zoo, "lie")
    assert said([problem]) == [("error", "ENDPOINT-OUTPUT-INVALID")]
    assert "volts is no number" in str(problem.detail)


def test_a_call_outside_the_log_is_an_error(zoo: Seen) -> None:
    assert said(about(zoo, "silent")) == [("error", "ENDPOINT-CALL-NOT-LOGGED")]


def test_another_set_of_tools_is_an_error(zoo: Seen) -> None:
    (problem,) = [item for item in zoo[1] if item.code == "ENDPOINT-TOOLS-DIFFER"]
    # What INTERFACE does not name is not served.
    assert problem.detail == "missing: promised"


def test_a_picture_of_one_colour_is_told_with_its_figures(zoo: Seen) -> None:
    (problem,) = about(zoo, "dark")
    assert said([problem]) == [("warning", "ENDPOINT-PICTURE-UNIFORM")]
    assert "brightness 16.0 of 255 on average, spread 0.0" in str(problem.detail)
    assert about(zoo, "bright") == []
    assert [call.pictures[0]["spread"] for call in zoo[0].calls if call.tool == "bright"] == [46.1]


def test_a_tool_without_harmless_arguments_is_told(zoo: Seen) -> None:
    assert said(about(zoo, "needy")) == [("warning", "ENDPOINT-TOOL-NOT-TRIED")]


def test_what_a_tool_leaves_running_is_ended_and_told(zoo: Seen) -> None:
    assert zoo[0].survivors == 3  # what answers at once is called three times
    assert said([item for item in zoo[1] if "still running" in item.summary]) == [("warning", "ENDPOINT-LEFT-RUNNING")]


def test_one_bad_tool_takes_no_other_down_and_noise_breaks_nothing(zoo: Seen) -> None:
    fine = {call.tool for call in zoo[0].calls if call.ok and call.logged}
    assert {"read_clock", "bright", "noisy"} <= fine


def test_actuators_are_never_tried(zoo: Seen) -> None:
    assert "mover" not in {call.tool for call in zoo[0].calls}
    assert about(zoo, "mover") == []


def test_lines_of_earlier_calls_do_not_count(tmp_path: Path) -> None:
    log = tmp_path / "calls.jsonl"
    pair = '{"event":"call","id":"%d","tool":"a"}\n{"event":"result","id":"%d","tool":"a","ok":true,"ms":1.0}\n'
    log.write_text(pair % (1, 1))
    position = mark(log)
    assert calls_after(log, position) == []
    log.write_text(log.read_text() + '{"event":"state","id":"7"}\nnot json\n{"event":"call","id":"2","tool":"b"}\n')
    assert calls_after(log, position) == [LoggedCall("b", ended=False, ok=False)]
    log.write_text("")
    assert calls_after(log, position) == []


def test_a_tool_that_hangs_is_a_warning_and_is_ended(layout: Layout, serving: Environment) -> None:
    started = time.monotonic()
    body = "import time\nwhile True:\n    time.sleep(1)"
    report, problems = checked(layout, serving, HEADER + tool(body), call_seconds=1.5)
    assert report.calls[1].error_class == "Timeout"
    assert said(problems) == [("warning", "ENDPOINT-TOOL-FAILED")]
    assert time.monotonic() - started < 20


def test_a_tool_that_takes_the_server_down_is_an_error(layout: Layout, serving: Environment) -> None:
    _, problems = checked(layout, serving, HEADER + tool("import os\nos._exit(1)"))
    assert ("error", "ENDPOINT-CALL-NOT-LOGGED") in said(problems)
    assert ("error", "ENDPOINT-TOOL-BROKEN") in said(problems)


def test_a_server_that_cannot_start_gives_its_reason(layout: Layout, serving: Environment) -> None:
    report, problems = checked(layout, serving, "raise RuntimeError('the board is on fire')\n")
    assert not report.answered
    assert said(problems) == [("error", "ENDPOINT-NO-ANSWER")]
    assert "the board is on fire" in str(problems[0].detail)


def test_without_an_endpoint_nothing_is_written(layout: Layout) -> None:
    report = check(layout, {"tools": [CLOCK]})
    assert not report.answered
    assert [item.severity for item in judge_check(report, {"tools": []})] == [Severity.ERROR]
    assert not layout.endpoint.exists()
