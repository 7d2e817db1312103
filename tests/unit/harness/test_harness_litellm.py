"""The small agent's lines in the words of the port, and what it is given for a task."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from unit.harness.program_streams import SECRET, lines

from octoform.harness.adapters.litellm import LiteLLMHarness, ReactDialect
from octoform.harness.port import (
    Closed,
    ExitReason,
    ModelProblem,
    Output,
    Replying,
    Task,
    TaskLimits,
    ToolCalled,
    ToolReturned,
    Turn,
    Usage,
)
from octoform.harness.react.config import Config
from octoform.manifest.model import HarnessSpec

SPEC = HarnessSpec("litellm", key="LOOP_KEY", base_url="http://127.0.0.1:9")


@pytest.fixture
def task(tmp_path: Path) -> Task:
    (tmp_path / "prompt.md").write_text("Do it.")
    return Task(
        stage="probe",
        attempt=1,
        workdir=tmp_path,
        prompt=tmp_path / "prompt.md",
        output=tmp_path / "output.json",
        log=tmp_path / "task.log",
        document=tmp_path / "task.json",
        model="openai/scripted",
        environment={"PATH": "/usr/bin:/bin", "LOOP_KEY": SECRET},
        limits=TaskLimits(200.0, idle_seconds=100.0),
    )


def test_a_run_in_the_words_of_the_port() -> None:
    events = lines(
        ReactDialect(),
        "stdout",
        {"type": "alive", "pieces": 40},
        {"type": "reply", "text": "I look.", "usage": {"input": 1000, "cached": 400, "output": 50}},
        {"type": "call", "tool": "shell", "text": "ls\n-l"},
        {"type": "result", "failed": True, "text": "none"},
        {"type": "reply", "text": "", "usage": {}},
        {"type": "closed", "ok": True, "text": ""},
    )
    assert events == [
        Replying(),
        Output("I look."),
        Turn(Usage(1000, 400, 50)),
        ToolCalled("shell", "ls -l"),
        ToolReturned(failed=True),
        Turn(Usage()),
        Closed(ok=True),
    ]


@pytest.mark.parametrize(
    ("status", "text", "reason", "final"),
    [
        (401, "scripted 401", ExitReason.AUTH, True),
        (429, "scripted 429", ExitReason.RATE_LIMIT, False),
        (500, "Connection error.", ExitReason.UNREACHABLE, False),
        (408, "litellm.Timeout: Request timed out", ExitReason.UNREACHABLE, False),
        (None, "peer closed connection", ExitReason.UNREACHABLE, False),
        (404, "no such model", ExitReason.REFUSED, True),
    ],
)
def test_trouble_has_its_reason(status: int | None, text: str, reason: ExitReason, final: bool) -> None:
    line = {"type": "trouble", "text": text, "status": status, "final": False}
    assert lines(ReactDialect(), "stdout", line) == [ModelProblem(reason, text, final)]
    assert lines(ReactDialect(), "stdout", {**line, "final": True}) == [ModelProblem(reason, text, True)]


def test_what_is_no_line_of_its_own_is_nothing() -> None:
    strange = (b"", b"{", b"[]", b'{"type": 1}', b'{"type": "reply"', b"\xff", b'{"type": {"a": 1}}')
    assert lines(ReactDialect(), "stdout", *strange) == []
    assert lines(ReactDialect(), "stderr", {"type": "closed", "ok": True}) == []
    assert lines(ReactDialect(), "stdout", {"type": "reply"}) == [Turn(Usage())]


def test_what_a_process_is_given_holds_no_secret(task: Task) -> None:
    harness = LiteLLMHarness(replace(SPEC, env=("HTTPS_PROXY", "OTHER_TOKEN")))
    config = harness.configuration(task)
    assert isinstance(config, Config)
    text = json.dumps([str(config), config.hidden])
    assert SECRET not in text
    assert set(config.hidden) >= {"LOOP_KEY", "OTHER_TOKEN", "LITELLM_LOCAL_MODEL_COST_MAP"}
    assert (config.shell_seconds, config.most_shell_seconds, config.request_seconds) == (60, 80, 150.0)


@pytest.mark.parametrize(
    ("limits", "usual", "most"),
    [
        (TaskLimits(30.0), 24, 24),
        (TaskLimits(3600.0), 60, 480),
        (TaskLimits(3600.0, idle_seconds=20.0), 16, 16),
        (TaskLimits(0.5), 1, 1),
    ],
)
def test_a_command_ends_before_the_run_does(task: Task, limits: TaskLimits, usual: int, most: int) -> None:
    config = LiteLLMHarness(SPEC).configuration(replace(task, limits=limits))
    assert isinstance(config, Config)
    assert (config.shell_seconds, config.most_shell_seconds) == (usual, most)


def test_a_model_that_cannot_be_asked_is_told_before_anything_runs(task: Task) -> None:
    outcome = LiteLLMHarness(SPEC).run(replace(task, model=None), lambda *told: None)
    assert outcome.reason is ExitReason.NOT_INSTALLED
    assert "needs a model" in outcome.detail
    assert not task.log.exists()
