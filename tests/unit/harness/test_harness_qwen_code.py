"""Qwen Code's events and debug log, as they were printed, in the words of the port; and how the program is started."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from unit.harness.program_streams import SECRET, invoked, lines, nowhere_in_files, of, recorded, without_turns

from octoform.harness.adapters.qwen_code import QwenCode, QwenCodeDialect
from octoform.harness.port import (
    Closed,
    ExitReason,
    ModelProblem,
    Output,
    Replying,
    ToolCalled,
    ToolReturned,
    Totals,
    Turn,
    Usage,
)
from octoform.manifest.model import HarnessSpec

REPLY = Usage(1000, 400, 50)
SPEC = HarnessSpec("qwen-code", key="LOOP_KEY", base_url="http://127.0.0.1:8080")
STOP = {"type": "stream_event", "event": {"type": "message_stop"}}
LOGGED = "2026-11-21T16:52:39.610Z "


def compact(value: dict[str, Any]) -> bytes:
    """An event as the program writes it."""
    return json.dumps(value, separators=(",", ":")).encode()


def test_a_run_that_went_well() -> None:
    events = recorded(QwenCodeDialect(), "qwen-code-ok")
    assert of(events, Turn) == [Turn(REPLY)] * 2, "words and call of a reply come in two messages"
    assert without_turns(events) == [
        Output("I write it."),
        ToolCalled("run_shell_command", 'echo {} > "$OCTOFORM_OUTPUT"'),
        ToolReturned(),
        Output("done"),
        Totals(Usage(2000, 800, 100)),
        Closed(ok=True),
    ]


def test_calls_that_cannot_be_done_are_replies_too() -> None:
    events = recorded(QwenCodeDialect(), "qwen-code-bad")
    assert of(events, Turn) == [Turn(REPLY)] * 6, "one of them was asked for again"
    assert [event.failed for event in of(events, ToolReturned)] == [True, True, True, False, False]
    assert of(events, ModelProblem) == []
    assert of(events, Totals) == [Totals(Usage(6000, 2400, 300))]


@pytest.mark.parametrize(
    ("name", "reason", "told"),
    [
        ("auth", ExitReason.AUTH, "This API key is not valid"),
        ("down", ExitReason.UNREACHABLE, "Connection error"),
        ("cut", ExitReason.UNREACHABLE, "other side closed"),
        ("loop", ExitReason.TURN_LIMIT, "repeated the same tool call"),
    ],
)
def test_how_it_gives_up(name: str, reason: ExitReason, told: str) -> None:
    events = recorded(QwenCodeDialect(), f"qwen-code-{name}")
    troubles = of(events, ModelProblem)
    assert {event.reason for event in troubles} == {reason}
    assert [event.final for event in troubles] == [name == "auth"] * (len(troubles) - 1) + [True]
    assert told in troubles[-1].text
    assert events[-1] is troubles[-1]
    assert len(of(events, Turn)) == (4 if name == "loop" else 0), "its own words in place of a reply are none"
    assert len(of(events, Output)) == 0


def test_each_failed_attempt_is_told() -> None:
    troubles = of(recorded(QwenCodeDialect(), "qwen-code-rate"), ModelProblem)
    assert len(troubles) == 4
    assert {(event.reason, event.final) for event in troubles} == {(ExitReason.RATE_LIMIT, False)}
    assert troubles[1].text == "Attempt 1 failed with status 429. Retrying with backoff in 2s..."


def test_its_own_limit_of_turns_is_told_on_standard_error_alone() -> None:
    found = of(recorded(QwenCodeDialect(), "qwen-code-turns"), ModelProblem)
    assert [(event.reason, event.final) for event in found] == [(ExitReason.TURN_LIMIT, True)]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("[ERROR] [RETRY] Attempt 3 failed with status 503. Retrying with backoff in 2s... {", ExitReason.UNREACHABLE),
        ("[WARN] [RETRY] Attempt 1 failed. Retrying with backoff in 2s... {", ExitReason.UNREACHABLE),
        ("[WARN] [RETRY] Attempt 1 failed with status 529. Retrying after explicit delay", ExitReason.UNREACHABLE),
        ("[ERROR] [OPENAI_ERROR] OpenAI API Error: 429 You exceeded your quota 500 {", ExitReason.RATE_LIMIT),
        ("[ERROR] [OPENAI_ERROR] OpenAI API Error: 404 no such model {", ExitReason.REFUSED),
    ],
)
def test_what_its_log_means(line: str, reason: ExitReason) -> None:
    (found,) = lines(QwenCodeDialect(), "stderr", (LOGGED + line).encode())
    assert isinstance(found, ModelProblem)
    assert (found.reason, found.final) == (reason, reason is ExitReason.REFUSED)
    assert not found.text.endswith("{")


def test_what_its_results_mean() -> None:
    def result(message: str) -> list[Any]:
        error = {"type": "result", "subtype": "error_during_execution", "is_error": True, "error": {"message": message}}
        return lines(QwenCodeDialect(), "stdout", error)

    missing = "Missing API key for OpenAI-compatible auth. Set settings.security.auth.apiKey, or set a variable."
    assert result(missing) == [ModelProblem(ExitReason.AUTH, missing, final=True)]
    odd = "[API Error: the model is gone]"
    assert result(odd) == [ModelProblem(ExitReason.CRASHED, odd, final=True)]


def test_a_service_that_counts_no_tokens() -> None:
    content = [{"type": "text", "text": "I do."}]
    message = {"role": "assistant", "content": content, "usage": {"input_tokens": 0, "output_tokens": 0}}
    found = lines(QwenCodeDialect(), "stdout", {"type": "assistant", "message": message}, compact(STOP), compact(STOP))
    assert found == [Output("I do."), Turn()]


def test_nothing_strange_is_an_event() -> None:
    strange = (b"", b"Ripgrep not available", b"[]", b'{"type":7}', b'{"type":"user","message":{"content":"x"}}')
    assert lines(QwenCodeDialect(), "stdout", *strange, b'{"type":"system","subtype":"retry"}') == []
    log = (f"{LOGGED}[DEBUG] [RETRY] Attempt".encode(), f"{LOGGED}[ERROR] [GIT] Failed with status 401".encode())
    assert lines(QwenCodeDialect(), "stderr", *strange, *log, b"  statusCode: 429,") == []
    piece = {"type": "stream_event", "uuid": "1", "event": {"type": "content_block_delta"}}
    assert lines(QwenCodeDialect(), "stdout", compact(piece), compact(STOP)) == [Replying()]


@pytest.mark.parametrize(
    ("api", "way", "variables"),
    [
        ("openai-completions", "openai", {"OPENAI_API_KEY": SECRET, "OPENAI_BASE_URL": "http://127.0.0.1:8080/v1"}),
        ("openai-responses", "openai-responses", {"OPENAI_BASE_URL": "http://127.0.0.1:8080/v1"}),
        (
            "anthropic-messages",
            "anthropic",
            {"ANTHROPIC_API_KEY": SECRET, "ANTHROPIC_BASE_URL": "http://127.0.0.1:8080"},
        ),
        ("gemini", "gemini", {"GEMINI_API_KEY": SECRET, "GOOGLE_GEMINI_BASE_URL": "http://127.0.0.1:8080"}),
    ],
)
def test_how_it_is_started(tmp_path: Path, api: str, way: str, variables: dict[str, str]) -> None:
    found = invoked(QwenCode(), replace(SPEC, api=api), "openai/gpt-5", tmp_path, turns=40)
    assert found.argv[:5] == ("/opt/it", "--auth-type", way, "--model", "gpt-5")
    assert found.argv[-3:] == ("--bare", "--max-session-turns", "45")
    assert found.stdin == tmp_path / "prompt.md"
    assert (found.path, found.program, found.named) == (("/opt/node",), "qwen 1.2.3", ("LOOP_KEY",))
    assert variables.items() <= found.settings.items()
    assert SECRET not in " ".join(found.argv)
    nowhere_in_files(tmp_path)


def test_its_debug_log_is_its_standard_error(tmp_path: Path) -> None:
    found = invoked(QwenCode(), SPEC, "openai/gpt-5", tmp_path)
    session = found.argv[found.argv.index("--session-id") + 1]
    assert (tmp_path / "home" / ".qwen" / "debug" / f"{session}.txt").readlink() == Path("/dev/stderr")
    assert found.settings["QWEN_DEBUG_LOG_FILE"] == "1"


def test_what_the_manifest_chooses(tmp_path: Path) -> None:
    found = invoked(QwenCode(), replace(SPEC, web_search=True, env=("HTTPS_PROXY",)), "openai/gpt-5", tmp_path)
    assert found.argv[-1] == "--safe-mode"
    assert found.named == ("HTTPS_PROXY", "LOOP_KEY")


def test_a_model_that_needs_no_key(tmp_path: Path) -> None:
    found = invoked(QwenCode(), HarnessSpec("qwen-code"), "ollama/qwen3", tmp_path)
    assert found.settings["OPENAI_API_KEY"] == "none"
    assert found.settings["OPENAI_BASE_URL"] == "http://127.0.0.1:11434/v1"
