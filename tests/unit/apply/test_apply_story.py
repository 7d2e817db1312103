"""What a retry reads of a failed attempt whose program speaks to machines."""

import json
from pathlib import Path
from typing import Any

from octoform.apply.stage.attempt_loop import readable_log
from octoform.harness.port import ExitReason, Outcome, Task, TaskLimits


def task(folder: Path) -> Task:
    names: dict[str, Any] = {name: folder / name for name in ("prompt", "output", "log", "document")}
    return Task("probe", 1, folder, model=None, environment={}, limits=TaskLimits(1.0), **names)


def test_the_transcript_is_told_in_lines(tmp_path: Path) -> None:
    events = [
        {"at": 0.5, "event": "turn"},
        {"at": 0.6, "event": "said", "text": "looking"},
        {"at": 1.25, "event": "tool_called", "tool": "bash", "text": "ls /sys"},
        {"at": 2.0, "event": "tool_returned", "failed": True},
        {"at": 3.0, "event": "trouble", "reason": "rate_limit", "text": "429"},
    ]
    found = task(tmp_path)
    found.transcript.write_text("".join(json.dumps(event) + "\n" for event in events) + "no event\n")
    story = readable_log(found, Outcome(ExitReason.CRASHED, 1, 3.0, turns=1))
    assert story.read_text().splitlines() == [
        "    0.6 s  message: looking",
        "    1.2 s  bash: ls /sys",
        "    2.0 s    that failed",
        "    3.0 s  the model's side failed: 429",
    ]


def test_a_program_that_is_not_read_or_said_nothing_keeps_its_log(tmp_path: Path) -> None:
    silent = task(tmp_path)
    assert readable_log(silent, Outcome(ExitReason.CRASHED, 1, 3.0)) == silent.log
    assert readable_log(silent, Outcome(ExitReason.CRASHED, 1, 3.0, turns=0)) == silent.log
