"""Foreign programs: bounded, and gone afterwards."""

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from octoform.endpoint.bounded_program import base_environment, run

DETACHED = """
import os, sys, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        while True:
            time.sleep(1)
    os._exit(0)
os.wait()
print("started", flush=True)
if "stay" in sys.argv:
    time.sleep(60)
"""


BARE = DETACHED.replace(
    "        while True:\n            time.sleep(1)",
    "        os.execve(sys.executable, [sys.executable, '-I', '-S', '-c', 'import time; time.sleep(600)'], {})",
)


def test_output_and_status_come_back(tmp_path: Path) -> None:
    program = "import sys; print(sys.stdin.read().upper()); print('no', file=sys.stderr); sys.exit(3)"
    done = run([sys.executable, "-c", program], cwd=tmp_path, environment={}, timeout=20, stdin="yes")
    assert (done.status, done.stdout, done.stderr, done.survivors) == (3, "YES\n", "no\n", 0)


def test_a_grandchild_in_its_own_session_does_not_survive(tmp_path: Path) -> None:
    done = run([sys.executable, "-c", DETACHED], cwd=tmp_path, environment=base_environment(), timeout=20)
    assert (done.status, done.stdout, done.survivors) == (0, "started\n", 1)


def test_a_grandchild_without_any_variable_does_not_survive(tmp_path: Path) -> None:
    done = run([sys.executable, "-c", BARE], cwd=tmp_path, environment=base_environment(), timeout=20)
    assert (done.status, done.stdout, done.survivors) == (0, "started\n", 1)


def test_the_mark_is_on_before_the_program_begins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However late this process gets its turn, the first thing that the program starts bears the mark."""
    begin = subprocess.Popen.__init__

    def late(self: Any, *given: Any, **named: Any) -> None:
        begin(self, *given, **named)
        time.sleep(0.5)

    monkeypatch.setattr(subprocess.Popen, "__init__", late)
    done = run([sys.executable, "-I", "-S", "-c", BARE], cwd=tmp_path, environment=base_environment(), timeout=20)
    assert (done.status, done.survivors) == (0, 1)


def test_the_time_limit_ends_the_whole_tree(tmp_path: Path) -> None:
    done = run([sys.executable, "-c", DETACHED, "stay"], cwd=tmp_path, environment=base_environment(), timeout=1.5)
    assert done.timed_out
    assert done.seconds < 10
    assert done.survivors == 1


def test_a_child_sees_no_secret_of_ours(tmp_path: Path, monkeypatch: object) -> None:
    done = run(
        [sys.executable, "-c", "import os; print(*os.environ)"], cwd=tmp_path, environment={"A": "1"}, timeout=20
    )
    assert set(done.stdout.split()) <= {"A", "OCTOFORM_RUN", "LC_CTYPE"}
