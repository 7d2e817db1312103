"""A stop lasts: no client, list or call brings back what a person stopped, unless it was allowed to."""

import asyncio
import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastmcp import Client
from fastmcp.client.transports import StdioTransport
from launched import Launched, policy_of, tool, write
from raw_mcp import request
from unit.endpoint.endpoint_servers import HEADER
from unit.endpoint.endpoint_servers import tool as code
from warm import Loaded

from octoform.cli.main import main
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.terminal import call, list_tools
from octoform.endpoint.dial import Returning, started
from octoform.endpoint.process import record, start_stop
from octoform.endpoint.process.record import running
from octoform.endpoint.publication import Service
from octoform.engine import endpoint_process as engine
from octoform.state.layout import Layout

ASKED = request("tools/list")
SOURCE = HEADER + code("return 1.0")


@pytest.fixture
def stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Launched]:
    """An endpoint that a person stopped; what starts it here is a fork of a process that has loaded."""
    tools = [tool("read_clock"), tool("read_voltage")]
    endpoint = Launched(write(tmp_path / "bench", SOURCE, Service(tools, policy_of(tools))))
    assert record.mark(endpoint.layout) is None
    monkeypatch.setattr(start_stop, "_Detached", Loaded)
    yield endpoint
    endpoint.stop()


def connected(endpoint: Launched, line: bytes) -> subprocess.CompletedProcess[bytes]:
    """What the stdio command of a client answers to one message."""
    return subprocess.run(endpoint.command, input=line, capture_output=True, timeout=60, check=False)


def test_no_list_and_no_call_undoes_a_stop(stopped: Launched) -> None:
    """The refusal names who stopped it, when, and the command that ends the stop."""
    _, (listed,) = list_tools(stopped.layout)
    _, (called,) = call(stopped.layout, ToolCall("read_clock"))
    by = json.loads(stopped.layout.stop_mark.read_bytes())["by"]
    for problem in (listed, called):
        assert problem.code == "ENDPOINT-STOPPED"
        assert by in problem.summary and "octoform start" in (problem.hint or "")
    assert running(stopped.layout) is None
    assert record.is_marked(stopped.layout)


def test_a_client_that_comes_is_told_in_its_own_protocol(stopped: Launched) -> None:
    """A client shows the answer to its request; its standard error is often thrown away."""
    done = connected(stopped, json.dumps(ASKED).encode() + b"\n")
    answer = json.loads(done.stdout)
    assert (done.returncode, answer["id"]) == (1, ASKED["id"])
    assert "octoform start" in answer["error"]["message"]
    assert "octoform start" in done.stderr.decode() and "Traceback" not in done.stderr.decode()
    assert running(stopped.layout) is None


def test_a_client_that_says_nothing_is_told_on_standard_error(stopped: Launched) -> None:
    done = connected(stopped, b"")
    assert (done.returncode, done.stdout) == (1, b"")
    assert "stopped by" in done.stderr.decode()


def test_a_client_that_the_owner_allows_starts_it(stopped: Launched) -> None:
    program, *arguments = [*stopped.command, "-start"]

    async def names() -> list[str]:
        async with Client(StdioTransport(program, arguments, keep_alive=False)) as client:
            return sorted(each.name for each in await client.list_tools())

    assert asyncio.run(names()) == ["read_clock", "read_voltage"]
    assert not record.is_marked(stopped.layout)


def test_the_allowed_list_starts_it_and_ends_the_stop(stopped: Launched) -> None:
    tools, problems = list_tools(stopped.layout, revive=True)
    assert (len(tools), problems) == (2, ())
    assert not record.is_marked(stopped.layout)


def test_a_stop_that_comes_during_a_start_holds(stopped: Launched, monkeypatch: pytest.MonkeyPatch) -> None:
    """A person who stops while a client starts finds no process to end: the start itself must see the stop."""
    record.unmark(stopped.layout)
    begin = start_stop.start

    def meanwhile(layout: Layout) -> object:
        found = begin(layout)
        assert record.mark(layout) is None
        return found

    monkeypatch.setattr("octoform.endpoint.dial.start", meanwhile)
    problem = started(stopped.layout)
    assert problem is not None and problem.code == "ENDPOINT-STOPPED"
    assert running(stopped.layout) is None


def test_a_pipe_that_waits_for_the_next_endpoint_starts_none(stopped: Launched) -> None:
    assert Returning(stopped.layout)(True) == ""


def test_a_restart_is_no_start(stopped: Launched, monkeypatch: pytest.MonkeyPatch) -> None:
    """Restart replaces what runs; what a person stopped waits for `start`."""
    monkeypatch.setattr(engine, "layout_of", lambda *_: (stopped.layout, []))
    done, (problem,) = engine.restart(stopped.layout.project, {})
    assert (done, problem.code) == (None, "ENDPOINT-STOPPED")
    assert running(stopped.layout) is None
    done, _ = engine.start(stopped.layout.project, {})
    assert done is not None and not record.is_marked(stopped.layout)


def test_a_mark_that_cannot_be_read_still_stops(stopped: Launched) -> None:
    stopped.layout.stop_mark.write_bytes(b"\0not json")
    _, (problem,) = list_tools(stopped.layout)
    assert problem.code == "ENDPOINT-STOPPED" and "a person" in problem.summary


def test_stop_says_what_starts_it_again(
    stopped: Launched, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(engine, "layout_of", lambda *_: (stopped.layout, []))
    assert main([f"-chdir={stopped.layout.project}", "stop"]) == 0
    assert "octoform start" in capsys.readouterr().out
    assert os.path.lexists(stopped.layout.stop_mark)
