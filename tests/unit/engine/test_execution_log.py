"""The one log of a host: every event a line; a disk that refuses stops no run and is reported once."""

import json
import resource
from datetime import UTC, datetime
from pathlib import Path

import pytest

from octoform.apply.context import Clock
from octoform.engine.apply.session import logging_to
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
    before = len(list(Path("/proc/self/fd").iterdir()))
    allowed = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, allowed[1]))  # every write to a file finds no room
    try:
        with logging_to(tmp_path / "octoform.jsonl", CLOCK, shown.append) as emit:
            for _ in range(3):
                emit(NodeStarted("probe", "create"))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, allowed)
    assert [type(event) for event in shown] == [Notice, NodeStarted, NodeStarted, NodeStarted]
    assert "File too large" in str(shown[0])
    assert len(list(Path("/proc/self/fd").iterdir())) == before


@pytest.mark.parametrize("target", ["octoform.jsonl", "nothing", "foreign"])
def test_a_symlink_in_its_place_is_moved_and_never_written_through(tmp_path: Path, target: str) -> None:
    shown: list[Event] = []
    (tmp_path / "foreign").write_text("mine\n")
    log = tmp_path / "octoform.jsonl"
    log.symlink_to(target)
    with logging_to(log, CLOCK, shown.append) as emit:
        emit(NodeStarted("probe", "create"))
    assert [type(event) for event in shown] == [NodeStarted]
    assert len(log.read_text().splitlines()) == 1 and not log.is_symlink()
    assert (tmp_path / "foreign").read_text() == "mine\n" and not (tmp_path / "nothing").exists()
