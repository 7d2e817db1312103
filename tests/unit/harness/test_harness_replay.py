"""The replay harness: a recording is played as it is, and what is broken in one is said, not guessed."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from octoform.diagnostics import Diagnostic
from octoform.harness.adapters import resolve
from octoform.harness.port import (
    AgentEvent,
    ExitReason,
    Outcome,
    Output,
    Task,
    TaskLimits,
    ToolCalled,
    Totals,
    Turn,
    Usage,
)
from octoform.harness.recording import Recording, load
from octoform.manifest.model import HarnessSpec

TRANSCRIPT = [
    {"at": 0.5, "event": "said", "text": "I look at {project}"},
    {"at": 1.0, "event": "tool_called", "tool": "bash", "text": "ls /sys"},
    {"at": 1.2, "event": "tool_returned", "failed": True},
    {"at": 2.0, "event": "turn", "usage": {"input_tokens": 10, "output_tokens": 2}},
    {"at": 3.0, "event": "turn", "usage": {"input_tokens": 20, "output_tokens": 3}},
    {"at": 3.5, "event": "totals", "usage": {"input_tokens": 31, "output_tokens": 5, "cost_usd": 0.25}},
    {"at": 4.0, "event": "closed", "ok": True, "text": "done"},
]
BAD = {"reason": "finished", "harness": "pi", "refused": ["ARTIFACT-NOT-JSON"], "exit_status": 0}
GOOD = {"reason": "finished", "harness": "pi", "accepted": True, "exit_status": 0, "turns": 2, "program": "pi 1.2"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A recording of PROBE: an attempt that left no JSON, then a good one with an edit of the spec."""
    made = tmp_path / "recording"
    for name, text in {
        "probe-1/output.json": "{",
        "probe-2/output.json": '{"good": true}',
        "probe-2/spec.md": "# corrected\n",
        "probe-2/transcript.jsonl": "".join(json.dumps(line) + "\n" for line in TRANSCRIPT),
    }.items():
        (made / name).parent.mkdir(parents=True, exist_ok=True)
        (made / name).write_text(text)
    write(made, [{**BAD, "output": output(1)}, {**GOOD, "output": output(2), "usage": usage(), **files(2)}])
    return made


def output(number: int) -> dict[str, str]:
    return {"kind": "file", "name": "output.json", "file": f"probe-{number}/output.json"}


def usage() -> dict[str, Any]:
    return {"input_tokens": 31, "cached_tokens": 7, "output_tokens": 5, "cost_usd": 0.25, "cost_source": "manifest"}


def files(number: int) -> dict[str, str]:
    return {"spec_edit": f"probe-{number}/spec.md", "transcript": f"probe-{number}/transcript.jsonl"}


def write(folder: Path, attempts: list[dict[str, Any]], **more: object) -> None:
    folder.mkdir(exist_ok=True)
    document = {"format": 1, "octoform": "0.1.0", "stages": {"probe": attempts}, **more}
    (folder / "recording.json").write_text(json.dumps(document))


Play = Callable[..., tuple[Outcome, Task, list[tuple[AgentEvent, float, Usage]]]]


@pytest.fixture
def play(tmp_path: Path) -> Play:
    """``play(folder, attempt)`` runs the harness on a task; outcome, task and the events that it sent."""

    def run(folder: Path, attempt: int = 1, stage: str = "probe") -> Any:
        harness = resolve(HarnessSpec("replay", recording=folder), {})
        assert not isinstance(harness, Diagnostic), harness
        workdir = tmp_path / f"attempt-{stage}-{attempt}"
        workdir.mkdir()
        (workdir / "spec.md").write_text("# given\n")
        task = Task(
            stage=stage,
            attempt=attempt,
            workdir=workdir,
            prompt=workdir / "prompt.md",
            output=workdir / "output.json",
            log=workdir / "agent.log",
            document=workdir / "task.json",
            model=None,
            environment={},
            limits=TaskLimits(30.0, turns=1, usd=0.01),
        )
        lines: list[tuple[AgentEvent, float, Usage]] = []
        return harness.run(task, lambda event, at, used: lines.append((event, at, used))), task, lines

    return run


def test_a_failed_attempt_is_played_as_it_failed(folder: Path, play: Play) -> None:
    outcome, task, found = play(folder, 1)
    assert (outcome.reason, outcome.exit_status) == (ExitReason.FINISHED, 0)
    assert task.output.read_text() == "{"
    assert (task.workdir / "spec.md").read_text() == "# given\n"
    assert found == []


def test_the_good_attempt_with_all_that_it_did(folder: Path, play: Play) -> None:
    outcome, task, found = play(folder, 2)
    assert task.output.read_text() == '{"good": true}'
    assert (task.workdir / "spec.md").read_text() == "# corrected\n"
    assert outcome.usage == Usage(31, 7, 5, 0.25, "manifest")
    assert (outcome.turns, outcome.program) == (2, "pi 1.2")
    assert outcome.seconds < 3.0, "a replay does not wait as the agent did"
    assert [at for _, at, _ in found] == [line["at"] for line in TRANSCRIPT]
    assert found[0][0] == Output("I look at {project}")
    assert found[1][0] == ToolCalled("bash", "ls /sys")
    assert [used.input_tokens for event, _, used in found if isinstance(event, Turn | Totals)] == [10, 30, 31]
    assert task.transcript.read_bytes() == (folder / "probe-2/transcript.jsonl").read_bytes()
    assert task.log.read_text() == "I look at {project}\n"


def test_the_last_attempt_repeats(folder: Path, play: Play) -> None:
    assert play(folder, 7)[1].output.read_text() == '{"good": true}'


