"""Running a real agent program on one task: the task, and the run with a look at what it has left."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from agent_runs import PROMPT, Ran, environment, harness, nothing_left

from octoform.harness.port import AgentEvent, Task, TaskLimits, Usage
from octoform.manifest.model import HarnessSpec


@pytest.fixture
def task_for(tmp_path: Path) -> Callable[..., Task]:
    """``task_for(model, turns=6)``: a task in a folder of its own; keywords are those of TaskLimits."""

    def build(model: str = "openai/scripted", prompt: str = PROMPT, **limits: Any) -> Task:
        folder = tmp_path / f"attempt-{len(list(tmp_path.iterdir())) + 1}"
        folder.mkdir(mode=0o700)
        (folder / "prompt.md").write_text(prompt, encoding="utf-8")
        (folder / "task.json").write_text(json.dumps({"format": 1, "stage": "probe"}))
        bounds = TaskLimits(60.0, idle_seconds=30.0, turns=20, patience_seconds=2.0)
        return Task(
            stage="probe",
            attempt=1,
            workdir=folder,
            prompt=folder / "prompt.md",
            output=folder / "output.json",
            log=folder / "task.log",
            document=folder / "task.json",
            model=model,
            environment=environment(),
            limits=replace(bounds, **limits),
        )

    return build


@pytest.fixture
def run() -> Callable[..., Ran]:
    """``run(spec, task)``: run it to its end; fails when anything of it is left running."""

    def start(spec: HarnessSpec, task: Task) -> Ran:
        events: list[AgentEvent] = []

        def take(event: AgentEvent, seconds: float, usage: Usage) -> None:
            events.append(event)

        outcome = harness(spec).run(task, take)
        nothing_left(task.workdir)
        return Ran(task, outcome, events)

    return start
