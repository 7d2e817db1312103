"""What a person at a terminal sees and does: a line that moves, a question, Ctrl-C; and what a pipe gets instead."""

import os
import signal
import subprocess
from pathlib import Path

import pytest
from projects import OCTOFORM, Project
from terminals import Terminal


def on_terminal(project: Project, *arguments: str, **environ: str) -> Terminal:
    return Terminal(project.folder, {**project.environment(), **environ}, *arguments)


def test_a_run_on_a_terminal_shows_a_moving_line_and_leaves_a_clean_screen(project: Project) -> None:
    project.script = {"probe": [{"say": "looking at 41 devices", "copy": str(GOOD), "sleep": 1}]}
    project.write()
    terminal = Terminal(project.folder, project.environment(), "apply", "-target", "identify", program=True)
    terminal.wait_for("Enter a value:")
    terminal.type("yes\n")
    status, last = terminal.end()
    assert status == 0
    moving = [line for screen in terminal.screens for line in screen if "looking at 41 devices" in line]
    assert moving
    assert any("probe" in line and " s " in line for line in moving)
    text = "\n".join(last)
    assert "looking at 41 devices" not in text
    assert "✓ probe" in text
    assert "✓ identify" in text
    assert "Apply complete!" in text
    assert terminal.raw.endswith(b"\x1b[?25h") or b"\x1b[?25h" in terminal.raw  # the cursor is shown again
    assert b"\x1b[32m" in terminal.raw


GOOD = Path(__file__).parents[1] / "agent" / "good" / "probe.json"


@pytest.mark.parametrize("answer", ["no\n", "y\n", "\x04"])
def test_only_yes_is_yes(project: Project, answer: str) -> None:
    terminal = on_terminal(project, "apply", "-target", "probe", NO_COLOR="1")
    terminal.wait_for("Enter a value:")
    terminal.type(answer)
    status, last = terminal.end()
    assert status == 1
    assert "APPLY-NOT-APPROVED" in "\n".join(last)
    assert project.agent_runs() == []
    assert b"\x1b[3" not in terminal.raw


def test_ctrl_c_ends_the_agent_with_130_and_the_next_apply_goes_on(project: Project) -> None:
    project.script = {"identify": [{"grandchild": 300, "sleep": 300}]}
    project.write()
    terminal = on_terminal(project, "apply", "-auto-approve", "-target", "identify")
    agent = project.wait_for_agent(2)
    terminal.wait_for("identify")
    terminal.type("\x03")
    status, last = terminal.end()
    assert status == 130
    assert "interrupted" in "\n".join(last)
    grandchild = project.attempts("identify")[0] / "grandchild.pid"
    for pid in (agent, *([int(grandchild.read_text())] if grandchild.exists() else [])):
        assert not running(pid)
    assert not (project.local / "lock.json").exists()
    project.script = {}
    project.apply("-target", "identify", status=0)
    assert project.stages_run() == ["probe", "identify", "identify"]


def running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_sigterm_ends_the_agent_and_leaves_no_lock(project: Project) -> None:
    project.script = {"probe": [{"sleep": 300}]}
    project.write()
    process = project.start("apply", "-auto-approve", "-target", "probe")
    agent = project.wait_for_agent()
    assert (project.local / "lock.json").exists()
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=30)
    assert process.returncode == 128 + signal.SIGTERM
    assert not running(agent)
    assert not (project.local / "lock.json").exists()
    project.script = {}
    project.apply("-target", "probe", status=0)


def test_a_pipe_gets_plain_lines_and_a_closed_input_is_no_yes(project: Project) -> None:
    process = subprocess.run(
        [str(OCTOFORM), "apply", "-target", "probe"],
        cwd=project.folder,
        env={**project.environment(), "TERM": "xterm-256color", "FORCE_COLOR": "1"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        preexec_fn=lambda: os.close(0),
        check=False,
    )
    assert process.returncode == 1
    assert b"APPLY-NOT-APPROVED" in process.stderr
    assert b"Traceback" not in process.stderr
    assert b"\x1b" not in process.stdout + process.stderr
    done = project.run("apply", "-auto-approve", "-target", "probe", status=0)
    assert "\x1b" not in done.text
    assert "✓ probe" in done.out


def test_a_reader_that_goes_away_is_no_traceback(project: Project) -> None:
    command = f"'{OCTOFORM}' schema | head -c 10"
    done = subprocess.run(
        ["sh", "-c", command], cwd=project.folder, env=project.environment(), capture_output=True, check=False
    )
    assert done.stderr == b""


def test_an_ascii_locale_shows_what_it_can(project: Project) -> None:
    project.environ = {"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    done = project.run("apply", "-auto-approve", "-target", "probe", status=0)
    assert "probe" in done.out
