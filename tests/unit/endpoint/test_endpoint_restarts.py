"""Clients go on over the end of their endpoint: the next call works, and no device gets an order twice."""

import asyncio
import contextlib
import functools
import json
import os
import signal
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest
from fastmcp import Client
from launched import Launched, launched, tool
from mcp_types import ToolListChangedNotification
from raw_mcp import request

from octoform.endpoint.process import record

ERAS = ("2025-11-25", "2026-07-28")
SERVER = '''
import os, time
from pathlib import Path
from fastmcp import FastMCP
mcp = FastMCP("bench")
FOLDER = Path({folder!r})

@mcp.tool
def add(a: int, b: int) -> dict[str, int]:
    """A sum."""
    return {{"sum": a + b}}

@mcp.tool
def move() -> dict[str, int]:
    """Moves, for as long as a file is not there."""
    with (FOLDER / "moved").open("a") as moved:
        moved.write("x")
    while not (FOLDER / "go").exists():
        time.sleep(0.005)
    return {{"pid": os.getpid()}}
'''
TOOLS = [tool("add"), tool("move", "actuate", "usb-2")]


def in_a_loop(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """A test that runs in an event loop of its own."""

    @functools.wraps(test)
    def run(*given: Any, **named: Any) -> None:
        asyncio.run(test(*given, **named))

    return run


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    folder = tmp_path_factory.mktemp("restarts")
    with launched(folder / "bench", SERVER.format(folder=str(folder)), TOOLS) as found:
        yield found


@pytest.fixture
def folder(endpoint: Launched) -> Path:
    """Where the tool that moves leaves its traces."""
    found = endpoint.layout.project.parent
    for name in ("moved", "go"):
        (found / name).unlink(missing_ok=True)
    return found


def kill(endpoint: Launched) -> int:
    pid = endpoint.process.pid
    os.kill(pid, signal.SIGKILL)
    return pid


async def until(what: Path) -> None:
    async with asyncio.timeout(20):
        while not what.exists():
            await asyncio.sleep(0.005)


@contextlib.asynccontextmanager
async def connected(endpoint: Launched, era: str, **options: Any) -> AsyncIterator[Client[Any]]:
    if not endpoint.layout.socket.exists():
        endpoint.start()
    mode = "legacy" if era == ERAS[0] else "auto"
    async with asyncio.timeout(60), endpoint.client(mode, **options) as client:
        assert (await client.call_tool("add", {"a": 1, "b": 1})).structured_content == {"sum": 2}
        yield client


@in_a_loop
async def test_the_next_call_works_without_connecting_again(endpoint: Launched) -> None:
    """For clients of both eras, whose endpoint is killed; those of the handshake are notified of changed tools."""
    found = asyncio.Event()

    async def heard(message: Any) -> None:
        if isinstance(message, ToolListChangedNotification):
            found.set()

    async with connected(endpoint, ERAS[0], message_handler=heard) as old, connected(endpoint, ERAS[1]) as new:
        before = kill(endpoint)
        await asyncio.to_thread(endpoint.start)
        assert endpoint.process.pid != before
        await asyncio.wait_for(found.wait(), 20)
        for client in (old, new):
            assert (await client.call_tool("add", {"a": 2, "b": 40})).structured_content == {"sum": 42}
            assert {each.name for each in await client.list_tools()} == {"add", "move"}


@pytest.mark.parametrize("era", ERAS)
@in_a_loop
async def test_a_call_under_way_ends_with_a_clear_error_and_is_made_once(
    endpoint: Launched, folder: Path, era: str
) -> None:
    """And where no process starts the next one, the pipe does for the calls that wait, of which none is lost."""
    async with connected(endpoint, era) as client:
        moving = asyncio.create_task(client.call_tool("move"))
        await until(folder / "moved")
        kill(endpoint)
        with pytest.raises(Exception, match="its outcome is unknown"):
            await moving
        calls = [client.call_tool("add", {"a": number, "b": 0}) for number in range(20)]
        sums = [answer.structured_content for answer in await asyncio.gather(*calls)]
        assert sums == [{"sum": number} for number in range(20)]
        assert (folder / "moved").read_text() == "x", "it was sent to the next endpoint too"


@in_a_loop
async def test_what_a_person_stopped_is_not_started_by_a_pipe(endpoint: Launched) -> None:
    program, *arguments = endpoint.command
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(program, *arguments, stdin=pipe, stdout=pipe, stderr=pipe)
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write(json.dumps(request("tools/list")).encode() + b"\n")
    assert json.loads(await process.stdout.readline())["result"]["tools"]
    assert record.mark(endpoint.layout) is None
    await asyncio.to_thread(endpoint.stop)
    _, found = await asyncio.wait_for(process.communicate(), 20)
    assert (process.returncode, found) == (1, b"octoform: the endpoint of bench was stopped\n")
    record.unmark(endpoint.layout)
