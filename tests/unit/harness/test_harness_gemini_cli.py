"""Gemini CLI's events and its record of replies, as they were printed, in the words of the port; how it is started."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from unit.harness.program_streams import SECRET, STREAMS, invoked, lines, nowhere_in_files, of, recorded, without_turns

from octoform.harness.adapters.gemini_cli import GeminiCli, GeminiCliDialect
from octoform.harness.contained_attempt import Invocation, run_contained
from octoform.harness.port import (
    AgentEvent,
    Closed,
    ExitReason,
    ModelProblem,
    Output,
    Replying,
    Task,
    TaskLimits,
    ToolCalled,
    ToolReturned,
    Totals,
    Turn,
    Usage,
)
from octoform.manifest.model import HarnessSpec

REPLY = Usage(1000, 400, 50)
SPEC = HarnessSpec("gemini-cli", key="LOOP_KEY", base_url="http://127.0.0.1:8080")


def record(method: str, response: Any) -> bytes:
    """An answer of the model as the program records it."""
    return json.dumps({"method": method, "response": response}, separators=(",", ":")).encode()


def test_a_run_that_went_well() -> None:
    events = recorded(GeminiCliDialect(), "gemini-cli-ok")
    assert of(events, Turn) == [Turn(REPLY)] * 2
    assert without_turns(events) == [
        Output("I write it."),
        Totals(REPLY),
        Output("done"),
        Totals(Usage(2000, 800, 100)),
        ToolCalled("run_shell_command", 'echo {} > "$OCTOFORM_OUTPUT"'),
        ToolReturned(),
        Closed(ok=True),
    ]


def test_calls_that_cannot_be_done_are_replies_too_and_broken_ones_end_it() -> None:
    events = recorded(GeminiCliDialect(), "gemini-cli-bad")
    assert of(events, Turn) == [Turn(REPLY)] * 6, "it asks three times more when a call is broken"
    assert [event.failed for event in of(events, ToolReturned)] == [True, True]
    assert of(events, ModelProblem) == [], "the model's side did answer"
    assert events[-1] == Closed(ok=False, text="Model stream ended with malformed function call.")


@pytest.mark.parametrize(
    ("name", "reason", "told"),
    [
        ("auth", ExitReason.AUTH, "This API key is not valid"),
        ("late", ExitReason.UNREACHABLE, "The server had an error"),
        ("cut", ExitReason.UNREACHABLE, "terminated"),
        ("turns", ExitReason.TURN_LIMIT, "Reached max session turns"),
    ],
)
def test_how_it_gives_up(name: str, reason: ExitReason, told: str) -> None:
    events = recorded(GeminiCliDialect(), f"gemini-cli-{name}")
    troubles = of(events, ModelProblem)
    assert {event.reason for event in troubles} == {reason}
    assert [event.final for event in troubles] == [False] * (len(troubles) - 1) + [True]
    assert told in troubles[-1].text
    assert events[-1] is troubles[-1]


def test_each_failed_attempt_is_told() -> None:
    down = of(recorded(GeminiCliDialect(), "gemini-cli-down"), ModelProblem)
    assert [(event.reason, event.final) for event in down] == [(ExitReason.UNREACHABLE, False)] * 2
    flaky = recorded(GeminiCliDialect(), "gemini-cli-flaky")
    assert [event.reason for event in of(flaky, ModelProblem)] == [ExitReason.UNREACHABLE, ExitReason.RATE_LIMIT]
    assert events_after_trouble(flaky)[0] == Output("I write it.")
    assert flaky[-1] == Closed(ok=True)


def events_after_trouble(events: list[AgentEvent]) -> list[AgentEvent]:
    last = max(place for place, event in enumerate(events) if isinstance(event, ModelProblem))
    return events[last + 1 :]


def test_its_guard_against_loops_is_no_success() -> None:
    """Recorded with the guard, which octoform switches off; another version may know no such switch."""
    events = recorded(GeminiCliDialect(), "gemini-cli-loop")
    assert of(events, ModelProblem) == [
        ModelProblem(ExitReason.TURN_LIMIT, "Loop detected, stopping execution", final=True)
    ]


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (
            '[API Error: {"error":{"code":503,"message":"The model is overloaded.","status":"X"}}]',
            ExitReason.UNREACHABLE,
        ),
        ('[API Error: {"error":{"code":400,"message":"API key not valid. Please pass one."}}]', ExitReason.AUTH),
        ('[API Error: {"error":{"code":403,"message":"Not with this project."}}]', ExitReason.AUTH),
        ("[API Error: You exceeded your current quota]", ExitReason.RATE_LIMIT),
        ("[API Error: exception TypeError: fetch failed sending request]", ExitReason.UNREACHABLE),
        ('[API Error: {"error":{"code":404,"message":"no such model"}}]', ExitReason.REFUSED),
    ],
)
def test_what_its_messages_mean(message: str, reason: ExitReason) -> None:
    assert lines(GeminiCliDialect(), "stdout", failed(message)) == [ModelProblem(reason, message, final=True)]


def failed(message: str) -> dict[str, Any]:
    return {"type": "result", "status": "error", "error": {"type": "unknown", "message": message}, "stats": {}}


def test_words_that_say_nothing_mean_what_the_attempt_before_failed_with() -> None:
    dialect = GeminiCliDialect()
    lines(dialect, "stderr", b"Attempt 1 failed with status 429. Retrying with backoff... _ApiError: {}")
    lines(dialect, "stderr", b"Attempt 2 failed: later. Max attempts reached")
    assert [event.reason for event in of(lines(dialect, "stdout", failed("later")), ModelProblem)] == [
        ExitReason.RATE_LIMIT
    ]
    lines(dialect, "stderr", record("generateContentStream", []))
    assert [event.reason for event in of(lines(dialect, "stdout", failed("later")), ModelProblem)] == [
        ExitReason.CRASHED
    ]


def test_a_key_that_is_not_there() -> None:
    (found,) = lines(
        GeminiCliDialect(),
        "stderr",
        b"When using Gemini API, you must specify the GEMINI_API_KEY environment variable.",
        b"Update your environment and try again (no reload needed if using .env)!",
    )
    assert isinstance(found, ModelProblem)
    assert (found.reason, found.final) == (ExitReason.AUTH, True)


def test_thoughts_are_output_and_no_words() -> None:
    thought = {"candidates": [{"content": {"parts": [{"text": "hm", "thought": True}]}}], "usageMetadata": {}}
    counts = {"promptTokenCount": 10, "toolUsePromptTokenCount": 5, "candidatesTokenCount": 2, "thoughtsTokenCount": 7}
    pieces = [
        thought,
        {"candidates": [{"content": {"parts": [{"text": "I "}]}}], "usageMetadata": {"promptTokenCount": 10}},
        {"candidates": [{"content": {"parts": [{"text": "do."}]}}], "usageMetadata": counts},
    ]
    used = Usage(15, None, 9)
    found = lines(GeminiCliDialect(), "stderr", record("generateContentStream", pieces))
    assert found == [Output("I do."), Turn(used), Totals(used)]


def test_what_it_asks_beside_the_conversation_costs_and_is_no_reply() -> None:
    piece = {"candidates": [], "usageMetadata": {"promptTokenCount": 10, "candidatesTokenCount": 2}}
    answers = (record("generateContentStream", [piece]), record("generateContent", piece))
    found = lines(GeminiCliDialect(), "stderr", *answers)
    assert found == [Turn(Usage(10, None, 2)), Totals(Usage(10, None, 2)), Totals(Usage(20, None, 4))]


def test_nothing_strange_is_an_event() -> None:
    strange = (b"", b"Warning: Basic terminal detected", b"[]", b'{"type":7}', b'{"type":"message","role":"user"}')
    assert lines(GeminiCliDialect(), "stdout", *strange) == []
    assert lines(GeminiCliDialect(), "stderr", *strange, b"Attempt to lie", b"  status: 429") == []
    broken = (b'{"method":"generateContentStream","response":7}', b'{"method":"generateContentStream"}')
    assert of(lines(GeminiCliDialect(), "stderr", *broken), Turn) == [Turn()] * 2
    piece = {"type": "message", "role": "assistant", "content": "I d", "delta": True}
    assert lines(GeminiCliDialect(), "stdout", piece) == [Replying()]


def test_how_it_is_started(tmp_path: Path) -> None:
    found = invoked(GeminiCli(), SPEC, "gemini/gemini-3-flash", tmp_path, turns=40)
    assert found.argv[:3] == ("/opt/it", "--model", "gemini-3-flash")
    assert found.stdin == tmp_path / "prompt.md"
    assert found.path == (str(tmp_path / "home" / "shells"), "/opt/node")
    assert (found.program, found.named) == ("gemini 1.2.3", ("LOOP_KEY",))
    assert found.settings["GOOGLE_GEMINI_BASE_URL"] == "http://127.0.0.1:8080"
    settings = configured(tmp_path)
    assert settings["tools"]["exclude"] == ["google_web_search", "web_fetch"]
    assert settings["model"] == {"disableLoopDetection": True, "maxSessionTurns": 45}
    assert SECRET not in " ".join(found.argv)
    nowhere_in_files(tmp_path)


def test_what_the_manifest_chooses(tmp_path: Path) -> None:
    spec = replace(SPEC, web_search=True, env=("HTTPS_PROXY",))
    found = invoked(GeminiCli(), spec, "google/gemini-3-flash", tmp_path)
    assert found.named == ("HTTPS_PROXY", "LOOP_KEY")
    assert configured(tmp_path)["tools"]["exclude"] == []
    assert configured(tmp_path)["model"]["maxSessionTurns"] == -1


def test_a_model_that_needs_no_key(tmp_path: Path) -> None:
    found = invoked(GeminiCli(), replace(SPEC, key=None), "gemini/scripted", tmp_path)
    assert (found.settings["GEMINI_API_KEY"], found.named) == ("none", ())


def configured(folder: Path) -> dict[str, Any]:
    """The program's settings as it reads them."""
    found = json.loads((folder / "home" / ".gemini" / "settings.json").read_text(encoding="utf-8"))
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize(("last", "reason"), [("", ExitReason.CRASHED), ("1", ExitReason.FINISHED)])
def test_an_end_without_its_closing_word_is_none_of_its_own(tmp_path: Path, last: str, reason: ExitReason) -> None:
    """It leaves with status 0 when it is ended from outside."""
    stream = (STREAMS / "gemini-cli-ok.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    (tmp_path / "stream").write_text("".join(stream if last else stream[:-1]), encoding="utf-8")
    spec = replace(SPEC, command=("/opt/it",))
    invocation = invoked(GeminiCli(), spec, "gemini/scripted", tmp_path)
    printing = replace(invocation, argv=("cat", "stream"), path=("/usr/bin", "/bin"))
    outcome = run_contained(a_task(tmp_path, printing), printing, lambda *told: None)
    assert (outcome.exit_status, outcome.reason) == (0, reason)
    assert ("without a word" in outcome.detail) is not bool(last)


def a_task(folder: Path, invocation: Invocation) -> Task:
    assert invocation.stdin is not None
    return Task(
        stage="probe",
        attempt=1,
        workdir=folder,
        prompt=invocation.stdin,
        output=folder / "output.json",
        log=folder / "task.log",
        document=folder / "task.json",
        model="gemini/scripted",
        environment={"PATH": "/usr/bin:/bin"},
        limits=TaskLimits(30.0),
    )


@pytest.mark.parametrize(("code", "reason"), [(404, ExitReason.REFUSED), (429, ExitReason.RATE_LIMIT)])
def test_words_without_a_status_have_that_of_standard_error(code: int, reason: ExitReason) -> None:
    dialect = GeminiCliDialect()
    assert lines(dialect, "stderr", b"Error when talking to Gemini API", b"  code: %d" % code, b"}") == []
    assert lines(dialect, "stdout", failed("[API Error: Come back tomorrow.]")) == [
        ModelProblem(reason, "[API Error: Come back tomorrow.]", final=True)
    ]
