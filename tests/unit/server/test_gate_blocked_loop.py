"""What blocks the event loop, in a real process: the other clients are answered again, and no one else is hit."""

import asyncio
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastmcp import Client
from fastmcp.client.transports import StreamableHttpTransport
from gated import MODES
from mcp.shared.exceptions import MCPError

TOOLS = """
import asyncio, time

async def sleeps() -> int:
    time.sleep(600)
    return 1

async def spins() -> int:
    while True:
        pass

def inline() -> int:
    time.sleep(600)
    return 1

async def hogs() -> int:
    # Has much time, and nobody else shall wait for it.
    time.sleep(600)
    return 1

tasks = []

def hog(forms):
    # However often it swallows what is raised.
    while True:
        try:
            time.sleep(600)
        except BaseException as problem:
            forms.append(type(problem).__name__)
            if len(forms) > 1:
                raise

interruptions = []

async def leaves() -> int:
    async def later():
        hog(interruptions)
    tasks.append(asyncio.create_task(later()))
    return 0

async def plans() -> int:
    asyncio.get_running_loop().call_soon(hog, interruptions)
    return 0

def counts() -> int:
    count = len(interruptions)
    interruptions.clear()
    return count

class Picky:
    # Our own code calls this to make an argument of it.
    @classmethod
    def __get_pydantic_core_schema__(cls, source, handler):
        from pydantic_core import core_schema
        return core_schema.no_info_plain_validator_function(
            cls.made, json_schema_input_schema=core_schema.int_schema())

    @classmethod
    def made(cls, value):
        time.sleep(600)

def picks(value: Picky) -> int:
    return 5

async def computes() -> int:
    # Blocks too, but not for long, and its time is not over: it must be left alone.
    end = time.monotonic() + 1.2
    while time.monotonic() < end:
        pass
    return 3

def answer() -> int:
    return 42
"""
SERVER = """
import asyncio, sys
from pathlib import Path
import uvicorn
sys.path[:0] = sys.argv[1:]
from fastmcp.server.auth import StaticTokenVerifier
from gated import gated, tool_policy
from octoform.server.execution.watchdog import WATCHDOG
from served import *

async def main():
    short = tool_policy("read", timeout=0.5)
    long = tool_policy("read", timeout=30.0)
    tools = {sleeps: short, spins: short, **dict.fromkeys((computes, hogs, leaves, plans, counts, picks, answer), long)}
    WATCHDOG.cover(Path(sys.argv[3]))
    async with gated(Path(sys.argv[3]).parent, tools) as gate:
        gate.server.tool(inline, run_in_thread=False)
        gate.gate._policy.tools["inline"] = gate.gate._policy.tools["sleeps"]
        gate.server.auth = StaticTokenVerifier(tokens={"t": {"client_id": "test", "scopes": ["read"]}})
        server = uvicorn.Server(uvicorn.Config(gate.server.http_app(), host="127.0.0.1", port=0, log_level="error"))
        serving = asyncio.create_task(server.serve())
        while not server.started:
            await asyncio.sleep(0.01)
        print(server.servers[0].sockets[0].getsockname()[1], flush=True)
        await serving

asyncio.run(main())
"""
ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The URL of the server in a process of its own, which all that these tests do to it has to leave whole."""
    folder = tmp_path_factory.mktemp("blocked")
    (folder / "served").mkdir()
    (folder / "served" / "served.py").write_text(TOOLS)
    argv = [sys.executable, "-c", SERVER, str(ROOT), str(ROOT / "tests" / "support"), str(folder / "served")]
    environ = {**os.environ, "FASTMCP_CHECK_FOR_UPDATES": "off"}
    with subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environ) as process:
        assert process.stdout is not None
        try:
            yield f"http://127.0.0.1:{process.stdout.readline().strip()}/mcp"
        finally:
            process.kill()


def client(url: str, mode: str) -> Client[StreamableHttpTransport]:
    return Client(StreamableHttpTransport(url, headers={"Authorization": "Bearer t"}), mode=mode)


@pytest.mark.parametrize("mode", MODES)
def test_a_tool_that_blocks_everybody_is_interrupted_when_its_time_is_over(url: str, mode: str) -> None:
    async def scenario() -> None:
        async with client(url, mode) as guilty, client(url, "auto") as other:
            for tool in ("sleeps", "spins", "inline"):
                blocking = asyncio.create_task(guilty.call_tool(tool, {}, raise_on_error=False))
                await asyncio.sleep(0)
                before = time.monotonic()
                async with asyncio.timeout(30):
                    while not blocking.done():
                        assert (await other.call_tool("answer", {})).data == 42
                result = await blocking
                assert result.is_error and "did not return within its 0.5 s" in result.content[0].text, tool
                assert time.monotonic() - before < 15
                assert (await other.call_tool("answer", {})).data == 42
            assert (await guilty.call_tool("computes", {})).data == 3

    asyncio.run(scenario())


@pytest.mark.parametrize("tool", ["hogs", "leaves", "plans", "picks"])
def test_whatever_blocks_everybody_is_interrupted_although_it_has_time(url: str, tool: str) -> None:
    """A tool, a task that it left, what it put on the event loop, and what our own code calls of the server."""

    async def scenario() -> None:
        async with client(url, "auto") as guilty, client(url, "auto") as other:
            arguments = {"value": 1} if tool == "picks" else {}
            blocking = asyncio.create_task(guilty.call_tool(tool, arguments, raise_on_error=False))
            began = time.monotonic()
            async with asyncio.timeout(30):
                if tool == "picks":
                    with pytest.raises(MCPError):
                        await blocking
                else:
                    result = await blocking
                if tool in {"leaves", "plans"}:  # swallowed once, so interrupted twice
                    while (await other.call_tool("counts", {})).data != 2:
                        pass
            assert (await other.call_tool("answer", {})).data == 42
            assert time.monotonic() - began < 15
            if tool == "hogs":
                assert result.content[0].text.startswith("hogs blocked every other call and was interrupted")

    asyncio.run(scenario())
