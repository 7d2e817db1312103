"""What happens to an agent's tree when octoform, or octoform and the supervisor, are killed with SIGKILL."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from unit.harness.harness_agents import alive, noted, python
from waiting import until

from octoform.base import processes
from octoform.base.processes import is_alive, signal_one
from octoform.harness.containment import orphans
from octoform.harness.containment.agent_environment import ATTEMPT
from octoform.harness.containment.orphans import Record

DRIVER = """
import json, sys
from pathlib import Path
from octoform.harness.containment.contained_run import Limits, Program, run
class Silent:
    def feed(self, stream, data): pass
    def tick(self): return False
    def finish(self): pass
work = Path(sys.argv[1])
run(Program(tuple(sys.argv[2:]), work, {"PATH": "/usr/bin:/bin"}, work / "task.log"), Limits(60), Silent())
"""

STUBBORN = """
if os.fork() == 0:
    os.setsid()
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    if os.fork() == 0:
        env = {}
        os.execve(sys.executable, [sys.executable, "-I", "-S", "-c", SCRUBBED], env)
    note("stubborn")
    time.sleep(600)
note("agent")
time.sleep(600)
"""
SCRUBBED = "import os, time; open('scrubbed', 'w').write(str(os.getpid())); time.sleep(600)"


@contextmanager
def octoform_running(attempt: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Another process that runs an agent; when the block begins, its whole tree stands."""
    attempt.mkdir(parents=True)
    agent = python(f"SCRUBBED = {SCRUBBED!r}" + STUBBORN)
    with subprocess.Popen([sys.executable, "-c", DRIVER, str(attempt), *agent]) as driver:
        try:
            until(lambda: all((attempt / name).exists() for name in ("agent", "stubborn")))
            until(lambda: (attempt / "scrubbed").exists() and (attempt / "scrubbed").read_text() != "")
            yield driver
        finally:
            driver.kill()


def scrubbed(attempt: Path) -> orphans.Process:
    found = orphans.look(int((attempt / "scrubbed").read_text()))
    assert found is not None
    return found


def test_the_death_of_octoform_ends_the_whole_tree(tmp_path: Path) -> None:
    attempt = tmp_path / "attempts" / "1-probe-1"
    with octoform_running(attempt) as driver:
        members = [noted(attempt / "agent"), noted(attempt / "stubborn"), scrubbed(attempt)]
        assert all(alive(member) for member in members)
        driver.kill()
    until(lambda: not any(alive(member) for member in members))


def test_what_both_deaths_leave_is_swept_and_nothing_else(tmp_path: Path) -> None:
    attempts = tmp_path / "attempts"
    attempt = attempts / "1-probe-1"
    other = attempts / "2-probe-1"
    bystander = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], stdout=subprocess.DEVNULL)
    marked = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], env={ATTEMPT: processes.new()})
    try:
        with octoform_running(attempt) as driver:
            record = orphans.read(attempt)
            assert record is not None
            members = [noted(attempt / "stubborn"), scrubbed(attempt)]
            os.kill(record.pid, signal.SIGSTOP)
            driver.kill()
            driver.wait()
            os.kill(record.pid, signal.SIGKILL)
        until(lambda: not is_alive(record.pid, record.start))
        assert all(alive(member) for member in members)
        # A record whose process id belongs to another process by now: its mark is stale.
        other.mkdir()
        orphans.write(other, Record(processes.new(), bystander.pid, 1))
        swept = orphans.sweep(attempts)
        assert {member.pid for member in members} <= set(swept.ended)
        assert swept.left == ()
        assert not any(alive(member) for member in members)
        assert bystander.poll() is None
        assert marked.poll() is None
        assert orphans.sweep(attempts) == orphans.Swept()
        assert json.loads((attempt / "process.json").read_text())["ended"] is True
    finally:
        for process in (bystander, marked):
            process.kill()
            process.wait()


def test_a_process_older_than_the_attempt_is_not_ours(tmp_path: Path) -> None:
    mark = processes.new()
    older = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], env={ATTEMPT: mark})
    try:
        found = orphans.look(older.pid)
        assert found is not None
        until(lambda: processes.bears(older.pid, mark, ATTEMPT))
        assert orphans.end_marked((Record(mark, 4_000_000, found.start + 1),)) == orphans.Swept()
        assert older.poll() is None
        assert orphans.end_marked((Record(mark, 4_000_000, found.start),)).ended == (older.pid,)
        assert older.wait() == -signal.SIGKILL
    finally:
        older.kill()
        older.wait()


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"{}", b'{"attempt": "short", "supervisor": {}}', b"\xff\xfe"])
def test_a_spoilt_record_proves_nothing(tmp_path: Path, content: bytes) -> None:
    (tmp_path / orphans.RECORD).write_bytes(content)
    assert orphans.read(tmp_path) is None


def test_a_record_that_is_a_link_is_not_read(tmp_path: Path) -> None:
    orphans.write(tmp_path, Record(processes.new(), 1, 1))
    (tmp_path / orphans.RECORD).rename(tmp_path / "elsewhere.json")
    (tmp_path / orphans.RECORD).symlink_to(tmp_path / "elsewhere.json")
    assert orphans.read(tmp_path) is None


def test_a_recycled_process_id_is_not_signalled() -> None:
    child = subprocess.Popen(["sleep", "600"])
    try:
        found = orphans.look(child.pid)
        assert found is not None
        assert not signal_one(found.pid, found.start - 1)
        assert child.poll() is None
    finally:
        child.kill()
        child.wait()


def test_the_private_folders_of_dead_attempts_go_and_nothing_else(tmp_path: Path) -> None:
    attempt = tmp_path / "attempts" / "000001-probe-1"
    for name in ("home/.cache", "tmp/build", "home2"):
        (attempt / name).mkdir(parents=True)
    (attempt / "agent.log").write_text("the log\n")
    other = tmp_path / "others"
    (other / "home").mkdir(parents=True)
    (tmp_path / "attempts" / "000002-probe-1").symlink_to(other)
    assert orphans.sweep(tmp_path / "attempts") == orphans.Swept()
    assert sorted(path.name for path in attempt.iterdir()) == ["agent.log", "home2"]
    assert (other / "home").exists()


def test_no_attempts_at_all(tmp_path: Path) -> None:
    assert orphans.sweep(tmp_path / "missing") == orphans.Swept()
