"""System tools are asked within bounds: missing, hanging, failing and chattering ones, and recorded output instead."""

import os
import select
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from octoform.builtin.probe.commands import Command, output
from octoform.builtin.probe.reader import Reader, Scan, run_one

Tool = Callable[[str], Command]


@pytest.fixture
def tool(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Tool:
    """``tool("echo hello")`` puts a program of that text in the path and returns the command that runs it."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("A_SECRET", "nobody's business")

    def make(script: str) -> Command:
        program = tmp_path / "tool"
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
        return Command("tool", ("tool", "first", "$HOME; ls"))

    return make


def asked(command: Command, seconds: float = 20, most: int = 1000) -> tuple[str, str, str]:
    """(status, detail, output) of a live scan that asks the tool."""
    found: list[str] = []
    report = run_one(
        Scan("command:tool", lambda reader: found.append(output(command, reader, most))), Reader("/"), seconds
    )
    return report.status, report.detail, "".join(found)


def test_a_tool_gets_its_arguments_as_they_are_no_input_and_no_secret(tool: Tool) -> None:
    command = tool('echo "$#" "$2"; read line || echo no input; env | cut -d= -f1 | sort | tr "\\n" " "')
    status, _, found = asked(command)
    assert (status, found.splitlines()[:2]) == ("ok", ["2 $HOME; ls", "no input"])
    assert set(found.splitlines()[2].split()) <= {"LC_ALL", "PATH", "PWD", "OLDPWD", "SHLVL", "_"}


def test_a_missing_tool_is_not_found() -> None:
    assert asked(Command("none", ("octoform-has-no-such-tool",))) == ("not_found", "", "")


def test_a_tool_in_the_current_folder_is_not_found(tool: Tool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    command = tool("echo never")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f".{os.pathsep}{os.pathsep}relative")
    assert asked(command)[0] == "not_found"


@pytest.mark.parametrize("script", ["exec sleep 60", "exec >&-; sleep 60", "sleep 60 & echo started; wait"])
def test_a_tool_that_hangs_is_killed_with_all_its_children(tool: Tool, tmp_path: Path, script: str) -> None:
    os.mkfifo(tmp_path / "alive")
    alive = os.open(tmp_path / "alive", os.O_RDONLY | os.O_NONBLOCK)
    started = time.monotonic()
    try:
        # Each process of the tool holds the pipe's other end open, so that its end shows the end of all.
        assert asked(tool(f"exec 3>{tmp_path}/alive; echo here >&3; {script}"), 0.5)[:2] == (
            "timeout",
            "no answer in time",
        )
        assert time.monotonic() - started < 10
        assert os.read(alive, 10) == b"here\n"
        watch = select.poll()
        watch.register(alive, 0)
        assert watch.poll(10_000) == [(alive, select.POLLHUP)]
    finally:
        os.close(alive)


def test_a_tool_that_fails_or_prints_without_end_is_an_error(tool: Tool) -> None:
    assert asked(tool("echo half; exit 3")) == ("error", "ended with status 3", "")
    assert asked(tool("exec yes")) == ("error", "printed more than 1000 bytes", "")
    assert asked(tool("printf %01000d 1")) == ("ok", "", f"{1:01000d}")


def test_a_tool_that_may_not_be_run_is_not_found(tool: Tool, tmp_path: Path) -> None:
    command = tool("echo never")
    (tmp_path / "tool").chmod(0o644)
    assert asked(command)[0] == "not_found"


def test_on_a_recorded_host_nothing_is_started(tool: Tool, tmp_path: Path) -> None:
    command = tool(f"touch {tmp_path}/ran")
    root = tmp_path / "root"
    (root / "recorded/commands").mkdir(parents=True)
    with pytest.raises(FileNotFoundError):
        output(command, Reader(str(root)))
    (root / "recorded/commands/tool").write_bytes(b"\xef\xbb\xbfrecorded \xff\n")
    assert output(command, Reader(str(root))) == "recorded \ufffd\n"
    with pytest.raises(OSError, match="more than 5 bytes"):
        output(command, Reader(str(root)), most=5)
    assert not (tmp_path / "ran").exists()
