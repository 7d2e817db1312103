"""A user whose watches are used up: what cannot be heard is looked at, and a person is notified."""

import errno
import os
from collections.abc import Sequence
from pathlib import Path

import pytest
from inotify_simple import INotify

from octoform.daemon.model import Cause, Facts
from octoform.daemon.observe.clock_jumps import SystemClock
from octoform.daemon.observe.event_queue import EventSources, Timing, open_sources
from octoform.daemon.observe.file_events import LOOK_SECONDS
from octoform.daemon.observe.process import ProcessEar
from octoform.state.layout import Layout


@pytest.fixture
def full(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The kernel refuses every watch on a folder whose path ends with one of these."""
    refused: list[str] = []
    there = INotify.add_watch

    def add_watch(self: INotify, path: Path, mask: int) -> int:
        if any(str(path).endswith(each) for each in refused):
            raise OSError(errno.ENOSPC, "No space left on device")
        return int(there(self, path, mask))

    monkeypatch.setattr(INotify, "add_watch", add_watch)
    return refused


class Clock(SystemClock):
    """Time that only a wait moves."""

    def __init__(self) -> None:
        self.now = 1000.0

    def uptime(self) -> float:
        return self.now

    def awake(self) -> float:
        return self.now

    def wall(self) -> float:
        return 1e9 + self.now

    def poll(self, numbers: Sequence[int], seconds: float | None) -> set[int]:
        self.now += seconds or 0.0
        return set()


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    found = Layout(tmp_path / "project", "bench")
    for folder in (found.logs, found.run, found.daemon, found.endpoint, found.committed / "serve"):
        folder.mkdir(parents=True)
    (tmp_path / "root/sys/bus").mkdir(parents=True)
    return found


def opened(layout: Layout, tmp_path: Path) -> EventSources:
    return open_sources(layout, {"OCTOFORM_SYSROOT": str(tmp_path / "root")}, Timing(interval=1000, ping=1000))


def test_with_watches_enough_nothing_is_looked_at_and_nothing_is_said(layout: Layout, tmp_path: Path) -> None:
    sources = opened(layout, tmp_path)
    assert (sources.unwatched.folders, sources.unwatched.diagnostic(), sources.unwatched.hear()) == (
        0,
        None,
        frozenset(),
    )
    sources.close()


def test_what_cannot_be_watched_is_looked_at_every_few_seconds_and_told(
    layout: Layout, tmp_path: Path, full: list[str]
) -> None:
    full += ["/log", "/serve"]
    sources = opened(layout, tmp_path)
    assert sources.unwatched.hear() == {Cause.LOG, Cause.FILES}
    found = sources.unwatched.diagnostic()
    assert found is not None and found.code == "DAEMON-FEW-WATCHES"
    assert found.summary.startswith(f"2 folders are looked at every {LOOK_SECONDS:g} s")
    full.clear()
    (layout.daemon / "asked.json").write_text("{}")  # whatever is heard, the list is brought up to date
    sources.wait(1.0)
    for ear in sources.unwatched._ears:
        ear.follow()
    assert sources.unwatched.hear() == frozenset() and sources.unwatched.diagnostic() is None
    sources.close()


def test_it_takes_no_event_to_look(layout: Layout, tmp_path: Path, full: list[str]) -> None:
    clock, listening = Clock(), opened(layout, tmp_path)
    ears = listening.unwatched._ears
    sources = EventSources(ProcessEar(), ears, Timing(1000.0), clock, clock.poll)
    assert sources.wait(100.0) == frozenset() and clock.now == 1100.0, "nobody wakes for nothing"
    full += ["/log"]
    (layout.logs / "octoform.jsonl").write_text("")
    layout.logs.rename(tmp_path / "elsewhere")
    layout.logs.mkdir()
    for ear in ears:
        ear.hear()
    sources.follow(Facts(0.0, "", "bench"))
    assert sources.wait(None) == {Cause.LOG, Cause.FILES}
    assert clock.now == 1100.0 + LOOK_SECONDS
    assert sources.wait(None) == {Cause.LOG, Cause.FILES} and clock.now == 1100.0 + 2 * LOOK_SECONDS
    sources.close()
    os.close(listening._bell)
