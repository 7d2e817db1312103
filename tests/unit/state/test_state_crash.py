"""kill -9 at every point of an apply: what is left opens, is consistent, and the next apply completes it."""

import itertools
import os
import shutil
import signal
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from unit.state.state_scenario import NODES, apply, files_of, settled

from octoform.base.files import TEMPORARY
from octoform.state.accepted import file_digest
from octoform.state.layout import Layout
from octoform.state.model import Status, content_digest
from octoform.state.store.quick_read import peek
from octoform.state.store.store import StateStore


def points(project: Path, version: int) -> list[str]:
    """The names of all crash points that an undisturbed apply passes, in order."""
    names: list[str] = []
    apply(project, version, names.append)
    return names


def killed(work: Callable[[], object]) -> int:
    """Run ``work`` in a process of its own; the signal that ended it."""
    pid = os.fork()
    if pid == 0:
        try:
            work()
        finally:
            os._exit(3)
    _, status = os.waitpid(pid, 0)
    assert os.WIFSIGNALED(status), f"the process ended by itself: {status}"
    return os.WTERMSIG(status)


def kill_at(number: int) -> Callable[[str], None]:
    """A checkpoint that kills its process at the point of that number."""
    counter = itertools.count()

    def checkpoint(name: str) -> None:
        if next(counter) == number:
            os.kill(os.getpid(), signal.SIGKILL)

    return checkpoint


def check_truth(layout: Layout, names: list[str], at: int) -> None:
    """What an interrupted apply left: readable, and nothing accepted that is not wholly there."""
    store, found = StateStore.open(layout)
    assert store is not None and found == [], (names[at], found)
    for node, state in store.snapshot.nodes.items():
        if state.status is Status.ACCEPTED and node in NODES:
            assert state.file_digest == file_digest(layout, node), (names[at], node)
    began = names[: at + 1].count("journal.begin.synced")
    ended = sum(names[: at + 1].count(f"journal.{op}.written") for op in ("success", "failure"))
    if began > ended and "journal.begin.synced" in names[:at]:
        assert [name for name, state in store.snapshot.nodes.items() if state.status is Status.INTERRUPTED], names[at]


CHANGES = ("written", "renamed", "cleared")
"""How the points are called behind which something else stands on the disk than at the point before: what a killed
process has written stays, synced or not. `make faults` kills at the others too (EVERY_POINT)."""


@pytest.mark.parametrize("version", [1, 2])
def test_a_kill_at_any_point_is_survived(quick_path: Path, version: int) -> None:
    clean = quick_path / "clean"
    clean.mkdir()
    if version == 2:
        apply(clean, 1, lambda name: None)
    before = quick_path / "before"
    shutil.copytree(clean, before)
    names = points(clean, version)
    assert len(names) > 40
    store = StateStore.open(Layout(clean, "bench"))[0]
    assert store is not None
    wanted = content_digest(store.snapshot.model_copy(update={"lineage": "same"}))
    for number, name in enumerate(names):
        if number and not name.endswith(CHANGES) and not os.environ.get("EVERY_POINT"):
            continue
        project = quick_path / f"kill{number}"
        shutil.copytree(before, project)
        layout = Layout(project, "bench")
        lineage = (peek(layout) or {}).get("lineage")
        assert killed(partial(apply, project, version, kill_at(number))) == signal.SIGKILL
        check_truth(layout, names, number)
        after = apply(project, version, lambda name: None)
        assert content_digest(after.model_copy(update={"lineage": "same"})) == wanted, names[number]
        assert lineage in (None, after.lineage)
        for node in NODES:
            assert settled(layout, after, node, version)
            there = {path.name for path in (layout.committed / node).rglob("*") if path.is_file()}
            assert there == {Path(name).name for name in files_of(node, version)}, names[number]
        assert list(layout.committed.rglob(f".*{TEMPORARY}")) == [], names[number]
        assert peek(layout) is not None
        shutil.rmtree(project)


def test_every_kind_of_point_is_among_them(quick_path: Path) -> None:
    names = set(points(quick_path, 1)) | set(points(quick_path, 2))
    steps = {
        f"journal.{op}.{when}"
        for op in ("head", "begin", "success", "failure", "commit")
        for when in ("start", "written", "synced")
    }
    files = {f"{name}.{when}" for name in ("snapshot", "backup") for when in ("start", "written", "renamed", "synced")}
    assert steps | files | {"journal.cleared", "artifact.start", "artifact.written", "artifact.renamed"} <= names


def test_a_second_kill_while_the_first_is_repaired(quick_path: Path) -> None:
    """The journal of a killed run is continued by a run that is killed too."""
    base = quick_path / "base"
    base.mkdir()
    apply(base, 1, lambda name: None)
    total = 60
    for first, second in itertools.product(range(0, total, 11), range(0, total, 17)):
        project = quick_path / f"k{first}-{second}"
        shutil.copytree(base, project)
        for number in (first, second):
            pid = os.fork()
            if pid == 0:
                try:
                    apply(project, 2, kill_at(number))
                    os._exit(0)
                finally:
                    os._exit(3)
            _, status = os.waitpid(pid, 0)
            assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0, (first, second)
        after = apply(project, 2, lambda name: None)
        assert all(settled(Layout(project, "bench"), after, node, 2) for node in NODES)
        shutil.rmtree(project)
