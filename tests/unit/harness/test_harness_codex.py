"""Codex's events and trace, as they were printed, in the words of the port; and how the program is started."""

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from unit.harness.program_streams import SECRET, invoked, lines, nowhere_in_files, of, recorded, without_turns

from octoform.harness.adapters.codex import Codex, CodexDialect
from octoform.harness.contained_attempt import Invocation
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
SPEC = HarnessSpec("codex", key="LOOP_KEY", base_url="http://127.0.0.1:8080")
TRACED = '2026-11-21T16:54:03.430914Z  INFO codex_otel.log_only: event.name="codex.sse_event" event.kind='


def test_a_run_that_went_well() -> None:
    events = recorded(CodexDialect(), "codex-ok")
    assert of(events, Turn) == [Turn(REPLY)] * 2
    assert without_turns(events) == [
        Output("I write it."),
        ToolCalled("shell", 'echo {} > "$OCTOFORM_OUTPUT"'),
        ToolReturned(),
        Output("done"),
        Totals(Usage(2000, 800, 100)),
        Closed(ok=True),
    ]


def test_calls_that_cannot_be_done_are_replies_too() -> None:
    events = recorded(CodexDialect(), "codex-bad")
    assert of(events, Turn) == [Turn(REPLY)] * 5, "two of them show in the trace alone"
    assert [event.failed for event in of(events, ToolReturned)] == [True, False]
    assert of(events, ModelProblem) == []


def test_a_reply_that_is_cut_is_none() -> None:
    events = recorded(CodexDialect(), "codex-flaky")
    assert of(events, Turn) == [Turn(REPLY)] * 2
    assert [event.text for event in of(events, ModelProblem)] == [
        "HTTP status 500",
        "Transport error: network error: error decoding response body",
        "stream disconnected before completion: Transport error: network error: error decoding response body",
    ]
    assert {(event.reason, event.final) for event in of(events, ModelProblem)} == {(ExitReason.UNREACHABLE, False)}
    assert events[-1] == Closed(ok=True)


@pytest.mark.parametrize(
    ("name", "reason", "told"),
    [
        ("auth", ExitReason.AUTH, "401 Unauthorized"),
        ("rate", ExitReason.RATE_LIMIT, "429 Too Many Requests"),
        ("late", ExitReason.UNREACHABLE, "high demand"),
        ("down", ExitReason.UNREACHABLE, "Connection failed"),
    ],
)
def test_how_it_gives_up(name: str, reason: ExitReason, told: str) -> None:
    events = recorded(CodexDialect(), f"codex-{name}")
    troubles = of(events, ModelProblem)
    assert {event.reason for event in troubles} == {reason}
    assert not any(event.final for event in troubles[:-1]) or name == "auth", "it tries again"
    assert troubles[-1].final
    assert told in troubles[-1].text
    assert events[-1] is troubles[-1]


def test_the_streams_have_no_order_so_what_is_tried_again_is_read_where_the_replies_are() -> None:
    again = {"type": "error", "message": "Reconnecting... 1/5 (Connection failed: error sending request)"}
    assert len(lines(CodexDialect(), "stdout", again)) == 1, "a version without the trace"
    dialect = CodexDialect()
    reply = (TRACED + "response.completed input_token_count=10 output_token_count=2").encode()
    assert lines(dialect, "stderr", reply) == [Turn(Usage(10, None, 2))]
    assert lines(dialect, "stdout", again) == [], "it may be older than the reply"
    refused = {
        "type": "error",
        "message": "Reconnecting... 1/5 (unexpected status 401 Unauthorized: no, url: http://x)",
    }
    (trouble,) = lines(dialect, "stdout", refused)
    assert isinstance(trouble, ModelProblem) and trouble.final
    failed = {"type": "turn.failed", "error": {"message": "Connection failed: error sending request"}}
    assert len(lines(dialect, "stdout", failed)) == 1
    assert lines(dialect, "stderr", reply) == [], "nothing comes after the end"


def test_only_requests_for_replies_are_trouble() -> None:
    request = '2026-11-21T17:24:20Z  INFO codex_otel.log_only: event.name="codex.api_request" duration_ms=17 '
    items = [
        f'{request}error.message="no way" attempt=0 endpoint="{path}"'.encode() for path in ("/models", "/responses")
    ]
    assert lines(CodexDialect(), "stderr", *items) == [ModelProblem(ExitReason.UNREACHABLE, "no way")]
    limited = f'{request}http.response.status_code=429 error.message="http 429" attempt=0 endpoint="/responses"'
    assert lines(CodexDialect(), "stderr", limited.encode()) == [ModelProblem(ExitReason.RATE_LIMIT, "HTTP status 429")]


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        ("Reconnecting... waiting for network (Connection failed: error sending request)", ExitReason.UNREACHABLE),
        ("stream disconnected before completion: idle timeout waiting for SSE", ExitReason.UNREACHABLE),
        ("Selected model is at capacity. Please try a different model.", ExitReason.UNREACHABLE),
        ("You've hit your usage limit.", ExitReason.RATE_LIMIT),
        ("Quota exceeded. Check your plan and billing details.", ExitReason.RATE_LIMIT),
        ("Missing environment variable: `LOOP_KEY`.", ExitReason.AUTH),
        (
            "unexpected status 404 Not Found: no such model, url: http://127.0.0.1:50329/v1/responses",
            ExitReason.REFUSED,
        ),
        ("unexpected status 503 Service Unavailable: later, url: http://127.0.0.1/401", ExitReason.UNREACHABLE),
    ],
)
def test_what_its_messages_mean(message: str, reason: ExitReason) -> None:
    (found,) = lines(CodexDialect(), "stdout", {"type": "turn.failed", "error": {"message": message}})
    assert found == ModelProblem(reason, message, final=True)


