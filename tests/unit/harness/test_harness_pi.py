"""pi's events, as they were printed, in the words of the port; and how the program is started."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from unit.harness.program_streams import SECRET, invoked, lines, nowhere_in_files, of, recorded

from octoform.harness.adapters.pi import Pi, PiDialect
from octoform.harness.port import (
    Closed,
    ExitReason,
    ModelProblem,
    Output,
    Replying,
    ToolCalled,
    ToolReturned,
    Turn,
    Usage,
)
from octoform.manifest.model import HarnessSpec

REPLY = Turn(Usage(1000, 400, 50))
SPEC = HarnessSpec("pi", key="LOOP_KEY", base_url="http://127.0.0.1:8080")


def test_a_run_that_went_well() -> None:
    assert recorded(PiDialect(), "pi-ok") == [
        Output("I write it."),
        REPLY,
        ToolCalled("bash", 'echo {} > "$OCTOFORM_OUTPUT"; echo "<$LOOP_KEY>"'),
        ToolReturned(),
        Output("done"),
        REPLY,
        Closed(ok=True),
    ]


def test_calls_that_cannot_be_done_are_replies_too() -> None:
    events = recorded(PiDialect(), "pi-bad")
    assert of(events, Turn) == [REPLY] * 4
    # Broken arguments it repairs as well as it can, and runs.
    assert [event.text for event in of(events, ToolCalled)] == ["echo hi", '{"x": 1}', "{}"]
    assert [event.failed for event in of(events, ToolReturned)] == [False, True, True]
    assert of(events, ModelProblem) == []


@pytest.mark.parametrize(
    ("name", "reasons", "told"),
    [
        ("auth", [ExitReason.AUTH], "This API key is not valid."),
        ("rate", [ExitReason.RATE_LIMIT] * 3, "Too many requests"),
        ("flaky", [ExitReason.UNREACHABLE] * 3, "terminated"),
        ("down", [ExitReason.UNREACHABLE] * 3, "Connection error."),
    ],
)
def test_how_it_gives_up(name: str, reasons: list[ExitReason], told: str) -> None:
    events = recorded(PiDialect(), f"pi-{name}")
    troubles = of(events, ModelProblem)
    assert [event.reason for event in troubles] == reasons
    assert [event.final for event in troubles] == [name == "auth"] * len(troubles)
    assert told in troubles[-1].text
    assert of(events, Turn) == []
    assert events[-1] == Closed(ok=True), "it says the same after a run that came to nothing"


def test_a_piece_of_a_reply_is_a_sign_of_life() -> None:
    piece = b'{"type":"message_update","usage":{},"assistantMessageEvent":{"type":"text_delta","delta":"x"}}'
    assert lines(PiDialect(), "stdout", piece) == [Replying()]
    assert lines(PiDialect(), "stdout", b'{"type":"tool_execution_update","toolCallId":"1"}') == [Replying()]


def test_a_key_that_is_not_set() -> None:
    text = b"No API key found for octoform."
    assert lines(PiDialect(), "stderr", text) == [ModelProblem(ExitReason.AUTH, text.decode(), final=True)]


def test_nothing_strange_is_an_event() -> None:
    strange = (b"", b"Warning: no such thing", b"[]", b'{"type":7}', b'{"type":"message_end"}', b'{"type":"turn_end"}')
    assert lines(PiDialect(), "stdout", *strange) == []
    assert lines(PiDialect(), "stderr", *strange, b'{"type":"agent_settled"}') == []
    bare = {"type": "message_end", "message": {"role": "assistant"}}
    assert lines(PiDialect(), "stdout", bare) == [Turn()]
    assert lines(PiDialect(), "stdout", {"type": "tool_execution_start"}) == [ToolCalled("?", "null")]


def test_how_it_is_started(tmp_path: Path) -> None:
    found = invoked(Pi(), SPEC, "openrouter/google/gemini-3", tmp_path, idle_seconds=120.0)
    assert found.argv[:4] == ("/opt/it", "-p", "--mode", "json")
    assert found.argv[found.argv.index("--model") + 1] == "octoform/google/gemini-3"
    assert {"--no-session", "--offline", "--no-extensions", "--no-skills", "--no-context-files"} < {*found.argv}
    assert found.stdin == tmp_path / "prompt.md"
    assert (found.path, found.program) == (("/opt/node",), "pi 1.2.3")
    assert found.named == ("LOOP_KEY",)
    assert configured(tmp_path, "settings")["retry"] == {"maxRetries": 4}
    assert shell(tmp_path) == ["#!/bin/sh", "unset LOOP_KEY", 'exec timeout --kill-after=2 88 bash "$@"']
    provider = configured(tmp_path, "models")["providers"]["octoform"]
    assert (provider["baseUrl"], provider["apiKey"]) == ("http://127.0.0.1:8080/v1", "$LOOP_KEY")
    assert provider["models"][0]["id"] == "google/gemini-3"
    assert SECRET not in " ".join((*found.argv, *found.settings.values()))
    nowhere_in_files(tmp_path)


@pytest.mark.parametrize(
    ("api", "named", "url"),
    [
        ("openai-completions", "openai-completions", "/v1"),
        ("openai-responses", "openai-responses", "/v1"),
        ("anthropic-messages", "anthropic-messages", ""),
        ("gemini", "google-generative-ai", "/v1beta"),
    ],
)
def test_each_api_has_its_name_and_its_base_url(api: str, named: str, url: str, tmp_path: Path) -> None:
    invoked(Pi(), replace(SPEC, api=api), "openai/scripted", tmp_path)
    provider = configured(tmp_path, "models")["providers"]["octoform"]
    assert (provider["api"], provider["baseUrl"]) == (named, f"http://127.0.0.1:8080{url}")


def test_the_manifest_may_show_the_agent_the_key(tmp_path: Path) -> None:
    found = invoked(Pi(), replace(SPEC, env=("LOOP_KEY", "HTTPS_PROXY")), "openai/scripted", tmp_path)
    assert shell(tmp_path) == ["#!/bin/sh", 'exec bash "$@"'], "without a limit of the run there is none of commands"
    assert set(found.named) == {"LOOP_KEY", "HTTPS_PROXY"}


def test_a_model_that_needs_no_key(tmp_path: Path) -> None:
    found = invoked(Pi(), HarnessSpec("pi"), "ollama/qwen3", tmp_path)
    assert found.named == ()
    assert configured(tmp_path, "models")["providers"]["octoform"]["apiKey"] == "none"


def shell(folder: Path) -> list[str]:
    """The lines of the shell that it uses, where its settings say."""
    path = Path(configured(folder, "settings")["shellPath"])
    assert path.stat().st_mode & 0o100
    return path.read_text(encoding="utf-8").splitlines()


def configured(folder: Path, name: str) -> Any:
    """The program's configuration as it reads it."""
    return json.loads((folder / "home" / ".pi" / "agent" / f"{name}.json").read_text(encoding="utf-8"))
