"""The daemon's child as a real process: it does one job, takes nothing else for one, and never outlives its daemon."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from octoform.daemon.repair.worker import BAD_JOB, JOBS, STOPPED
from octoform.state.layout import Layout
from octoform.state.store.lock import acquire

WORKER = [sys.executable, "-m", "octoform.daemon.repair.worker"]
IN_BETWEEN = """
import os, subprocess, sys
child = subprocess.Popen(sys.argv[2:], stdin=open(sys.argv[1]), start_new_session=True)
print(child.pid, flush=True)
child.wait()
"""


def asked(job: str, project: Path, parent: int | None = None, **more: Any) -> bytes:
    brief = {"host": "bench", **more}
    document = {"format": 1, "job": job, "project": str(project), "parent": parent or os.getpid(), "brief": brief}
    return json.dumps(document).encode()


def ran(feed: bytes) -> tuple[int, dict[str, Any]]:
    done = subprocess.run(WORKER, input=feed, capture_output=True, timeout=60, check=False)
    return done.returncode, json.loads(done.stdout.decode().strip().rpartition("\n")[2])


@contextmanager
def busy(project: Path) -> Iterator[Callable[[], bool]]:
    """A lock that a child waits for; true once it does, and it has the kernel's word to end with its parent by then."""
    layout = Layout(project, "bench")
    held = acquire(layout, "apply")
    assert held.lock is not None
    guard = layout.lock.with_name("lock.guard")
    guard.unlink()
    with held.lock:
        yield guard.exists


def test_it_does_a_job_and_says_so_in_one_line(tmp_path: Path) -> None:
    status, result = ran(asked("rotate", tmp_path, log="server.log"))
    assert status == 0
    assert (result["verdict"], result["detail"], result["again"]) == ("done", "there is no server.log", True)


@pytest.mark.parametrize(
    "feed",
    [b"", b"[]", b'{"format": 1}', b'{"format":1,"job":"dance","project":"/","parent":1,"brief":{}}'],
)
def test_what_is_no_job_is_refused_once_and_for_all(feed: bytes) -> None:
    status, result = ran(feed)
    assert (status, result["ok"], result["again"]) == (BAD_JOB, False, False)


def test_a_job_of_a_daemon_that_is_gone_is_not_begun(tmp_path: Path) -> None:
    status, result = ran(asked("rotate", tmp_path, parent=os.getppid(), log="server.log"))
    assert (status, result["ok"]) == (STOPPED, False)


def test_it_is_told_to_end_and_ends_in_order(tmp_path: Path) -> None:
    with busy(tmp_path) as asks:
        process = subprocess.Popen(WORKER, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert process.stdin is not None and process.stdout is not None
        process.stdin.write(asked("rebind", tmp_path, device="usb-1f00-00a1"))
        process.stdin.close()
        _until(asks)
        process.send_signal(signal.SIGTERM)
        result = json.loads(process.stdout.read())
        assert process.wait(20) == STOPPED
        assert (result["verdict"], result["detail"]) == ("failed", "rebind: it was asked to end")
        assert result["again"] is True and result["cost"] is None


def test_it_ends_when_its_daemon_is_killed(tmp_path: Path) -> None:
    with busy(tmp_path) as asks:
        os.mkfifo(tmp_path / "feed")
        daemon = subprocess.Popen(
            [sys.executable, "-c", IN_BETWEEN, str(tmp_path / "feed"), *WORKER], stdout=subprocess.PIPE, text=True
        )
        (tmp_path / "feed").write_bytes(asked("rebind", tmp_path, parent=daemon.pid, device="usb-1f00-00a1"))
        assert daemon.stdout is not None
        child = int(daemon.stdout.readline())
        _until(asks)
        daemon.kill()
        daemon.wait()
        _until(lambda: not _lives(child))
        daemon.stdout.close()


def _lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def _until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 10  # the job itself would give up after 20 s
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_every_repair_and_every_duty_has_its_job() -> None:
    duties = {"settings", "watch", "heal", "roll_back", "look", "settle"}
    repairs = {"restart", "restore", "republish", "rebuild", "rebind", "rotate", "rediscover"}
    assert set(JOBS) == duties | repairs