def test_a_reply_without_a_count_of_its_tokens() -> None:
    trace = [(TRACED + kind + " duration_ms=0").encode() for kind in ("response.completed", "response.created")]
    assert lines(CodexDialect(), "stderr", *trace) == [Replying(), Turn(), Replying()]
    counted = (TRACED + "response.completed input_token_count=10 output_token_count=2 reasoning_token_count=0").encode()
    assert lines(CodexDialect(), "stderr", trace[0], counted) == [Replying(), Turn(Usage(10, None, 2))]


def test_other_tools_than_the_shell() -> None:
    def done(**item: object) -> list[Any]:
        return lines(CodexDialect(), "stdout", {"type": "item.completed", "item": {"id": "item_1", **item}})

    changes = [{"path": "/w/a.py", "kind": "add"}, {"path": "/w/b.py", "kind": "update"}]
    edited = done(type="file_change", changes=changes, status="completed")
    assert edited == [ToolCalled("edit", "/w/a.py, /w/b.py"), ToolReturned()]
    assert done(type="web_search", query="a chip") == [ToolCalled("web_search", "a chip"), ToolReturned()]
    other = done(type="mcp_tool_call", tool="look", arguments={"at": 1}, status="failed")
    assert other == [ToolCalled("look", '{"at": 1}'), ToolReturned(failed=True)]
    odd = done(type="command_execution", command="bash -c 'no end", status="declined")
    assert odd == [ToolCalled("shell", "bash -c 'no end"), ToolReturned(failed=True)]
    assert done(type="reasoning", text="hm") == []


def test_nothing_strange_is_an_event() -> None:
    strange = (b"", b"Reading prompt from stdin...", b"[]", b'{"type":7}', b'{"type":"item.completed"}', b'{"item":1}')
    assert lines(CodexDialect(), "stdout", *strange) == []
    assert lines(CodexDialect(), "stderr", *strange, b"ERROR codex_core::tools::router: error=unsupported call") == []


def test_how_it_is_started(tmp_path: Path) -> None:
    found = invoked(Codex(), SPEC, "openai/gpt-5-codex", tmp_path)
    assert found.argv[:3] == ("/opt/it", "exec", "--json")
    assert found.argv[-3:] == ("-C", str(tmp_path), "-")
    assert found.stdin == tmp_path / "prompt.md"
    assert (found.path, found.program) == (("/opt/node",), "codex 1.2.3")
    assert found.named == ("LOOP_KEY",)
    config = configured(found)
    assert (config["model"], config["model_provider"], config["web_search"]) == ("gpt-5-codex", "octoform", "disabled")
    provider = config["model_providers"]["octoform"]
    assert (provider["base_url"], provider["env_key"]) == ("http://127.0.0.1:8080/v1", "LOOP_KEY")
    assert config["shell_environment_policy"]["exclude"] == ["RUST_LOG", "LOOP_KEY"]
    assert not any(config["features"].values())
    assert SECRET not in " ".join((*found.argv, *found.settings.values()))
    nowhere_in_files(tmp_path)


def test_what_the_manifest_chooses(tmp_path: Path) -> None:
    spec = replace(SPEC, web_search=True, env=("LOOP_KEY",))
    config = configured(invoked(Codex(), spec, 'openrouter/a"b\x7f', tmp_path))
    assert config["web_search"] == "live"
    assert config["model"] == 'a"b\x7f'
    assert config["shell_environment_policy"]["exclude"] == ["RUST_LOG"], "the agent may see it, as the manifest says"


def test_a_model_that_needs_no_key(tmp_path: Path) -> None:
    config = configured(invoked(Codex(), HarnessSpec("codex"), "ollama/qwen3", tmp_path))
    assert "env_key" not in config["model_providers"]["octoform"]


def configured(invocation: Invocation) -> dict[str, Any]:
    """The program's configuration as it reads it."""
    return tomllib.loads((Path(invocation.settings["CODEX_HOME"]) / "config.toml").read_text(encoding="utf-8"))
