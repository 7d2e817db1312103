"""opencode's events and those of the plugin, as they were printed, in the words of the port; how it is started."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from unit.harness.program_streams import SECRET, invoked, lines, nowhere_in_files, of, recorded, without_turns

from octoform.harness.adapters.opencode import PLUGIN, OpenCode, OpenCodeDialect
from octoform.harness.port import ExitReason, ModelProblem, Output, Replying, ToolCalled, ToolReturned, Turn, Usage
from octoform.manifest.model import HarnessSpec

REPLY = Turn(Usage(1000, 400, 50))
SPEC = HarnessSpec("opencode", key="LOOP_KEY", base_url="http://127.0.0.1:8080")
STARTED = {"octoform": "tool", "id": "1", "tool": "bash", "input": {"command": "ls"}}


def test_a_run_that_went_well() -> None:
    events = recorded(OpenCodeDialect(), "opencode-ok")
    assert of(events, Turn) == [REPLY] * 2
    assert without_turns(events) == [
        ToolCalled("bash", 'echo {} > "$OCTOFORM_OUTPUT"; echo "<$LOOP_KEY>"'),
        Output("I write it."),
        ToolReturned(),
        Output("done"),
    ]


def test_a_call_is_told_of_once_with_the_plugin_and_without() -> None:
    ended = {
        "type": "tool_use",
        "part": {"callID": "1", "tool": "bash", "state": {"status": "completed", "input": {"command": "ls"}}},
    }
    dialect = OpenCodeDialect()
    assert lines(dialect, "stderr", STARTED) == [ToolCalled("bash", "ls")]
    assert lines(dialect, "stdout", ended) == [ToolReturned()]
    assert lines(OpenCodeDialect(), "stdout", ended) == [ToolCalled("bash", "ls"), ToolReturned()]


def test_calls_that_cannot_be_done_are_replies_too() -> None:
    events = recorded(OpenCodeDialect(), "opencode-bad")
    assert of(events, Turn) == [REPLY] * 4
    assert [event.tool for event in of(events, ToolCalled)] == ["invalid", "invalid", "bash"]
    assert "unavailable tool 'no_such_tool'" in of(events, ToolCalled)[1].text
    assert [event.failed for event in of(events, ToolReturned)] == [True] * 3
    assert of(events, ModelProblem) == []


@pytest.mark.parametrize(
    ("name", "reasons", "told"),
    [
        ("auth", [ExitReason.AUTH], "This API key is not valid."),
        ("rate", [ExitReason.RATE_LIMIT] * 3, "Too many requests"),
        ("flaky", [ExitReason.UNREACHABLE] * 3, "socket connection was closed"),
        ("down", [ExitReason.UNREACHABLE] * 3, "Unable to connect"),
    ],
)
def test_what_it_tries_again_and_what_not(name: str, reasons: list[ExitReason], told: str) -> None:
    troubles = of(recorded(OpenCodeDialect(), f"opencode-{name}"), ModelProblem)
    assert [event.reason for event in troubles] == reasons
    assert [event.final for event in troubles] == [name == "auth"] * len(troubles)
    assert told in troubles[-1].text


def test_the_status_stands_above_the_words() -> None:
    fields = {"octoform": "retry", "text": "Please come back tomorrow.", "status": 429}
    assert lines(OpenCodeDialect(), "stderr", fields) == [
        ModelProblem(ExitReason.RATE_LIMIT, "Please come back tomorrow.")
    ]
    unknown = {**fields, "status": None}
    (trouble,) = lines(OpenCodeDialect(), "stderr", unknown)
    assert isinstance(trouble, ModelProblem) and trouble.reason is ExitReason.UNREACHABLE, "it would not try again"


def test_after_its_error_nothing_that_came_before_it_counts() -> None:
    dialect = OpenCodeDialect()
    error = {"name": "APIError", "data": {"message": "No such model.", "statusCode": 404}}
    assert lines(dialect, "stdout", {"type": "error", "error": error}) == [
        ModelProblem(ExitReason.REFUSED, "No such model.", final=True)
    ]
    assert lines(dialect, "stderr", {"octoform": "retry", "text": "late", "status": 500}) == []


def test_reasoning_is_output_and_what_is_written_to_a_cache_is_input() -> None:
    tokens = {"total": 180, "input": 60, "output": 7, "reasoning": 13, "cache": {"write": 60, "read": 40}}
    finished = {"type": "step_finish", "part": {"tokens": tokens}}
    assert lines(OpenCodeDialect(), "stdout", finished) == [Turn(Usage(160, 40, 20))]
    assert lines(OpenCodeDialect(), "stdout", {"type": "step_finish"}) == [Turn()]


def test_nothing_strange_is_an_event() -> None:
    strange = (b"", b"sh: 1: not found", b"[]", b'{"type":7}', b'{"type":"text"}', b'{"octoform":"retire"}')
    for stream in ("stdout", "stderr"):
        assert lines(OpenCodeDialect(), stream, *strange) == []
    assert lines(OpenCodeDialect(), "stdout", STARTED) == [], "only the plugin's stream is the plugin's"
    assert lines(OpenCodeDialect(), "stderr", {"type": "error"}) == []
    assert lines(OpenCodeDialect(), "stderr", {"octoform": "piece"}) == [Replying()]


def test_how_it_is_started(tmp_path: Path) -> None:
    found = invoked(OpenCode(), SPEC, "openrouter/google/gemini-3", tmp_path, idle_seconds=120.0)
    assert found.argv[:4] == ("/opt/it", "run", "--format", "json")
    assert found.argv[found.argv.index("--model") + 1] == "octoform/google/gemini-3"
    assert found.stdin == tmp_path / "prompt.md"
    assert (found.path, found.program) == ((str(tmp_path / "home" / "shells"), "/opt/node"), "opencode 1.2.3")
    assert found.named == ("LOOP_KEY",)
    assert found.settings["OPENCODE_DISABLE_PROJECT_CONFIG"] == "1"
    assert found.settings["OPENCODE_WATCH_WITHHELD"] == "LOOP_KEY"
    assert found.settings["OPENCODE_WATCH_COMMAND_MS"] == "88000"
    assert found.settings["XDG_DATA_HOME"] == str(tmp_path / "home" / ".local" / "share")
    assert "OPENCODE_ENABLE_EXA" not in found.settings
    config = configured(tmp_path)
    assert config["permission"] == {"*": "allow", **dict.fromkeys(("task", "skill", "webfetch", "websearch"), "deny")}
    assert config["small_model"] == config["model"] == "octoform/google/gemini-3"
    provider = config["provider"]["octoform"]
    assert provider["options"] == {"baseURL": "http://127.0.0.1:8080/v1", "apiKey": "{env:LOOP_KEY}"}
    assert list(provider["models"]) == ["google/gemini-3"]
    assert (settings_folder(tmp_path) / "plugin" / PLUGIN.name).read_bytes() == PLUGIN.read_bytes()
    assert SECRET not in " ".join((*found.argv, *found.settings.values()))
    nowhere_in_files(tmp_path)


@pytest.mark.parametrize(
    ("api", "package", "url"),
    [
        ("openai-completions", "@ai-sdk/openai-compatible", "/v1"),
        ("openai-responses", "@ai-sdk/openai", "/v1"),
        ("anthropic-messages", "@ai-sdk/anthropic", "/v1"),
        ("gemini", "@ai-sdk/google", "/v1beta"),
    ],
)
def test_each_api_has_its_client_and_its_base_url(api: str, package: str, url: str, tmp_path: Path) -> None:
    invoked(OpenCode(), replace(SPEC, api=api), "openai/scripted", tmp_path)
    provider = configured(tmp_path)["provider"]["octoform"]
    assert (provider["npm"], provider["options"]["baseURL"]) == (package, f"http://127.0.0.1:8080{url}")


def test_what_the_manifest_chooses(tmp_path: Path) -> None:
    found = invoked(OpenCode(), replace(SPEC, web_search=True, env=("LOOP_KEY",)), "openai/scripted", tmp_path)
    assert found.settings["OPENCODE_ENABLE_EXA"] == "1"
    assert "OPENCODE_WATCH_WITHHELD" not in found.settings, "the agent may see it, as the manifest says"
    assert configured(tmp_path)["permission"] == {"*": "allow", "task": "deny", "skill": "deny"}


def test_a_model_that_needs_no_key(tmp_path: Path) -> None:
    found = invoked(OpenCode(), HarnessSpec("opencode"), "ollama/qwen3", tmp_path)
    assert found.named == ()
    assert not any(name.startswith("OPENCODE_WATCH") for name in found.settings)
    assert configured(tmp_path)["provider"]["octoform"]["options"]["apiKey"] == "none"


def settings_folder(folder: Path) -> Path:
    """Where its configuration lies."""
    return folder / "home" / ".config" / "opencode"


def configured(folder: Path) -> Any:
    """The program's configuration as it reads it."""
    return json.loads((settings_folder(folder) / "opencode.json").read_text(encoding="utf-8"))
