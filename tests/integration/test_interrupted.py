"""A run that is stopped in the middle of an agent's work: in order by a signal, and at once by SIGKILL."""

import json
import os
import pty
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from projects import OCTOFORM, Done, Project
from waiting import until

from octoform.base.processes import is_alive
from octoform.endpoint.process import record
from octoform.harness.containment import orphans
from octoform.state.files import reserve_path
from octoform.state.layout import Layout

PROGRAM = """
import json, os, subprocess, sys
from pathlib import Path
reply = {"role": "assistant", "content": [], "usage": {"input": 1000, "cacheRead": 0, "output": 50}}
(Path(os.environ["HOME"]) / "login").write_text("cached")
(Path(os.environ["TMPDIR"]) / "large").write_text("x" * 1000)
with Path(os.environ["OCTOFORM_TASK"]).parents[4].joinpath("octopus.yaml").open("a") as manifest:
    manifest.write("# the agent was here\\n")
tool = subprocess.Popen(["sleep", "300"])
for event in (
    {"type": "message_end", "message": reply},
    {"type": "message_end", "message": reply},
    {"type": "tool_execution_start", "toolName": "bash", "args": {"command": "sleep 300"}},
):
    print(json.dumps(event), flush=True)
Path(sys.argv[1], "tool.part").write_text(str(tool.pid))
Path(sys.argv[1], "tool.part").rename(Path(sys.argv[1], "tool.pid"))
tool.wait()
"""
"""Prints as pi does: two replies and the call of a tool, which then runs for ever."""


@pytest.fixture
def working(project: Project) -> Project:
    """A project whose agent is a program with a model that has a price."""
    program = project.outside / "program.py"
    program.write_text(PROGRAM)
    command = json.dumps([sys.executable, str(program), str(project.outside)])
    project.harness = f"{{name: pi, command: {command}, key: LOOP_KEY, base_url: 'http://127.0.0.1:9', sandbox: false}}"
    project.manifest = {
        "model": "openai/scripted",
        "prices": "{openai/scripted: {input: 100, output: 1000}}",
        "stages": f"{{probe: {{harness: {project.harness}}}}}",
    }
    project.environ["LOOP_KEY"] = "sk-of-the-loop-0123456789"
    project.write()
    return project


Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def applying(working: Project) -> Iterator[Start]:
    """``applying()`` starts an apply of that project; what still runs when the test is over is killed."""
    started: list[subprocess.Popen[str]] = []

    def start(**options: Any) -> "subprocess.Popen[str]":
        started.append(working.start("apply", "-auto-approve", "-target", "probe", **options))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()


def at_work(project: Project) -> orphans.Process:
    """The process of the agent's tool, once octoform has read the call."""
    pid, transcript = project.outside / "tool.pid", project.local / "attempts" / "000001-probe-1" / "transcript.jsonl"
    until(lambda: transcript.exists() and "tool_called" in transcript.read_text() and pid.exists(), "no agent at work")
    found = orphans.look(int(pid.read_text()))
    assert found is not None
    return found


def listed(project: Project) -> dict[str, Any]:
    attempts: list[dict[str, Any]] = json.loads(project.run("attempts", "-json", status=0).out)["attempts"]
    return attempts[0]


def left_in_order(project: Project, tool: orphans.Process) -> None:
    """The tree is gone, nothing is held, and the record has what was used."""
    assert not is_alive(tool.pid, tool.start)
    layout = Layout(project.folder, "bench")
    assert not layout.journal.exists()
    assert not reserve_path(layout).exists()
    assert not (project.local / "lock.json").exists()
    folder = project.attempts("probe")[0]
    assert not (folder / "home").exists()
    assert not (folder / "tmp").exists()
    record = json.loads((folder / "attempt.json").read_text())
    assert (record["reason"], record["accepted"], record["turns"]) == ("interrupted", False, 2)
    assert (record["usage"]["input_tokens"], record["usage"]["output_tokens"]) == (2000, 100)
    assert record["usage"]["cost_usd"] == pytest.approx(0.3)
    assert record["seconds"] > 0
    assert project.nodes()["probe"]["status"] == "interrupted"
    text = project.run("attempts", status=0).out
    assert all(part in text for part in ("interrupted", "pi, openai/scripted", "2.0k/100", "$0.30"))


