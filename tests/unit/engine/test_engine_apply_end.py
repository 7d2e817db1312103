"""How an apply ends where read tools did not answer, and which tool its last lines offer."""

import json
from pathlib import Path
from typing import Any

import pytest

from octoform.apply.stage.serve_proof import calls_text
from octoform.diagnostics import warning
from octoform.endpoint.client.check_verdict import CheckReport, SampleCallResult, has_content
from octoform.engine.apply import apply
from octoform.engine.results import RunResult
from octoform.state.layout import Layout
from octoform.views.apply import closing


def checked(project: Path, calls: list[dict[str, Any]]) -> Layout:
    layout = Layout(project, "bench")
    layout.endpoint.mkdir(parents=True)
    (layout.endpoint / "check.json").write_text(json.dumps({"calls": calls}))
    return layout


def called(tool: str, ok: bool, **more: Any) -> dict[str, Any]:
    return {"tool": tool, "ok": ok, "skipped": None, "ms": 4.0, **more}


def ended(project: Path, well: int, badly: int, **more: Any) -> RunResult:
    calls = [called(f"read_{at}", at < well) for at in range(well + badly)]
    layout = checked(project, [*calls, {"tool": "skipped", "ok": False, "skipped": "needs an argument"}])
    return apply.rights(layout, RunResult("apply", "bench", **{"added": 1, **more}), {})


def test_an_apply_most_of_whose_read_tools_did_not_answer_is_incomplete(tmp_path: Path) -> None:
    result = ended(tmp_path, 8, 17)
    assert result.silent == "17 of 25 read tools did not answer"
    assert closing(result).startswith("Apply incomplete: 17 of 25 read tools did not answer, see above.")


@pytest.mark.parametrize(("well", "badly", "more"), [(2, 2, {}), (3, 0, {}), (0, 0, {}), (1, 9, {"added": 0})])
def test_a_few_that_failed_and_a_check_of_another_run_leave_it_complete(
    tmp_path: Path, well: int, badly: int, more: dict[str, int]
) -> None:
    result = ended(tmp_path, well, badly, **more)
    assert (result.silent, closing(result).startswith("Apply complete!")) == ("", True)


def test_an_endpoint_none_of_whose_tools_answered_is_told_by_its_finding(tmp_path: Path) -> None:
    result = ended(tmp_path, 1, 0, diagnostics=(warning("ENDPOINT-NOTHING-ANSWERS", "0 of 3 read tools answered"),))
    assert result.silent == "no read tool answered"


def test_a_recorded_host_is_told_of_and_what_cannot_be_opened_there_is_no_fault_of_the_apply(tmp_path: Path) -> None:
    layout = checked(tmp_path, [called("read_1", True), called("read_2", False), called("read_3", False)])
    result = apply.rights(layout, RunResult("apply", "bench", added=1), {"OCTOFORM_SYSROOT": "/hosts/x"})
    assert (result.recorded, result.silent) == ("/hosts/x", "")


@pytest.mark.parametrize(
    ("result", "says"),
    [
        ({"formats": []}, False),
        ({"device": "usb-1", "on": None}, False),
        ({"state": "unknown", "level": ""}, False),
        ([], False),
        (None, False),
        ({"lights": [{"on": None}]}, False),
        ({"pressed": False}, True),
        ({"temperature_celsius": 0}, True),
        ({"lights": [{"on": None}, {"on": True}]}, True),
        ("text", True),
    ],
)
def test_an_answer_without_content_is_no_proof(result: Any, says: bool) -> None:
    assert has_content(result) is says


def test_the_last_lines_prefer_a_tool_whose_answer_has_content() -> None:
    calls = [called("formats", True, content=False), called("broken", False), called("power", True, content=True)]
    assert list(apply.answering(calls)) == ["power", "formats"]


@pytest.mark.parametrize("damage", [{"ms": [4]}, {"ms": "4"}, {"tool": ["read"]}, {"tool": None}, {"skipped": {}}])
def test_calls_of_another_form_are_none(tmp_path: Path, damage: dict[str, Any]) -> None:
    layout = checked(tmp_path, [called("power", True), {**called("read", True), **damage}])
    calls = apply._sample_calls(layout)
    assert apply.sample_answer(calls, apply.answering(calls)) is None


def test_a_tool_that_was_not_tried_is_counted_apart() -> None:
    calls = [called("read_1", True), called("read_2", False), {"tool": "read_3", "ok": False, "skipped": "a line"}]
    assert apply.sample_answer(calls, apply.answering(calls)) == (
        "read_1 answered in 4 ms; 1 of 2 read tools did, 1 not tried"
    )
    results = tuple(SampleCallResult(call["tool"], call["ok"], call["skipped"]) for call in calls)
    report = CheckReport(True, None, None, None, (), results, 1.0)
    assert calls_text(report) == "1 of 2 read tools answered, 1 not tried"


def test_a_tool_that_answered_with_nothing_is_named() -> None:
    calls = [called("read_1", True, content=True), called("read_2", True, content=False)]
    assert apply.sample_answer(calls, apply.answering(calls)) == (
        "read_1 answered in 4 ms; 2 of 2 read tools did, read_2 with nothing in it"
    )
    results = ({"device": "one", "on": True}, {"device": "one", "on": None})
    report = CheckReport(
        True,
        None,
        None,
        None,
        (),
        tuple(SampleCallResult(f"read_{at + 1}", True, results=(each,)) for at, each in enumerate(results)),
        1.0,
    )
    assert calls_text(report) == "2 of 2 read tools answered, read_2 with nothing in it"
