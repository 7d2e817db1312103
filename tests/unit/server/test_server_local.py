"""Scope local: one process, many clients over the pipe, both protocol eras."""

import asyncio
import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest
from launched import Launched, launched, tool

SOURCE = '''
from fastmcp import FastMCP
import os
mcp = FastMCP("bench")

@mcp.tool
def who() -> dict[str, int]:
    """The process that answers."""
    return {"pid": os.getpid()}
'''


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    folder = tmp_path_factory.mktemp("local") / ("a folder with a name that no socket's path has room for " * 2)
    with launched(folder, SOURCE, [tool("who")]) as endpoint:
        yield endpoint


@pytest.mark.parametrize("mode", ["auto", "legacy"])
def test_many_clients_reach_one_process(bench: Launched, mode: str) -> None:
    async def one() -> int:
        async with bench.client(mode) as client:
            assert [item.name for item in await client.list_tools()] == ["who"]
            return int((await client.call_tool("who")).data["pid"])

    async def several() -> set[int]:
        return set(await asyncio.gather(*(one() for _ in range(4))))

    assert asyncio.run(several()) == {bench.process.pid}


def test_socket_is_private(bench: Launched) -> None:
    assert stat.S_IMODE(bench.layout.socket.stat().st_mode) == 0o600
    assert stat.S_IMODE(bench.layout.run.stat().st_mode) == 0o700
    assert bench.layout.socket.stat().st_uid == os.getuid()


def test_first_client_starts_what_does_not_run(tmp_path: Path) -> None:
    async def ask(endpoint: Launched) -> int:
        async with endpoint.client() as client:
            return int((await client.call_tool("who")).data["pid"])

    with launched(tmp_path, SOURCE, [tool("who")]) as endpoint:
        before = endpoint.process
        endpoint.stop()
        assert asyncio.run(ask(endpoint)) == endpoint.process.pid != before.pid
