"""Claude Code's stream, as it was printed, in the words of the port; and how the program is started."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from unit.harness.program_streams import SECRET, invoked, lines, nowhere_in_files, of, recorded, without_turns

from octoform.harness.adapters.claude_code import ClaudeCode, ClaudeCodeDialect
from octoform.harness.port import (
    AgentEvent,
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
SPEC = HarnessSpec("claude-code", key="LOOP_KEY", base_url="http://127.0.0.1:8080")


def test_a_run_that_went_well() -> None:
    assert recorded(ClaudeCodeDialect(), "claude-code-ok") == [
        Output("I write it."),
        ToolCalled("Bash", 'echo {} > "$OCTOFORM_OUTPUT"'),
        Turn(REPLY),
        ToolReturned(),
        Output("done"),
        Turn(REPLY),
        Totals(Usage(2000, 800, 100)),
        Closed(ok=True, text="done"),
    ]


def test_calls_that_cannot_be_done() -> None:
    events = recorded(ClaudeCodeDialect(), "claude-code-bad")
    assert [event.failed for event in of(events, ToolReturned)] == [True, True, True, False]
    assert [event.tool for event in of(events, ToolCalled)] == ["Bash", "no_such_tool", "Bash", "Bash"]
    assert of(events, Turn) == [Turn(REPLY)] * 5
    assert of(events, ModelProblem) == []


def test_requests_that_are_tried_again_and_a_reply_that_is_cut_is_none() -> None:
    events = recorded(ClaudeCodeDialect(), "claude-code-flaky")
    assert [(event.reason, event.final) for event in of(events, ModelProblem)] == [(ExitReason.UNREACHABLE, False)] * 2
    assert of(events, Turn) == [Turn(REPLY)] * 2
    assert events[-2:] == [Totals(Usage(3000, 1200, 101)), Closed(ok=True, text="done")]


@pytest.mark.parametrize(
    ("name", "reason", "told"),
    [
        ("auth", ExitReason.AUTH, "401"),
        ("late", ExitReason.UNREACHABLE, "API Error: 500"),
        ("down", ExitReason.UNREACHABLE, "ECONNREFUSED"),
        ("loop", ExitReason.TURN_LIMIT, "limit of turns"),
    ],
)
def test_how_it_gives_up(name: str, reason: ExitReason, told: str) -> None:
    events = recorded(ClaudeCodeDialect(), f"claude-code-{name}")
    assert isinstance(events[-1], ModelProblem)
    assert (events[-1].reason, events[-1].final) == (reason, True)
    assert told in events[-1].text
    assert of(events, Closed) == []
    assert all(isinstance(event, ModelProblem | Totals) for event in events[-5:]), (
        "what it says for the model is no reply"
    )


def test_a_second_result_tells_of_the_whole_run_again() -> None:
    def result(fresh: int, models: dict[str, object]) -> dict[str, object]:
        return {"type": "result", "is_error": False, "usage": {"input_tokens": fresh}, "modelUsage": models}

    one = {"inputTokens": 100, "cacheReadInputTokens": 30, "cacheCreationInputTokens": 2, "outputTokens": 7}
    first, second = result(100, {"a": one}), result(1, {"a": one, "b": {"inputTokens": 1, "outputTokens": 1}})
    events = lines(ClaudeCodeDialect(), "stdout", first, second)
    assert of(events, Totals) == [Totals(Usage(132, 30, 7)), Totals(Usage(133, 30, 8))]


@pytest.mark.parametrize(
    ("models", "cost"),
    [
        ({"a": ("list", 0.5), "b": ("list", 0.25)}, 0.75),
        ({"a": ("list", 0.5), "b": ("unknown", 0.25)}, None),
        ({"a": ("list", None)}, None),
        ({"a": ("list", -1)}, None),
        ({"a": (None, 0.5)}, None),
    ],
)
def test_its_own_report_of_the_cost_counts_where_the_prices_are_its_makers(
    models: dict[str, tuple[str | None, float | None]], cost: float | None
) -> None:
    used = {name: {"inputTokens": 1, "costUSD": usd, "costBasis": basis} for name, (basis, usd) in models.items()}
    result = {"type": "result", "is_error": False, "usage": {"input_tokens": 1}, "modelUsage": used}
    (totals,) = of(lines(ClaudeCodeDialect(), "stdout", result), Totals)
    assert (totals.usage.cost_usd, totals.usage.cost_source) == (cost, None if cost is None else "claude-code")


def test_a_refused_key_is_final_at_once_and_a_limit_of_the_rate_is_not() -> None:
    retry = {"type": "system", "subtype": "api_retry", "attempt": 1, "max_retries": 4}
    dialect = ClaudeCodeDialect()
    refused = lines(dialect, "stdout", {**retry, "error_status": 401, "error": "authentication_failed"})
    assert refused == [ModelProblem(ExitReason.AUTH, "authentication_failed: HTTP status 401", final=True)]
    limited = lines(dialect, "stdout", {**retry, "error_status": 429, "error": "rate_limit"})
    assert limited == [ModelProblem(ExitReason.RATE_LIMIT, "rate_limit: HTTP status 429")]
    overloaded = lines(dialect, "stdout", {**retry, "error_status": 529, "error": "overloaded"})
    assert overloaded == [ModelProblem(ExitReason.UNREACHABLE, "overloaded: HTTP status 529")]


def test_no_key_at_all() -> None:
    fields: dict[str, Any] = {
        "is_error": True,
        "subtype": "success",
        "api_error_status": None,
        "result": "Not logged in · Please run /login",
    }
    events = lines(ClaudeCodeDialect(), "stdout", {**fields, "type": "result"})
    assert events == [ModelProblem(ExitReason.AUTH, fields["result"], final=True)]


def test_a_reply_in_one_piece_counts_once_however_many_parts_it_has() -> None:
    usage = {"input_tokens": 7, "cache_creation_input_tokens": 20, "cache_read_input_tokens": 3, "output_tokens": 5}
    parts = [{"type": "thinking", "thinking": "hm"}, {"type": "text", "text": "so"}]
    dialect = ClaudeCodeDialect()
    events: list[AgentEvent] = []
    for part in parts:
        message = {"id": "msg_1", "model": "m", "content": [part], "usage": usage}
        events += lines(dialect, "stdout", {"type": "assistant", "message": message})
    assert of(events, Turn) == [Turn(Usage(30, 3, 5))]
    assert without_turns(events) == [Output("so")]


def test_tokens_that_only_the_end_of_a_reply_tells() -> None:
    start = {"id": "m", "usage": {"input_tokens": 0, "output_tokens": 0}}
    end = {"input_tokens": 90, "cache_read_input_tokens": 10, "output_tokens": 8}
    framed = [
        {"type": "message_start", "message": start},
        {"type": "message_delta", "delta": {"stop_reason": "end_turn"}, "usage": end},
        {"type": "message_stop"},
    ]
    events = lines(ClaudeCodeDialect(), "stdout", *({"type": "stream_event", "event": event} for event in framed))
    assert events == [Replying(), Replying(), Turn(Usage(100, 10, 8))]


def test_pieces_keep_the_run_alive_and_nothing_strange_is_an_event() -> None:
    piece = b'{"type":"stream_event","event":{"type":"content_block_delta","index":0,"delta":{}}}'
    assert lines(ClaudeCodeDialect(), "stdout", piece) == [Replying()]
    strange = (
        b"",
        b"Warning",
        b"[]",
        b'{"type":7}',
        b'{"type":"assistant"}',
        b'{"type":"user","message":{"content":"x"}}',
    )
    assert lines(ClaudeCodeDialect(), "stdout", *strange) == []
    assert lines(ClaudeCodeDialect(), "stderr", b'{"type":"result","is_error":false}') == []


def test_how_it_is_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    found = invoked(ClaudeCode(), SPEC, "anthropic/claude-sonnet-4-5", tmp_path, turns=20, idle_seconds=120.0)
    assert found.argv[:2] == ("/opt/it", "-p")
    assert found.argv[-2:] == ("--max-turns", "25")
    assert found.argv[found.argv.index("--model") + 1] == "claude-sonnet-4-5"
    assert "Web" not in found.argv[found.argv.index("--tools") + 1]
    assert found.stdin == tmp_path / "prompt.md"
    assert (found.path, found.program) == ((str(tmp_path / "home" / "shells"), "/opt/node"), "claude 1.2.3")
    assert found.settings["ANTHROPIC_BASE_URL"] == "http://127.0.0.1:8080"
    assert found.settings["CLAUDE_CONFIG_DIR"] == str(tmp_path / "home" / ".claude")
    assert found.settings["IS_SANDBOX"] == "1"
    assert found.settings["BASH_MAX_TIMEOUT_MS"] == found.settings["BASH_DEFAULT_TIMEOUT_MS"] == "88000"
    assert (found.settings["ANTHROPIC_API_KEY"], found.settings["ANTHROPIC_AUTH_TOKEN"]) == (SECRET, "")
    assert found.named == ("LOOP_KEY",), "the value is redacted under whatever name the program gets it"
    assert SECRET not in " ".join(found.argv)
    nowhere_in_files(tmp_path)


def test_another_provider_takes_the_key_as_a_bearer(tmp_path: Path) -> None:
    spec = HarnessSpec("claude-code", key="LOOP_KEY", web_search=True)
    found = invoked(ClaudeCode(), spec, "openrouter/anthropic/claude-sonnet-4.5", tmp_path)
    assert (found.settings["ANTHROPIC_API_KEY"], found.settings["ANTHROPIC_AUTH_TOKEN"]) == ("", SECRET)
    assert found.settings["ANTHROPIC_BASE_URL"] == "https://openrouter.ai/api"
    assert found.argv[found.argv.index("--model") + 1] == "anthropic/claude-sonnet-4.5"
    assert "WebSearch" in found.argv[found.argv.index("--tools") + 1]
    assert "--max-turns" not in found.argv


def test_a_model_that_needs_no_key(tmp_path: Path) -> None:
    spec = replace(SPEC, key=None)
    found = invoked(ClaudeCode(), spec, "ollama/qwen3", tmp_path)
    assert found.settings["ANTHROPIC_AUTH_TOKEN"] == "none", "without any it does not start"
    assert found.named == ()
    assert "BASH_MAX_TIMEOUT_MS" not in found.settings
