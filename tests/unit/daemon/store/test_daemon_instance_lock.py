"""One daemon for each host; what a person asks of it is noticed, whether it runs or not."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from octoform.base.place import is_from
from octoform.daemon.store import instance_lock
from octoform.state.layout import Layout

HOLDER = """
import sys
from pathlib import Path
from octoform.daemon.store import instance_lock
from octoform.state.layout import Layout
owned, problem = instance_lock.take(Layout(Path(sys.argv[1]), "bench"), "2026-11-22T12:00:00Z", 5.0, "1")
print("taken" if owned else problem.code, flush=True)
sys.stdin.read()
"""


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    return Layout(tmp_path, "bench")


def holder(layout: Layout) -> "subprocess.Popen[str]":
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(layout.project)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "taken\n"
    return process


def test_a_second_daemon_is_refused_and_a_killed_one_is_in_nobodys_way(layout: Layout) -> None:
    with holder(layout) as process:
        owned, problem = instance_lock.take(layout, "now", 1.0, "1")
        assert owned is None and problem is not None
        assert problem.code == "DAEMON-RUNNING" and f"process {process.pid}" in problem.summary
        found = instance_lock.alive(layout)
        assert found is not None and (found.process.pid, found.uptime) == (process.pid, 5.0)
        process.kill()
        process.wait()
    assert instance_lock.alive(layout) is None
    assert (layout.daemon / instance_lock.RECORD).exists(), "the killed one left its record"
    owned, problem = instance_lock.take(layout, "now", 1.0, "1")
    assert owned is not None and problem is None
    owned.release()
    assert instance_lock.alive(layout) is None and not (layout.daemon / instance_lock.RECORD).exists()


def test_what_somebody_deleted_is_there_again_and_a_second_daemon_is_still_refused(layout: Layout) -> None:
    owned, _ = instance_lock.take(layout, "now", 1.0, "1")
    assert owned is not None
    shutil.rmtree(layout.daemon)
    assert instance_lock.alive(layout) is None
    assert owned.keep() is None
    assert instance_lock.alive(layout) is not None
    assert instance_lock.take(layout, "now", 1.0, "1")[0] is None
    owned.release()
    assert not (layout.daemon / instance_lock.RECORD).exists()


def test_who_was_replaced_while_nothing_told_of_it_says_so_and_leaves_the_other_ones_record(layout: Layout) -> None:
    owned, _ = instance_lock.take(layout, "now", 1.0, "1")
    assert owned is not None
    shutil.rmtree(layout.daemon)
    with holder(layout) as process:
        problem = owned.keep()
        assert problem is not None and problem.code == instance_lock.TAKEN
        assert f"process {process.pid}" in problem.summary
        owned.release()
        found = instance_lock.alive(layout)
        assert found is not None and found.process.pid == process.pid
        process.kill()


def test_a_record_without_the_lock_is_believed_by_nobody(layout: Layout) -> None:
    owned, _ = instance_lock.take(layout, "now", 1.0, "1")
    assert owned is not None
    record = (layout.daemon / instance_lock.RECORD).read_bytes()
    owned.release()
    (layout.daemon / instance_lock.RECORD).write_bytes(record)
    assert instance_lock.alive(layout) is None


@pytest.mark.parametrize("text", ["", "{", "[]", '{"pid": "x"}'])
def test_a_damaged_record_is_no_daemon_and_the_lock_still_counts(layout: Layout, text: str) -> None:
    with holder(layout) as process:
        (layout.daemon / instance_lock.RECORD).write_text(text)
        assert instance_lock.alive(layout) is None
        _, problem = instance_lock.take(layout, "now", 1.0, "1")
        assert problem is not None and "another process" in problem.summary
        process.kill()


def test_pausing_is_seen_also_where_its_file_cannot_be_read(layout: Layout) -> None:
    assert instance_lock.paused_since(layout) is None
    assert instance_lock.pause(layout, "2026-11-22T12:00:00Z") is None
    assert instance_lock.paused_since(layout) == "2026-11-22T12:00:00Z"
    (layout.daemon / instance_lock.PAUSED).write_text("{")
    assert instance_lock.paused_since(layout) == ""
    assert instance_lock.resume(layout) == (True, None) and instance_lock.resume(layout) == (False, None)
    assert instance_lock.paused_since(layout) is None


def test_what_is_asked_is_taken_up_once_and_nothing_is_lost(layout: Layout) -> None:
    assert instance_lock.taken_up(layout) == ()
    instance_lock.ask(layout, ["endpoint"])
    instance_lock.ask(layout, ["tool:a", "endpoint"])
    assert instance_lock.taken_up(layout) == ("endpoint", "tool:a")
    assert instance_lock.taken_up(layout) == ()
    instance_lock.ask(layout, (f"tool:{number}" for number in range(500)))
    assert len(instance_lock.taken_up(layout)) == 64


def test_the_folder_is_private(layout: Layout) -> None:
    owned, _ = instance_lock.take(layout, "now", 1.0, "1")
    assert owned is not None
    assert layout.daemon.stat().st_mode & 0o777 == 0o700
    assert {path.stat().st_mode & 0o777 for path in layout.daemon.iterdir()} == {0o600}
    owned.release()


def test_what_pauses_and_cannot_be_removed_is_told(layout: Layout) -> None:
    (layout.daemon / instance_lock.PAUSED).mkdir(parents=True)
    was, problem = instance_lock.resume(layout)
    assert was and problem is not None and problem.path is not None and problem.path.endswith("paused.json")
    assert instance_lock.paused_since(layout) == ""


def test_a_copied_record_is_no_daemons_of_the_copy_even_where_another_holds_its_lock(layout: Layout) -> None:
    with holder(layout) as process:
        other = Layout(layout.project.with_name(f"{layout.project.name}-copy"), "bench")
        shutil.copytree(layout.daemon, other.daemon)
        descriptor, problem = instance_lock._lock(other)
        assert descriptor is not None and problem is None
        assert instance_lock.alive(other) is None
        found = instance_lock.alive(layout)
        assert found is not None and found.process.pid == process.pid
        moved = layout.daemon.with_name("moved")
        layout.daemon.rename(moved)
        assert is_from(json.loads((moved / instance_lock.RECORD).read_text()), moved)
        moved.rename(layout.daemon)
        os.close(descriptor)
        process.kill()
