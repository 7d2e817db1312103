"""An async tool that blocks the event loop, in a real process: the other clients are answered again."""

import asyncio
import contextlib
import os
import subprocess
import sys
import time
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from fastmcp import Client
from fastmcp.client.transports import StreamableHttpTransport
from gated import MODES

SERVER = """
import asyncio, json, sys, time
from pathlib import Path
import uvicorn
sys.path[:0] = [sys.argv[1], sys.argv[2]]
from fastmcp.server.auth import StaticTokenVerifier
from gated import gated, tool_policy

async def sleeps() -> int:
    time.sleep(600)
    return 1

async def spins() -> int:
    while True:
        pass

def inline() -> int:
    time.sleep(600)
    return 1

async def computes() -> int:
    # Blocks too, but its time is not over: it must be left alone.
    end = time.monotonic() + 2.5
    while time.monotonic() < end:
        pass
    return 3

def answer() -> int:
    return 42

async def main():
    short = tool_policy("read", timeout=0.5)
    tools = {sleeps: short, spins: short, computes: tool_policy("read", timeout=30.0), answer: tool_policy("read")}
    async with gated(Path(sys.argv[3]), tools) as gate:
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


@contextlib.asynccontextmanager
async def serving(folder: Path) -> AsyncIterator[str]:
    """The URL of the server in a process of its own."""
    argv = [sys.executable, "-c", SERVER, str(ROOT), str(ROOT / "tests" / "support"), str(folder)]
    environ = {**os.environ, "FASTMCP_CHECK_FOR_UPDATES": "off"}
    with subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environ) as process:
        assert process.stdout is not None
        try:
            port = await asyncio.to_thread(process.stdout.readline)
            yield f"http://127.0.0.1:{port.strip()}/mcp"
        finally:
            process.kill()


def client(url: str, mode: str) -> Client[StreamableHttpTransport]:
    return Client(StreamableHttpTransport(url, headers={"Authorization": "Bearer t"}), mode=mode)


@pytest.mark.parametrize("mode", MODES)
def test_a_tool_that_blocks_everybody_is_interrupted_when_its_time_is_over(tmp_path: Path, mode: str) -> None:
    async def scenario() -> None:
        async with serving(tmp_path) as url, client(url, mode) as guilty, client(url, "auto") as other:
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
