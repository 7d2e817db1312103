"""The tool ``shell`` of the small agent, with real commands: bounds, groups, and what it does not hand over."""

import os
import signal
import time
from pathlib import Path

import pytest
from unit.harness.harness_agents import alive
from waiting import until

from octoform.harness.containment import orphans
from octoform.harness.react.agent_tools import OUTPUT_BYTES, Shell, ToolResult


@pytest.fixture
def shell(tmp_path: Path) -> Shell:
    return Shell(tmp_path, {"PATH": "/usr/bin:/bin", "SEEN": "yes"}, seconds=20, most_seconds=30)


def test_both_streams_in_their_order_and_the_folder(shell: Shell, tmp_path: Path) -> None:
    found = shell.run("echo out; echo err >&2; pwd; printf %s end")
    assert found == ToolResult(f"out\nerr\n{tmp_path}\nend")


def test_a_command_that_says_nothing_and_one_that_fails(shell: Shell) -> None:
    assert shell.run("true") == ToolResult("[no output, exit status 0]")
    assert shell.run("echo so; exit 7") == ToolResult("so\n[exit status 7]", failed=True)
    assert shell.run("no-such-program-here").failed
    assert shell.run("kill -9 $$") == ToolResult("[ended by signal 9]", failed=True)
    assert "could not be started" in shell.run("echo \0").text


def test_it_has_exactly_its_environment_and_no_input(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOOP_KEY", "not-for-commands")
    lines = shell.run("env; cat").text.splitlines()
    assert "SEEN=yes" in lines
    assert not [line for line in lines if "LOOP_KEY" in line]


def test_a_flood_is_bounded_with_its_beginning_and_its_end(shell: Shell) -> None:
    found = shell.run("echo first; yes 0123456789 | head -c 30000000; echo; echo last")
    assert len(found.text) < OUTPUT_BYTES + 200
    assert found.text.startswith("first\n")
    assert found.text.endswith("\nlast")
    assert "bytes omitted ...]" in found.text


def test_bytes_that_are_no_text_and_signs_that_hide(shell: Shell) -> None:
    assert shell.run(r"printf '\xff\x1b[31m\xe2\x80\xaex\0y'").text == "\ufffd\\x1b[31m\\u202ex\\x00y"


def test_a_command_over_its_time_ends_with_its_group(shell: Shell, tmp_path: Path) -> None:
    began = time.monotonic()
    result = shell.run("echo before; sleep 300 & echo $! > child; trap '' TERM; while :; do sleep 0.05; done", 1)
    assert result == ToolResult("before\n[ended after 1 seconds, its limit]", failed=True)
    assert time.monotonic() - began < 15
    child = int((tmp_path / "child").read_text())
    until(lambda: (found := orphans.look(child)) is None or found.state in "ZX")


def test_no_command_gets_more_than_the_most(tmp_path: Path) -> None:
    shell = Shell(tmp_path, {"PATH": "/usr/bin:/bin"}, seconds=1, most_seconds=1)
    assert "its limit" in shell.run("sleep 300", 3600).text
    assert "its limit" in shell.run("exec >&-; exec 2>&-; sleep 300").text


def test_what_runs_on_is_not_waited_for(shell: Shell, tmp_path: Path) -> None:
    began = time.monotonic()
    result = shell.run("sleep 300 & echo $! > child; echo done")
    assert result == ToolResult("done")
    assert time.monotonic() - began < 10
    pid = int((tmp_path / "child").read_text())
    found = orphans.look(pid)
    assert found is not None and alive(found), "it may go on until the run ends"
    os.kill(pid, signal.SIGKILL)
