"""What the kernel tells of a process: a name that looks like the line itself, a zombie, one that stands still, none."""

import os
import signal
import subprocess
import sys
from pathlib import Path

from waiting import until

from octoform.base.processes import process_stat

SLEEPS = [sys.executable, "-c", "import time; time.sleep(60)"]


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
