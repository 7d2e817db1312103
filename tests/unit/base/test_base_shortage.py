"""A refused thread and a refused fork are one problem, with the limits that made it."""

import errno
import os
import resource
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from ordinary import POSSIBLE, ordinary_user

from octoform.base import shortage

FORK_AND_THREAD = """
import subprocess, sys, threading, time
sys.path.insert(0, sys.argv[1])
from octoform.base import shortage
held = threading.Event()
found = []
try:
    for _ in range(100):
        shortage.start(threading.Thread(target=held.wait, daemon=True))
except OSError as problem:
    found.append(shortage.is_shortage(problem))
try:
    subprocess.run(["true"])
except OSError as problem:
    found.append(shortage.is_shortage(problem))
held.set()
print(found, shortage.limits())
"""


@pytest.mark.skipif(not POSSIBLE, reason="only root can become another user")
def test_the_kernel_refuses_a_thread_and_a_fork() -> None:
    with ordinary_user(40000 + os.getpid() % 20000) as user:
        root = Path(__file__).resolve().parents[3]
        command = ["prlimit", "--nproc=8:8", sys.executable, "-c", FORK_AND_THREAD, str(root)]
        done = subprocess.run([*user.prefix, *command], capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout.startswith("[True, True] ulimit -u is 8"), done


def test_a_refused_thread_is_an_error_of_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    with pytest.raises(BlockingIOError) as raised:
        shortage.start(threading.Thread())
    assert shortage.is_shortage(raised.value)


def test_what_is_no_shortage() -> None:
    assert not shortage.is_shortage(BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN), "a.lock"))
    assert not shortage.is_shortage(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    assert not shortage.is_shortage(RuntimeError("can't start new thread"))


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("OS can't spawn worker thread: Resource temporarily unavailable (os error 11)", True),
        ("RuntimeError: can't start new thread", True),
        ("bwrap: No permissions to create new namespace", False),
    ],
)
def test_programs_print_it_in_their_own_words(text: str, holds: bool) -> None:
    assert shortage.printed(text) is holds


def test_the_smallest_bound_of_the_control_groups_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shortage, "_pids_max", lambda: ("/sys/fs/cgroup/x", 7))
    monkeypatch.setattr(resource, "getrlimit", lambda _: (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    assert shortage.limits() == "pids.max of /sys/fs/cgroup/x is 7"


def test_a_bound_on_memory_is_among_the_limits_since_a_thread_needs_a_stack(monkeypatch: pytest.MonkeyPatch) -> None:
    found = {resource.RLIMIT_NPROC: resource.RLIM_INFINITY, resource.RLIMIT_AS: 200_000 * 1024}
    monkeypatch.setattr(resource, "getrlimit", lambda which: (found[which], found[which]))
    assert "ulimit -v is 200000" in shortage.limits() and "ulimit -u" not in shortage.limits()
    found[resource.RLIMIT_AS] = resource.RLIM_INFINITY
    assert "ulimit -v" not in shortage.limits()
