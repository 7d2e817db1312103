"""The bounded command: it prints, ends and is let go of as the command itself does, and no later than it may."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from octoform.harness.containment import bounded_command

SCRIPT = str(Path(bounded_command.__file__))


def bounded(command: str, seconds: float = 0) -> "subprocess.CompletedProcess[str]":
    argv = [sys.executable, "-I", "-S", SCRIPT, f"{seconds:g}", "/bin/sh", "-c", command]
    return subprocess.run(argv, capture_output=True, text=True, timeout=30, check=False)


@pytest.mark.parametrize(("command", "status"), [("exit 0", 0), ("exit 7", 7), ("kill -9 $$", -9), ("kill $$", -15)])
def test_it_ends_as_the_command_does(command: str, status: int) -> None:
    assert bounded(command).returncode == status


def test_its_streams_stay_apart_and_whole() -> None:
    done = bounded("head -c 300000 /dev/zero | tr '\\0' x; echo wrong >&2")
    assert (len(done.stdout), done.stderr) == (300_000, "wrong\n")


def test_what_is_left_running_and_holds_the_output_is_not_waited_for() -> None:
    done = bounded("sleep 25 & echo $!")
    left = int(done.stdout)
    handle = os.pidfd_open(left)  # it runs on
    signal.pidfd_send_signal(handle, signal.SIGKILL)
    os.close(handle)


@pytest.mark.parametrize("command", ["sleep 25", "trap '' TERM; sleep 25; sleep 25", "exec >&- 2>&-; sleep 25"])
def test_a_command_without_an_end_is_ended_with_its_group(command: str) -> None:
    began = time.monotonic()
    done = bounded(command, seconds=0.3)
    assert done.returncode in (-15, -9)
    assert "ended after 0.3 seconds" in done.stderr
    assert time.monotonic() - began < 15


def test_a_program_that_ends_it_ends_the_command() -> None:
    argv = [sys.executable, "-I", "-S", SCRIPT, "0", "/bin/sh", "-c", "echo $$; exec sleep 25"]
    with subprocess.Popen(argv, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        command = os.pidfd_open(int(process.stdout.readline()))
        process.terminate()
        assert process.wait(15) == -15
    with pytest.raises(ProcessLookupError):
        signal.pidfd_send_signal(command, 0)
    os.close(command)
