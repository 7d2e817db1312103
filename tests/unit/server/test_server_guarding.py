"""Emergency stop, audit log and limits at the terminal, against an endpoint that runs, hangs, or is not there."""

import asyncio
import json
import os
import re
import shutil
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import warm
from launched import Launched, launched, tool
from projects import OCTOFORM, Done
from unit.server.server_lines import STOP, Line, plant

from octoform.server.process.control import Control

SOURCE = '''
from fastmcp import FastMCP
mcp = FastMCP("bench")

@mcp.tool
def read_steps() -> dict[str, int]:
    """How far it is."""
    return {"steps": 1}

@mcp.tool
def move_rail(steps: int) -> dict[str, int]:
    """Move the rail."""
    return {"steps": steps}
'''
DEVICE = "usb-1a86-7523"
LIMITS = [
    {"kind": "range", "parameter": "steps", "minimum": -100, "maximum": 100, "unit": "raw", "source": "profile rail"},
    {"kind": "cumulative", "parameter": "steps", "most": 150, "source": "policy.limits[0]"},
    {"kind": "rate", "calls": 100, "seconds": 60.0, "source": "policy.limits[1]"},
]
POLICY = {
    "tools": {"move_rail": {"limits": LIMITS, "source": "default for actuate tools"}},
    "stop": [{"device": DEVICE, "class": "tty", "baud": 115200, "write": STOP, "source": "profile rail"}],
}
MANIFEST = "version: 1\nhost: bench\nharness: builtin\n"


@pytest.fixture
def line() -> Iterator[Line]:
    made = Line()
    yield made
    made.close()


@pytest.fixture
def bench(tmp_path: Path, line: Line) -> Iterator[Launched]:
    (tmp_path / "octopus.yaml").write_text(MANIFEST)
    system, instances = plant(tmp_path, {DEVICE: line})
    (tmp_path / ".octoform/bench").mkdir(parents=True)
    shutil.copy(instances, tmp_path / ".octoform/bench/instances.json")
    tools = [tool("read_steps"), tool("move_rail", "actuate", DEVICE)]
    with launched(tmp_path, SOURCE, tools, policy=POLICY, environ={"OCTOFORM_SYSROOT": str(system)}) as endpoint:
        yield endpoint


def octoform(endpoint: Launched, *arguments: str) -> Done:
    project = endpoint.layout.project
    environ = {**os.environ, "OCTOFORM_SYSROOT": str(project / "system")}
    return Done(*warm.run(OCTOFORM, (f"-chdir={project}", *arguments), project, environ, 60))


def answer(endpoint: Launched, *arguments: str) -> tuple[int, dict[str, Any]]:
    done = octoform(endpoint, *arguments, "-json")
    return done.status, json.loads(done.out)


def call(endpoint: Launched, name: str, **arguments: Any) -> str:
    """The text of a call's error; empty when it went well."""

    async def asked() -> str:
        async with endpoint.client() as client:
            result = await client.call_tool(name, arguments, raise_on_error=False)
            return result.content[0].text if result.is_error else ""

    return asyncio.run(asked())


def test_estop_of_a_running_endpoint(bench: Launched, line: Line) -> None:
    assert call(bench, "move_rail", steps=1) == ""
    done = octoform(bench, "estop", "-reason", "smoke")
    assert (done.status, done.err) == (0, "")
    assert "bench: stopped. Nothing that moves is called until it is cleared." in done.out
    assert "at the terminal at 20" in done.out and ": smoke" in done.out
    assert f"done  {DEVICE}: wrote 8 bytes to " in done.out
    assert "octoform did it itself" not in done.out
    assert line.received(8) == bytes.fromhex(STOP)
    assert "estop" in call(bench, "move_rail", steps=1)
    assert call(bench, "read_steps") == ""
    status, cleared = answer(bench, "estop", "-clear")
    assert (status, cleared["ok"], cleared["endpoints"][0]["reason"]) == (0, True, "smoke")
    assert call(bench, "move_rail", steps=1) == ""
    assert "was NOT engaged" in octoform(bench, "estop", "-clear").out
    events = [record["event"] for record in answer(bench, "audit")[1]["records"]]
    assert [event for event in events if event.startswith("estop")] == ["estop", "estop_actions", "estop_cleared"]


def test_estop_without_a_process_and_without_a_manifest(bench: Launched, line: Line) -> None:
    bench.stop()
    (bench.layout.project / "octopus.yaml").write_text("broken: [")
    status, stopped = answer(bench, "estop")
    assert (status, stopped["ok"], stopped["endpoints"][0]["direct"]) == (0, True, True)
    assert line.received(8) == bytes.fromhex(STOP)
    bench.start()
    assert "estop" in call(bench, "move_rail", steps=1)
    assert octoform(bench, "estop", "-clear").status == 0
    assert call(bench, "move_rail", steps=1) == ""


def test_estop_of_a_process_that_hangs(bench: Launched, line: Line) -> None:
    pid = bench.process.pid
    os.kill(pid, signal.SIGSTOP)
    try:
        status, stopped = answer(bench, "estop")
    finally:
        os.kill(pid, signal.SIGCONT)
    found = stopped["endpoints"][0]
    assert (status, found["latched"], found["stopped"][0]["ok"]) == (1, True, True)
    assert any(f"(pid {pid}) but did not answer" in text for text in found["problems"])
    assert line.received(8) == bytes.fromhex(STOP)
    assert "estop" in call(bench, "move_rail", steps=1)
    assert answer(bench, "audit", "-verify")[1]["ok"] is True


