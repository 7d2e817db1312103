"""The kernel's facts of a process: a name that looks like the line itself, a zombie, one that is stopped, none."""

import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from waiting import until

from octoform.base import processes
from octoform.base.processes import is_alive, process_stat, signal_group, signal_one, start_of

SLEEPS = [sys.executable, "-c", "import time; time.sleep(60)"]
LOOKS_AS_NOBODY = """
import os, sys
from octoform.base.processes import bears
os.setgroups([]), os.setgid(65534), os.setuid(65534)
sys.exit([bears(int(sys.argv[1]), mark, "NONE") for mark in sys.argv[2:]] != [True, False])
"""


def test_a_process_is_known_by_its_start_and_parent() -> None:
    me = process_stat(os.getpid())
    assert me is not None and (me.parent, me.group) == (os.getppid(), os.getpgrp())
    assert not me.is_over and not me.is_stopped and me.threads >= 1 and me.start > 0


def test_a_stopped_one_stands_still_and_a_zombie_is_over() -> None:
    with subprocess.Popen(SLEEPS) as child:
        child.send_signal(signal.SIGSTOP)
        until(lambda: (found := process_stat(child.pid)) is not None and found.is_stopped, "it stands still")
        child.kill()
        until(lambda: (found := process_stat(child.pid)) is not None and found.is_over, "it is a zombie")
        child.wait()
        assert process_stat(child.pid) is None


def test_a_name_may_hold_anything(tmp_path: Path) -> None:
    fields = " ".join(["S", "1", "42", *"0" * 14, "3", "0", "777"])
    (tmp_path / "7").mkdir()
    for name in ("a) b (c", ") Z 9 9 (", "\n"):
        (tmp_path / "7" / "stat").write_text(f"7 ({name}) {fields}\n")
        assert process_stat(7, tmp_path) == ("S", 1, 42, 3, 777)
    for broken in ("", "7 (x", "7 (x) S one", "7 (x) S 1 2"):
        (tmp_path / "7" / "stat").write_text(broken)
        assert process_stat(7, tmp_path) is None
    assert process_stat(8, tmp_path) is None


def test_a_process_lives_until_it_ends_and_a_zombie_does_not() -> None:
    with subprocess.Popen(SLEEPS) as child:
        start = start_of(child.pid)
        assert is_alive(child.pid, start) and not is_alive(child.pid, None)
        while not processes.command_line(child.pid):
            continue  # the kernel lets the parent go on before it has put down the arguments
        assert processes.command_line(child.pid) == tuple(SLEEPS)
        child.kill()
        until(lambda: start_of(child.pid) is None, "it is a zombie")
        assert not is_alive(child.pid, start), "its id is still its own, and it is over"
        assert not signal_one(child.pid, start)
    assert processes.command_line(child.pid) == ()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root becomes another user")
def test_the_mark_on_another_users_process_is_seen() -> None:
    mark = processes.new()
    with subprocess.Popen(SLEEPS) as other:
        try:
            assert processes.put_on(mark, other.pid)
            looking = [sys.executable, "-c", LOOKS_AS_NOBODY, str(other.pid), mark, processes.new()]
            assert subprocess.run(looking).returncode == 0
        finally:
            other.kill()


def test_another_process_with_the_same_id_is_never_signalled() -> None:
    """The id was given again: what lives there now started at another tick."""
    with subprocess.Popen(SLEEPS) as child:
        start = start_of(child.pid)
        assert start is not None
        assert not signal_one(child.pid, start - 1) and not is_alive(child.pid, start - 1)
        assert not signal_one(child.pid, None)
        assert child.poll() is None
        assert signal_one(child.pid, start) and child.wait() == -signal.SIGKILL
        assert not signal_one(child.pid, start), "it is gone"


def test_a_signal_may_be_any() -> None:
    with subprocess.Popen(SLEEPS) as child:
        assert signal_one(child.pid, start_of(child.pid), signal.SIGTERM) and child.wait() == -signal.SIGTERM


FORKS = """
import os, sys, time
print(os.getpid(), flush=True)
if os.fork() == 0:
    if os.fork() == 0:
        time.sleep(60)
    os._exit(0)
os.wait()
time.sleep(60)
"""


def test_what_a_group_leader_has_forked_twice_ends_with_its_group() -> None:
    """Nothing of it is a child of ours: that it ended shows in the pipe that it held open."""
    command = [sys.executable, "-c", FORKS]
    with subprocess.Popen(command, stdout=subprocess.PIPE, process_group=0) as leader:
        assert leader.stdout is not None and leader.stdout.readline()
        signal_group(leader)
        assert leader.wait() == -signal.SIGKILL
        assert select.select([leader.stdout], [], [], 30.0)[0] and leader.stdout.read() == b""
        signal_group(leader)  # it was waited for: its id may be anybody's


def test_a_group_that_was_waited_for_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    with subprocess.Popen([sys.executable, "-c", ""], process_group=0) as leader:
        leader.wait()
        monkeypatch.setattr(os, "killpg", lambda *_: pytest.fail("the group may be another's"))
        signal_group(leader)
    monkeypatch.undo()
    with subprocess.Popen([sys.executable, "-c", ""], process_group=0) as leader:
        until(lambda: start_of(leader.pid) is None, "it is a zombie")
        signal_group(leader)
        assert leader.wait() == 0


def test_without_proc_nothing_is_known_and_nothing_is_signalled(monkeypatch: pytest.MonkeyPatch) -> None:
    nowhere = Path("/nowhere")
    assert start_of(os.getpid(), nowhere) is None and processes.command_line(os.getpid(), nowhere) == ()
    assert not is_alive(os.getpid(), None, nowhere) and not is_alive(os.getpid(), 1, nowhere)
