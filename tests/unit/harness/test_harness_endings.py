"""What a run counts as: the stream's word stands above the exit status, whichever of the two looks better."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from octoform.harness.contained_attempt import Invocation, run_contained
from octoform.harness.port import AgentEvent, Closed, ExitReason, ModelProblem, Outcome, Task, TaskLimits, Turn

EVENTS: dict[bytes, AgentEvent] = {
    b"turn": Turn(),
    b"limited": ModelProblem(ExitReason.RATE_LIMIT, "429"),
    b"down": ModelProblem(ExitReason.UNREACHABLE, "no route"),
    b"done": Closed(ok=True),
    b"gave up": Closed(ok=False, text="no luck"),
}


class Words:
    def read(self, stream: str, line: bytes) -> Iterable[AgentEvent]:
        if line in EVENTS:
            yield EVENTS[line]


@pytest.fixture
def task(tmp_path: Path) -> Task:
    names: dict[str, Any] = {name: tmp_path / name for name in ("prompt", "output", "log", "document")}
    return Task("probe", 1, tmp_path, model=None, environment={"PATH": "/usr/bin:/bin"}, limits=TaskLimits(30), **names)


def ran(task: Task, script: str) -> Outcome:
    return run_contained(task, Invocation(("sh", "-c", script), dialect=Words()), lambda *told: None)


@pytest.mark.parametrize(
    ("script", "reason"),
    [
        ("echo turn; echo done", ExitReason.FINISHED),
        ("echo turn; echo limited; echo done", ExitReason.RATE_LIMIT),
        ("echo limited; echo turn; echo done", ExitReason.FINISHED),
        ("echo down; exit 1", ExitReason.UNREACHABLE),
        ("echo turn; echo done; exit 3", ExitReason.FINISHED),
        ("echo turn; exit 3", ExitReason.CRASHED),
        ("echo turn; echo gave up; exit 3", ExitReason.CRASHED),
        ("echo turn", ExitReason.FINISHED),
        ("echo turn; echo done; kill -9 $$", ExitReason.FINISHED),
    ],
)
def test_the_reason_of_an_end(task: Task, script: str, reason: ExitReason) -> None:
    assert ran(task, script).reason is reason


def test_what_it_complained_of_and_its_closing_words_are_told(task: Task) -> None:
    assert "429" in ran(task, "echo limited").detail
    assert "no luck" in ran(task, "echo gave up; exit 1").detail