def test_estop_where_the_process_does_not_know_how(bench: Launched, line: Line) -> None:
    bench.stop()
    door = Control(bench.layout.run)
    door.on("status", lambda _: {})
    door.start()
    try:
        status, stopped = answer(bench, "estop")
    finally:
        door.stop()
    assert (status, stopped["endpoints"][0]["direct"], stopped["endpoints"][0]["latched"]) == (0, True, True)
    assert line.received(8) == bytes.fromhex(STOP)


def test_a_device_that_is_gone_is_told_and_exit_status_is_1(bench: Launched, line: Line) -> None:
    line.unplug()
    done = octoform(bench, "estop")
    assert done.status == 1
    assert f"FAILED  {DEVICE}: " in done.out
    assert "bench: stopped." in done.out


def test_many_terminals_at_once(bench: Launched) -> None:
    results: list[tuple[int, dict[str, Any]]] = []
    kinds = [("estop",), ("estop", "-clear")] * 4
    threads = [threading.Thread(target=lambda kind=kind: results.append(answer(bench, *kind))) for kind in kinds]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert len(results) == 8
    records = answer(bench, "audit", "-n", "1000")[1]["records"]
    last = [record["event"] for record in records if record["event"] in ("estop", "estop_cleared")]
    assert last.count("estop") == 4
    latched = bench.ask("status")["estop"] is not None
    assert latched is (last[-1] == "estop")
    assert answer(bench, "audit", "-verify")[1]["ok"] is True


def test_no_endpoint_is_said(tmp_path: Path) -> None:
    done = Done(*warm.run(OCTOFORM, (f"-chdir={tmp_path}", "estop"), tmp_path, os.environ, 60))
    assert done.status == 1
    assert "error[ENDPOINT-NOT-APPLIED]: there is no endpoint in this folder" in done.err


@pytest.mark.parametrize("runs", [True, False], ids=["running", "stopped"])
def test_limits_are_shown_and_set_back(bench: Launched, runs: bool) -> None:
    assert call(bench, "move_rail", steps=100) == ""
    assert "would bring the sum over all calls to 200" in call(bench, "move_rail", steps=100)
    if not runs:
        bench.stop()
    done = octoform(bench, "limits")
    assert done.status == 0
    assert done.out.splitlines() == [
        "move_rail  actuate, allow  (default for actuate tools)",
        "    steps: -100 to 100 raw  (profile rail)",
        "    steps: sum of all calls 150 at most; it is 100  (policy.limits[0])",
        "    100 calls in 60 s; 1 used  (policy.limits[1])",
        "read_steps  read, allow  (default)",
    ]
    assert "did you mean" in octoform(bench, "limits", "-reset", "move_rails").err
    assert octoform(bench, "limits", "-reset", "move_rail").status == 0
    assert answer(bench, "limits")[1]["tools"][0]["sums"] == {}
    assert call(bench, "move_rail", steps=100) == ""
    assert "reset       the limits of move_rail were set back by " in octoform(bench, "audit").out


def test_the_audit_log_at_the_terminal(bench: Launched) -> None:
    assert call(bench, "move_rail", steps=5) == ""
    assert "above the most" in call(bench, "move_rail", steps=1000)
    lines = octoform(bench, "audit", "-n", "3").out.splitlines()
    assert len(lines) == 3
    assert re.search(
        r"refused     move_rail\(steps=1000\) for local \(.+\): steps 1000 raw is above the most", lines[2]
    )
    done = octoform(bench, "audit", "-verify")
    assert done.status == 0
    assert "The audit log is as it was written:" in done.out
    bench.stop()
    log = bench.layout.logs / "audit.jsonl"
    log.write_bytes(log.read_bytes().replace(b'"steps":5', b'"steps":6', 1))
    done = octoform(bench, "audit", "-verify")
    assert done.status == 1
    assert "error[AUDIT-BROKEN]: record " in done.err and "audit.jsonl:" in done.err
    status, verdict = answer(bench, "audit", "-verify")
    assert (status, verdict["ok"], verdict["diagnostics"][0]["code"]) == (1, False, "AUDIT-BROKEN")


def test_the_latest_records_come_from_logs_set_aside_too(tmp_path: Path) -> None:
    from octoform.endpoint.access import audit_log
    from octoform.server.audit.audit_log import Audit
    from octoform.state.layout import Layout

    layout = Layout(tmp_path, "bench")
    assert audit_log.latest(layout, 5) == ([], [])
    audit = Audit.open(layout.logs, rotate_bytes=2000)
    for number in range(60):
        audit.write("call", number=number)
    for count in (0, 1, 7, 45, 1000):
        found, _ = audit_log.latest(layout, count)
        sequence = [record["seq"] for record in found]
        assert sequence == list(range(audit.head[0] + 1))[1:][-count:] if count else sequence == []
    assert len(list(layout.logs.glob("audit-*.jsonl"))) > 4