@pytest.mark.parametrize("reason", [item for item in ExitReason if item is not ExitReason.FINISHED])
def test_each_reason_comes_back(tmp_path: Path, play: Play, reason: ExitReason) -> None:
    write(tmp_path / "r", [{"reason": reason.value, "harness": "pi", "detail": "said so", "exit_status": -9}])
    outcome, task, _ = play(tmp_path / "r")
    assert (outcome.reason, outcome.detail, outcome.exit_status) == (reason, "said so", -9)
    assert not task.output.exists()


@pytest.mark.parametrize("code", ["APPLY-OUTSIDE-WRITE", "APPLY-SECRET-IN-OUTPUT"])
def test_what_is_not_done_again_is_still_no_success(folder: Path, play: Play, code: str) -> None:
    write(folder, [{**GOOD, "accepted": False, "refused": [code], "output": output(2)}])
    outcome, _, _ = play(folder)
    assert outcome.reason is ExitReason.CRASHED
    assert code in outcome.detail


def test_an_output_that_was_no_file_is_none_again(tmp_path: Path, play: Play) -> None:
    left = [{"kind": "link", "name": "output.json"}, {"kind": "large", "name": "output.json", "size": 9 << 20}]
    write(tmp_path / "r", [{**BAD, "output": item} for item in left])
    assert play(tmp_path / "r", 1)[1].output.is_symlink()
    assert play(tmp_path / "r", 2)[1].output.stat().st_size == 9 << 20


def test_a_spec_copy_that_is_a_link_is_replaced_and_not_followed(folder: Path, tmp_path: Path, play: Play) -> None:
    outside = tmp_path / "outside.md"
    outside.write_text("mine\n")
    harness = resolve(HarnessSpec("replay", recording=folder), {})
    assert not isinstance(harness, Diagnostic)
    _, task, _ = play(folder, 2)
    (task.workdir / "spec.md").unlink()
    (task.workdir / "spec.md").symlink_to(outside)
    task.output.unlink()
    harness.run(task, lambda *_: None)
    assert outside.read_text() == "mine\n"
    assert (task.workdir / "spec.md").read_text() == "# corrected\n"


def test_a_stage_that_was_not_recorded_cannot_be_started(folder: Path, play: Play) -> None:
    outcome, task, _ = play(folder, stage="identify")
    assert outcome.reason is ExitReason.NOT_INSTALLED
    assert "identify" in outcome.detail
    assert not task.output.exists()


def test_a_file_that_went_between_plan_and_run_is_named(folder: Path, play: Play, tmp_path: Path) -> None:
    harness = resolve(HarnessSpec("replay", recording=folder), {})
    assert not isinstance(harness, Diagnostic)
    _, task, _ = play(folder, 1)
    (folder / "probe-1/output.json").unlink()
    outcome = harness.run(task, lambda *_: None)
    assert outcome.reason is ExitReason.NOT_INSTALLED
    assert "probe-1/output.json" in outcome.detail


def test_the_answer_for_an_escalation_is_not_in_a_recording(folder: Path, play: Play) -> None:
    harness = resolve(HarnessSpec("replay", recording=folder), {})
    assert not isinstance(harness, Diagnostic)
    _, task, _ = play(folder, 1)
    (task.workdir / "input.json").write_text("{}")
    assert "escalate" in harness.run(task, lambda *_: None).detail


def problem(folder: Path | None) -> Diagnostic:
    found = resolve(HarnessSpec("replay", recording=folder), {})
    assert isinstance(found, Diagnostic)
    return found


def test_no_recording(tmp_path: Path) -> None:
    assert problem(None).code == "HARNESS-NO-RECORDING"
    assert problem(tmp_path / "nowhere").code == "HARNESS-NO-RECORDING"
    assert problem(tmp_path).code == "HARNESS-NO-RECORDING"


def test_a_recording_of_a_later_format_says_so(folder: Path) -> None:
    write(folder, [], format=2)
    found = problem(folder)
    assert found.code == "HARNESS-RECORDING-BROKEN"
    assert "format 2" in str(found.detail)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{",
        "nonsense",
        '{"format": 1}',
        '{"format": 1, "octoform": "1", "stages": {"probe": [{}]}}',
        "[" * 9000,
    ],
)
def test_what_is_no_recording_is_refused(folder: Path, text: str) -> None:
    (folder / "recording.json").write_text(text)
    assert problem(folder).code == "HARNESS-RECORDING-BROKEN"


@pytest.mark.parametrize("name", ["../secret", "/etc/passwd", "probe-1/../../x", "output.json", "probe-1/.x", ""])
def test_a_name_that_leads_outside_is_refused(folder: Path, name: str) -> None:
    write(folder, [{**GOOD, "output": {"kind": "file", "name": "output.json", "file": name}}])
    assert problem(folder).code == "HARNESS-RECORDING-BROKEN"


@pytest.mark.parametrize("place", ["file", "folder", "document"])
def test_a_link_is_not_followed(folder: Path, tmp_path: Path, place: str) -> None:
    target = {"file": "probe-1/output.json", "folder": "probe-1", "document": "recording.json"}[place]
    moved = tmp_path / "elsewhere"
    (folder / target).rename(moved)
    (folder / target).symlink_to(moved)
    assert problem(folder).code in ("HARNESS-RECORDING-BROKEN", "STATE-LINK")


def test_a_missing_file_is_named(folder: Path) -> None:
    (folder / "probe-2/spec.md").unlink()
    assert "probe-2/spec.md" in str(problem(folder).detail)


def test_unknown_fields_of_a_later_octoform_are_no_mistake(folder: Path) -> None:
    write(folder, [{**GOOD, "mood": "fine", "output": output(2)}])
    assert isinstance(load(folder), Recording)