def hearing() -> None:
    """A background job of a shell is deaf to SIGINT; this one is not."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_stops_in_order(working: Project, applying: Start, number: signal.Signals) -> None:
    process = applying(preexec_fn=hearing)
    tool = at_work(working)
    process.send_signal(number)
    _, found = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert "Traceback" not in found
    word = "interrupted" if number == signal.SIGINT else f"stopped by {number.name}"
    assert [word in line for line in found.strip().splitlines()] == [True], found
    left_in_order(working, tool)
    assert "the agent was here" not in (working.folder / "octopus.yaml").read_text()
    working.harness, working.manifest = None, {}
    working.apply("-target", "probe", status=0)


def test_a_closed_terminal_stops_in_order(working: Project) -> None:
    master, slave = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", TERMINAL, str(OCTOFORM), "apply", "-auto-approve", "-target", "probe"],
        cwd=working.folder,
        env={**working.environment(), "TERM": "xterm"},
        stdin=slave,
        stdout=slave,
        stderr=slave,
        start_new_session=True,
    )
    os.close(slave)
    try:
        while not (working.outside / "tool.pid").exists():
            assert select.select([master], [], [], 60)[0], "octoform shows nothing"
            os.read(master, 65536)
        tool = at_work(working)
    finally:
        os.close(master)
    try:
        assert process.wait(timeout=60) == 129
    finally:
        process.kill()
        process.wait()
    left_in_order(working, tool)


TERMINAL = "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); os.execv(sys.argv[1], sys.argv[1:])"


def test_a_stop_whose_readers_have_gone_too_is_still_in_order(working: Project, applying: Start) -> None:
    process = applying()
    tool = at_work(working)
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    process.stderr.close()
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=60) == 128 + signal.SIGTERM
    left_in_order(working, tool)


def deaf() -> None:
    """As nohup starts a program."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)


def test_nohup_is_obeyed(working: Project, applying: Start) -> None:
    process = applying(preexec_fn=deaf)
    at_work(working)
    process.send_signal(signal.SIGHUP)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM


def test_what_sigkill_leaves_is_told_and_then_removed(working: Project, applying: Start) -> None:
    process = applying()
    tool = at_work(working)
    runs = listed(working)
    assert (runs["state"], runs["harness"], runs["model"], runs["turns"]) == ("running", "pi", "openai/scripted", 2)
    assert (runs["usage"]["input_tokens"], runs["usage"]["output_tokens"]) == (2000, 100)
    assert "bash  sleep 300" in working.run("attempts", "show", "1", status=0).out
    process.kill()
    process.communicate(timeout=60)
    until(lambda: not is_alive(tool.pid, tool.start), "the agent's tool lives on")
    folder: Path = working.attempts("probe")[0]
    assert (folder / "home" / "login").exists()
    assert (folder / "tmp" / "large").exists()
    assert not (folder / "attempt.json").exists()
    killed = listed(working)
    assert {**killed, "state": "", "reason": "", "seconds": 0} == {**runs, "state": "", "reason": "", "seconds": 0}
    assert killed["state"] == "interrupted"
    working.harness, working.manifest = None, {}
    working.apply("-target", "probe", status=0)
    assert not (folder / "home").exists()
    assert not (folder / "tmp").exists()
    assert (folder / "transcript.jsonl").exists()


def test_a_stop_beside_an_apply_holds(project: Project) -> None:
    """The endpoint is not made to run behind the back of the person who stopped it, and no agent runs once more."""
    gate = project.outside / "gate"
    project.script["deploy"] = [{"shell": f"until [ -e '{gate}' ]; do sleep 0.02; done"}]
    project.write()
    applying = project.start("apply", "-auto-approve", "-json")
    try:
        project.wait_for_agent(5)
        project.run("stop", status=0)
        gate.touch()
        out, err = applying.communicate(timeout=project.seconds)
    finally:
        applying.kill()
        applying.communicate()
    ended = Done(applying.returncode, out, err)
    assert ended.status == 1
    ends = [each["diagnostic"] for each in ended.events() if each["type"] == "diagnostic"]
    assert [each["severity"] for each in ends if each["code"] == "ENDPOINT-STOPPED"] == ["error"], ended.text
    layout = Layout(project.folder, project.host)
    assert record.is_marked(layout) and record.running(layout) is None
    assert project.stages_run().count("deploy") == 1
    project.apply(status=0)
    assert not record.is_marked(layout) and record.running(layout) is not None
    project.run("stop", status=0)
    project.script.pop("deploy")
    assert "ENDPOINT-STOPPED" in project.apply("-target", "probe", "-replace", "probe", status=0).codes()
    assert record.is_marked(layout) and record.running(layout) is None
