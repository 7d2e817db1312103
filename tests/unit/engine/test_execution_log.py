"""The one log of a host: every event a line; a disk that refuses stops no run and is told once."""

import json
from datetime import UTC, datetime
from pathlib import Path

from octoform.apply.context import Clock
from octoform.engine.apply.execution_log import logging_to
from octoform.events import AttemptProgress, Event, NodeStarted, Notice

CLOCK = Clock(now=lambda: datetime(2030, 1, 2, 3, 4, 5, tzinfo=UTC))


def test_events_are_lines_and_progress_is_only_shown(tmp_path: Path) -> None:
    shown: list[Event] = []
    path = tmp_path / "log" / "octoform.jsonl"
    with logging_to(path, CLOCK, shown.append) as emit:
        emit(NodeStarted("probe", "create"))
        emit(AttemptProgress("probe", "41 devices", 1.0))
    assert [json.loads(line) for line in path.read_text().splitlines()] == [
        {
            "event": "NodeStarted",
            "time": "2030-01-02T03:04:05Z",
            "from": "octoform",
            "node": "probe",
            "action": "create",
        }
    ]
    assert len(shown) == 2
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_log_that_cannot_be_opened_is_told_once_and_everything_is_shown(tmp_path: Path) -> None:
    shown: list[Event] = []
    (tmp_path / "log").write_text("a file in the way\n")
    with logging_to(tmp_path / "log" / "octoform.jsonl", CLOCK, shown.append) as emit:
        emit(NodeStarted("probe", "create"))
        emit(NodeStarted("identify", "create"))
    assert [type(event) for event in shown] == [Notice, NodeStarted, NodeStarted]
    assert "the execution log is incomplete" in str(shown[0])


def test_a_full_disk_is_told_once_and_loses_no_event(tmp_path: Path) -> None:
    shown: list[Event] = []
    full = tmp_path / "full"
    full.symlink_to("/dev/full")  # every write to it finds no room
    before = len(list(Path("/proc/self/fd").iterdir()))
    with logging_to(full, CLOCK, shown.append) as emit:
        for _ in range(3):
            emit(NodeStarted("probe", "create"))
    assert [type(event) for event in shown] == [Notice, NodeStarted, NodeStarted, NodeStarted]
    assert "No space left" in str(shown[0])
    assert len(list(Path("/proc/self/fd").iterdir())) == before
