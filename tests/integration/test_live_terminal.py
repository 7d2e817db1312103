"""The live endpoint in front of a person: calls, an approval, progress, Ctrl-C, its health; and what a pipe gets."""

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import warm
from launched import Launched, launched, tool
from projects import OCTOFORM
from terminals import Terminal
from waiting import until

SOURCE = '''
"""A bench with a meter and a rail."""

from pathlib import Path

import anyio
from fastmcp import Context, FastMCP

import runtime

mcp = FastMCP("bench")


@mcp.tool
@runtime.logged
def read_voltage(channel: int = 1) -> float:
    """A voltage, in volts."""
    return channel * 1.5


@mcp.tool
@runtime.logged
def move_rail(steps: int) -> str:
    """Moves the rail."""
    return f"moved by {steps}"


@mcp.tool
async def scan(steps: int, mark: str, ctx: Context) -> int:
    """Goes along the rail."""
    try:
        for step in range(steps):
            await ctx.report_progress(step + 1, steps, f"at \\x1b[31m{step + 1}")
            await anyio.sleep(0.05)
    except BaseException:
        Path(mark).write_text("stopped")
        raise
    return steps
'''
TOOLS = [tool("read_voltage"), tool("scan"), tool("move_rail", "irreversible", "usb-2")]
POLICY = {"tools": {"move_rail": {"decision": "confirm"}}}
ENVIRON = {name: os.environ[name] for name in ("PATH", "HOME", "LANG") if name in os.environ}


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    """A project folder whose endpoint runs."""
    folder = tmp_path_factory.mktemp("live")
    (folder / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    with launched(folder, SOURCE, TOOLS, policy=POLICY) as endpoint:
        output = endpoint.layout.output("interface")
        output.parent.mkdir(parents=True)
        output.write_text(json.dumps({"tools": TOOLS}))
        yield endpoint


def octoform(endpoint: Launched, *arguments: str) -> "subprocess.CompletedProcess[str]":
    return warm.completed(OCTOFORM, arguments, endpoint.layout.project, ENVIRON)


def on_terminal(endpoint: Launched, *arguments: str) -> Terminal:
    return Terminal(endpoint.layout.project, ENVIRON, *arguments)


def logged(endpoint: Launched) -> str:
    log = endpoint.layout.call_log
    return log.read_text() if log.exists() else ""


def test_tools_tell_name_effect_and_parameters(bench: Launched) -> None:
    done = octoform(bench, "tools")
    assert done.returncode == 0, done.stderr
    assert "move_rail  irreversible" in done.stdout
    assert "channel: integer, default 1" in done.stdout
    listed = json.loads(octoform(bench, "tools", "-json").stdout)["tools"]
    assert [(item["name"], item["effect"], item["devices"]) for item in listed] == [
        ("move_rail", "irreversible", ["usb-2"]),
        ("read_voltage", "read", ["usb-1"]),
        ("scan", "read", ["usb-1"]),
    ]


def test_one_tool_is_shown_by_its_name(bench: Launched) -> None:
    done = octoform(bench, "tools", "read_voltage")
    assert done.returncode == 0 and "channel: integer, default 1" in done.stdout and "move_rail" not in done.stdout
    done = octoform(bench, "tools", "read_voltages", "scan")
    assert (done.returncode, done.stdout) == (1, "")
    assert "error[ENDPOINT-UNKNOWN-TOOL]: the endpoint has no tool 'read_voltages'" in done.stderr
    assert "did you mean 'read_voltage'?" in done.stderr


def test_a_call_prints_the_answer_alone(bench: Launched) -> None:
    done = octoform(bench, "call", "read_voltage", "-arg", "channel=3")
    assert (done.returncode, json.loads(done.stdout), done.stderr) == (0, {"result": 4.5}, "")
    done = octoform(bench, "call", "read_voltage", "-json", '{"channel": 4}')
    assert json.loads(done.stdout)["structured"] == {"result": 6.0}


def test_an_approval_is_asked_for_at_the_terminal_and_the_answer_goes_to_the_pipe(
    bench: Launched, tmp_path: Path
) -> None:
    with (tmp_path / "out").open("wb") as out:
        terminal = Terminal(bench.layout.project, ENVIRON, "call", "move_rail", "-arg", "steps=7", stdout=out)
        terminal.wait_for("Approve this one call? [y/N]")
        terminal.type("y\n")
        status, screen = terminal.end()
    assert status == 0, screen
    assert json.loads((tmp_path / "out").read_text()) == {"result": "moved by 7"}
    assert "move_rail wants an approval:" in screen
    assert "  steps = 7" in screen


@pytest.mark.parametrize("answer", ["n\n", "\n", "yess\n", "\x04"])
def test_every_other_answer_is_no(bench: Launched, answer: str) -> None:
    before = logged(bench)
    terminal = on_terminal(bench, "call", "move_rail", "-arg", "steps=7")
    terminal.wait_for("[y/N]")
    terminal.type(answer)
    status, screen = terminal.end()
    assert status == 1
    assert "ENDPOINT-CALL-NOT-APPROVED" in "\n".join(screen)
    assert logged(bench) == before


def test_without_a_terminal_a_call_is_denied_unless_it_was_approved_beforehand(bench: Launched) -> None:
    before = logged(bench)
    done = octoform(bench, "call", "move_rail", "-arg", "steps=7")
    assert done.returncode == 1
    assert "ENDPOINT-CALL-NOT-APPROVED" in done.stderr and "-auto-approve" in done.stderr
    assert logged(bench) == before
    done = octoform(bench, "call", "move_rail", "-arg", "steps=7", "-auto-approve")
    assert (done.returncode, json.loads(done.stdout)) == (0, {"result": "moved by 7"})


def test_a_dry_run_moves_nothing(bench: Launched) -> None:
    before = logged(bench)
    done = octoform(bench, "call", "move_rail", "-arg", "steps=7", "-dry-run")
    assert done.returncode == 0, done.stderr
    assert "dry run: nothing was done" in done.stdout
    assert logged(bench) == before


def test_progress_is_one_line_that_is_gone_at_the_end(bench: Launched, tmp_path: Path) -> None:
    terminal = on_terminal(bench, "call", "scan", "-arg", "steps=40", "-arg", f"mark={tmp_path / 'm'}")
    status, screen = terminal.end()
    assert status == 0
    shown = {line for screen in terminal.screens for line in screen if " of 40" in line}
    assert len(shown) > 1, "it moved"
    assert all("at \\x1b[31m" in line for line in shown), "and what the tool says acts on no terminal"
    assert not any(" of 40" in line for line in screen)
    assert max(sum(" of 40" in line for line in screen) for screen in terminal.screens) == 1


def test_ctrl_c_stops_the_tool_and_leaves_with_130(bench: Launched, tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    terminal = on_terminal(bench, "call", "scan", "-arg", "steps=100000", "-arg", f"mark={mark}")
    terminal.wait_for(" of 100000")
    terminal.type("\x03")
    status, screen = terminal.end()
    assert status == 130
    assert "octoform: interrupted; the call of scan was given up" in screen
    until(mark.exists)
    assert octoform(bench, "call", "read_voltage").returncode == 0


def test_a_call_starts_what_does_not_run(bench: Launched) -> None:
    bench.stop()
    done = octoform(bench, "call", "read_voltage")
    assert (done.returncode, json.loads(done.stdout)) == (0, {"result": 1.5})
    assert bench.process.pid


def test_status_starts_nothing_and_tells_what_runs(bench: Launched) -> None:
    done = octoform(bench, "status")
    assert f"process {bench.process.pid} since {bench.process.since}, scope local, " in done.stdout
    found = json.loads(octoform(bench, "status", "-json").stdout)
    assert found["running"] and found["process"]["pid"] == bench.process.pid
    assert found["tools"] == ["move_rail", "read_voltage", "scan"]
    assert "the endpoint's tools are not those of INTERFACE" not in found["reasons"]
    bench.stop()
    done = octoform(bench, "status")
    assert done.returncode == 5
    assert done.stdout.splitlines()[0].endswith(", down")
    assert "  the endpoint is not running" in done.stdout.splitlines()
    assert not bench.layout.socket.exists()
    assert json.loads(octoform(bench, "status", "-json").stdout)["process"] is None
    bench.start()


def test_status_tells_of_a_latched_emergency_stop_also_when_nothing_runs(bench: Launched) -> None:
    latch = bench.layout.run / "estop.json"
    latch.write_text(
        json.dumps({"format": 1, "by": "anna", "reason": "smoke \x1b[1m", "since": "2026-01-01T00:00:00Z"})
    )
    try:
        words = "emergency stop engaged by anna at 2026-01-01T00:00:00Z: smoke \\x1b[1m"
        assert words in octoform(bench, "status").stdout
        bench.stop()
        assert words in octoform(bench, "status").stdout
        latch.write_text("{")
        assert "its file cannot be read" in octoform(bench, "status").stdout
    finally:
        latch.unlink()
        bench.start()


def test_sigterm_gives_a_call_up(bench: Launched, tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    command = [str(OCTOFORM), "call", "scan", "-arg", "steps=100000", "-arg", f"mark={mark}"]
    process = subprocess.Popen(
        command, cwd=bench.layout.project, env=ENVIRON, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    until(lambda: bench.ask("status")["gate"]["running"])
    process.send_signal(signal.SIGTERM)
    _, found = process.communicate(timeout=30)
    assert process.returncode == 143
    assert "the call of scan was given up" in found
    until(mark.exists)


def test_logs_show_calls_with_their_results_and_what_was_printed(bench: Launched) -> None:
    octoform(bench, "call", "read_voltage", "-arg", "channel=8")
    with bench.layout.server_log.open("a") as log:
        log.write("printed \x1b[31mred\x1b[0m Authorization: Bearer abcdefgh12345678\n")
    done = octoform(bench, "logs")
    assert done.returncode == 0, done.stderr
    assert "read_voltage channel=8  ok  " in done.stdout
    assert "\x1b" not in done.stdout and "printed \\x1b[31mred" in done.stdout
    assert "abcdefgh12345678" not in done.stdout
    assert len(octoform(bench, "logs", "-n", "1").stdout.splitlines()) == 1
    assert octoform(bench, "logs", "-n", "0").stdout == ""
    objects = [json.loads(line) for line in octoform(bench, "logs", "-json", "-n", "1000").stdout.splitlines()]
    assert {"calls", "server"} == {item["log"] for item in objects}
    assert [item["event"] for item in objects if item.get("arguments") == {"channel": 8}] == ["call"]
    refused = octoform(bench, "logs", "-n", "many")
    assert (refused.returncode, refused.stdout) == (1, "")


@pytest.mark.parametrize("form", [[], ["-json"]])
def test_followed_logs_go_on_over_a_new_file_and_end_with_ctrl_c(bench: Launched, form: list[str]) -> None:
    octoform(bench, "call", "read_voltage", "-arg", "channel=4")
    terminal = on_terminal(bench, "logs", "-f", "-n", "1", *form)
    terminal.wait_for("ms")
    log = bench.layout.call_log
    octoform(bench, "call", "read_voltage", "-arg", "channel=5")
    terminal.wait_for("channel=5  ok" if not form else '"channel": 5')
    log.rename(log.with_name("octoform.jsonl.1"))
    octoform(bench, "call", "read_voltage", "-arg", "channel=6")
    terminal.wait_for("channel=6  ok" if not form else '"channel": 6')
    terminal.type("\x03")
    status, screen = terminal.end()
    assert status == 130
    assert not any("Traceback" in line or "interrupted" in line for line in screen)


def test_followed_logs_end_when_their_reader_goes(bench: Launched) -> None:
    octoform(bench, "call", "read_voltage")
    command = f"'{OCTOFORM}' logs -f -n 1 | head -n 1"
    done = subprocess.run(
        ["sh", "-c", command], cwd=bench.layout.project, env=ENVIRON, capture_output=True, text=True, timeout=20
    )
    assert (done.stdout.count("\n"), done.stderr) == (1, "")
