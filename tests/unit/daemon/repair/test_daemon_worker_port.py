"""Children of the daemon: bounded, with a result in every case, and none outlives it."""

import errno
import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from waiting import until

from octoform.base.processes import start_of
from octoform.daemon.repair.worker import Workers

ECHO = """
import json, sys
asked = json.load(sys.stdin)
print("a library says hello")
print(json.dumps({"ok": True, "detail": asked["job"], "asked": asked}))
"""
WORKING = """
import os, subprocess, sys
from octoform.daemon.repair import worker

def heal(project, brief):
    agent = subprocess.Popen(["sleep", "600"])
    try:
        with open(os.path.join(project, "agent"), "w") as told:  # a finalizer would swallow the end that comes in it
            told.write(f"{os.getpid()} {agent.pid}\\n")
        agent.wait()
    finally:
        agent.kill()
        agent.wait()
        open(os.path.join(project, "in order"), "w").close()
    return {"ok": True}

worker.JOBS = {"heal": heal}
sys.exit(worker.main())
"""
DAEMON = """
import os, sys, threading
from pathlib import Path
from octoform.daemon.main import _stopping
from octoform.daemon.repair.worker import Workers

workers = Workers(Path(sys.argv[1]), os.environ, [sys.executable, "-c", sys.argv[2]])
threading.Thread(target=lambda: print(workers.run("heal", {}, 600), flush=True), daemon=True).start()
with _stopping() as told:
    while told.number is None:
        threading.Event().wait(0.05)
    workers.end()
"""


def workers(folder: Path, code: str) -> Workers:
    return Workers(folder, os.environ, [sys.executable, "-c", code])


def pids(folder: Path) -> list[int]:
    """The child and its agent, once both run."""
    path = folder / "agent"
    assert until(lambda: path.exists() and path.read_text().endswith("\n"))
    return [int(word) for word in path.read_text().split()]


def gone(found: list[int]) -> bool:
    return all(start_of(pid) is None for pid in found)


def test_a_job_is_asked_and_its_last_line_is_the_result(tmp_path: Path) -> None:
    found = workers(tmp_path, ECHO).run("rebuild", {"host": "bench"}, 30)
    assert found["ok"] is True
    asked = {"format": 1, "job": "rebuild", "project": str(tmp_path), "parent": os.getpid(), "brief": {"host": "bench"}}
    assert found["asked"] == asked


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("import sys; sys.exit('no such thing')", "status 1 and without a result: no such thing"),
        ("print('[1]')", "without a result"),
        ("import os; os.abort()", "status -6"),
        ("import time; time.sleep(600)", "took more than 1 s"),
    ],
)
def test_a_child_without_a_result_is_a_failure_that_tells_why(tmp_path: Path, code: str, words: str) -> None:
    found = workers(tmp_path, code).run("rebuild", {}, 1)
    assert found["ok"] is False and found["again"] is True and found["cost"] is None
    assert words in found["detail"]


def test_the_end_of_the_daemon_ends_a_child_and_its_agent_and_none_begins_after_it(tmp_path: Path) -> None:
    port = workers(tmp_path, WORKING)
    made: list[object] = []
    thread = threading.Thread(target=lambda: made.append(port.run("heal", {}, 600)))
    thread.start()
    found = pids(tmp_path)
    port.end()
    thread.join(20)
    assert gone(found) and (tmp_path / "in order").exists()
    (lost,) = json.loads(json.dumps(made))
    assert (lost["verdict"], lost["detail"], lost["cost"]) == ("failed", "heal: it was ended with the daemon", None)
    none = port.run("heal", {}, 600)
    assert (none["verdict"], none["cost"]["calls"]) == ("refused", 0), "none was begun"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_however_a_daemon_ends_its_agent_ends(tmp_path: Path, number: signal.Signals) -> None:
    with subprocess.Popen([sys.executable, "-c", DAEMON, str(tmp_path), WORKING], stdout=subprocess.PIPE) as daemon:
        found = pids(tmp_path)
        daemon.send_signal(number)
        assert daemon.wait(30) == (-9 if number == signal.SIGKILL else 0)
        assert until(lambda: gone(found) and (tmp_path / "in order").exists())


def test_a_child_that_the_system_does_not_start_has_failed_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))

    monkeypatch.setattr(subprocess, "Popen", refuse)
    result = workers(tmp_path, ECHO).run("heal", {}, 10)
    assert (result["ok"], result["detail"]) == (False, "heal: no more processes or threads can be started")


@pytest.mark.parametrize("module", ["json", "octoform"])
def test_nothing_in_the_projects_folder_is_taken_for_a_module(tmp_path: Path, module: str) -> None:
    """A child begins in that folder, where an agent may have left anything."""
    (tmp_path / f"{module}.py").write_text("open('ran', 'w').close()\n")
    Workers(tmp_path, os.environ).run("no such job", {}, 60.0)
    assert not (tmp_path / "ran").exists()
