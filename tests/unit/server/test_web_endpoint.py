"""The whole endpoint in scope intranet: what a token may see and call, and what is open to strangers."""

import asyncio
import http.client
import json
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from launched import LOOPBACK, Launched, launched, tool
from web_doors import INITIALIZE, bearer, listeners

from octoform.endpoint.access import tokens

SOURCE = '''
from fastmcp import FastMCP
mcp = FastMCP("bench")
moved = []

@mcp.tool
def look() -> int:
    """How often something moved."""
    return len(moved)

@mcp.tool
def move() -> int:
    """Moves."""
    moved.append(1)
    return len(moved)
'''
TOOLS = [tool("look"), tool("move", "actuate")]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    with launched(tmp_path_factory.mktemp("web"), SOURCE, TOOLS, network=LOOPBACK) as endpoint:
        yield endpoint


@pytest.mark.parametrize("mode", ["auto", "legacy"])
def test_token_that_may_only_read_neither_sees_nor_moves_an_actuator(bench: Launched, mode: str) -> None:
    made, _ = tokens.create(bench.layout, f"reader-{mode}", ("read",), None)
    assert made is not None

    async def read_only() -> None:
        async with bench.http_client(mode, made.value) as client:
            assert [item.name for item in await client.list_tools()] == ["look"]
            before = (await client.call_tool("look")).data
            refused = await client.call_tool("move", raise_on_error=False)
            assert refused.is_error
            assert (await client.call_tool("look")).data == before

    async def all_of_it() -> None:
        async with bench.http_client(mode) as client:
            assert [item.name for item in await client.list_tools()] == ["look", "move"]
            assert not (await client.call_tool("move")).is_error

    asyncio.run(read_only())
    asyncio.run(all_of_it())


def test_health_of_the_real_process(bench: Launched) -> None:
    host = bench.url.removeprefix("http://").removesuffix("/mcp")
    connection = http.client.HTTPConnection(host, timeout=10)
    connection.request("GET", "/health")
    document = json.loads(connection.getresponse().read())
    connection.close()
    assert document == {"status": "unknown", "tools": 2, "instance": bench.process.instance}  # no daemon has looked


def test_only_the_one_port_listens(bench: Launched) -> None:
    port = int(bench.url.removeprefix("http://127.0.0.1:").removesuffix("/mcp"))
    assert listeners(bench.process.pid) == {port}


@pytest.mark.slow
def test_flood_of_half_open_connections_and_strangers_while_a_client_works(bench: Launched) -> None:
    host, _, port = bench.url.removeprefix("http://").removesuffix("/mcp").partition(":")
    silent = [socket.create_connection((host, int(port)), timeout=10) for _ in range(200)]

    def stranger() -> int:
        connection = http.client.HTTPConnection(host, int(port), timeout=20)
        connection.request("POST", "/mcp", body=INITIALIZE, headers=bearer("wrong"))
        status = connection.getresponse().status
        connection.close()
        return status

    async def work() -> None:
        strangers = [asyncio.to_thread(stranger) for _ in range(100)]
        async with bench.http_client() as client:
            results, statuses = await asyncio.gather(
                asyncio.gather(*(client.call_tool("look") for _ in range(200))), asyncio.gather(*strangers)
            )
        assert len(results) == 200
        assert set(statuses) == {401}

    try:
        asyncio.run(asyncio.wait_for(work(), 60))
    finally:
        for connection in silent:
            connection.close()
    assert bench.printed().count("refused:") <= 61


def test_scope_local_has_no_listener(tmp_path: Path) -> None:
    async def look(endpoint: Launched) -> None:
        async with endpoint.client() as client:
            assert (await client.call_tool("look")).data == 0
            assert listeners(endpoint.process.pid) == set()

    with launched(tmp_path, SOURCE, TOOLS) as endpoint:
        asyncio.run(look(endpoint))
