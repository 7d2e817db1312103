"""Abuse of a running endpoint by clients of this machine: no one gets in, nothing hangs for the others."""

import asyncio
import json
import os
import re
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from launched import Launched, launched, tool
from raw_mcp import RawClient, call, connected, request

from octoform.endpoint.process import record

SOURCE = '''
import asyncio, time
from fastmcp import FastMCP
mcp = FastMCP("bench")

@mcp.tool
def add(a: int, b: int) -> dict[str, int]:
    """A sum."""
    return {"sum": a + b}

@mcp.tool
def hang() -> dict[str, int]:
    """Never returns, in a call that nothing interrupts."""
    time.sleep(100000)

@mcp.tool
async def block() -> dict[str, int]:
    """Never returns, and holds the event loop."""
    while True:
        pass

@mcp.tool
def flood() -> str:
    """Fifty megabytes."""
    return "x" * 50_000_000

@mcp.tool
def move(steps: int) -> dict[str, int]:
    """Moves."""
    return {"moved": steps}
'''
TOOLS = [
    tool("add", "read", "usb-1"),
    tool("hang", "read", "usb-2"),
    tool("block", "read", "usb-3"),
    tool("flood", "read", "usb-4"),
    tool("move", "actuate", "usb-5"),
]
POLICY = {"tools": {"hang": {"timeout": 1.0}, "block": {"timeout": 1.0}}}


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    with launched(tmp_path_factory.mktemp("abuse"), SOURCE, TOOLS, policy=POLICY) as endpoint:
        yield endpoint


def text_of(answer: dict[str, Any]) -> str:
    return str(answer["result"]["content"][0]["text"])


async def adds(client: RawClient, first: int, count: int) -> int:
    """So many sums one after the other; how many came out right."""
    right = 0
    for number in range(first, first + count):
        answer = await client.ask(call("add", {"a": number, "b": 1}))
        right += answer["result"]["structuredContent"] == {"sum": number + 1}
    return right


EACH = 12
"""Calls of each of 32 at once."""


def test_many_calls_at_once_lose_nothing(bench: Launched) -> None:
    records = bench.layout.logs / "audit.jsonl"
    before = len(records.read_bytes().splitlines())

    async def flood() -> int:
        async with RawClient(bench.layout.socket) as one, RawClient(bench.layout.socket) as two:
            clients = [one, two] * 16
            return sum(await asyncio.gather(*(adds(client, 1000 * at, EACH) for at, client in enumerate(clients))))

    assert asyncio.run(flood()) == 32 * EACH

    def named(event: str) -> list[str]:
        added = [json.loads(line) for line in records.read_bytes().splitlines()[before:]]
        return [entry["call"] for entry in added if entry["event"] == event]

    decided = named("decision")
    assert len(set(decided)) == len(decided) == 32 * EACH
    deadline = time.monotonic() + 10
    while len(named("outcome")) < 32 * EACH:  # those of readings follow in a moment
        assert time.monotonic() < deadline, "outcomes are missing"
        time.sleep(0.05)
    assert sorted(decided) == sorted(named("outcome"))


@pytest.mark.parametrize("name", ["hang", "block"])
def test_a_tool_that_never_returns_hangs_nobody_else(bench: Launched, name: str) -> None:
    async def both() -> tuple[dict[str, Any], float]:
        async with RawClient(bench.layout.socket) as guilty, RawClient(bench.layout.socket) as other:
            hanging = asyncio.create_task(guilty.ask(call(name)))
            await asyncio.sleep(0.1)
            began = time.monotonic()
            assert await adds(other, 0, 20) == 20
            spent = time.monotonic() - began
            return await hanging, spent

    answer, spent = asyncio.run(both())
    assert answer["result"]["isError"] is True
    assert "1" in text_of(answer) and name in text_of(answer)
    assert spent < 5.0


def test_a_result_of_fifty_megabytes_is_not_delivered(bench: Launched) -> None:
    async def ask() -> dict[str, Any]:
        async with RawClient(bench.layout.socket) as client:
            return await client.ask(call("flood"))

    answer = asyncio.run(ask())
    assert answer["result"]["isError"] is True
    assert len(json.dumps(answer)) < 2000


@pytest.mark.parametrize(
    ("line", "code"),
    [
        (b"this is no JSON\n", -32700),
        (b'{"jsonrpc": "2.0", "id": 1\n', -32700),
        (b"\xff\xfe\x00\n", -32700),
        (b"[1, 2, 3]\n", -32600),
        (b'{"jsonrpc": "1.0", "id": 7, "method": "tools/list"}\n', -32600),
        (b'{"jsonrpc": "2.0", "id": {"a": 1}, "method": "tools/list"}\n', -32600),
        (b'{"jsonrpc": "2.0", "id": 1.5, "method": "tools/list"}\n', -32600),
        (b'{"jsonrpc": "2.0", "\\u0069d": 1.5, "method": "tools/list"}\n', -32600),
        (b'{"jsonrpc": "2.0", "id": 1e400, "method": "tools/list"}\n', -32700),
        (b'{"jsonrpc": "2.0", "id": NaN, "method": "tools/list"}\n', -32700),
        (b'{"jsonrpc": "2.0", "method": "notifications/x", "params": {"id": -1e999}}\n', -32700),
        (b"[" * 100_000 + b"\n", -32700),
    ],
)
def test_what_is_no_message_is_answered_and_hurts_nobody(bench: Launched, line: bytes, code: int) -> None:
    async def ask() -> dict[str, Any]:
        async with RawClient(bench.layout.socket) as client:
            client.send_bytes(line)
            answer = await client.next_stray()
            assert await adds(client, 0, 1) == 1
            return answer

    assert asyncio.run(ask())["error"]["code"] == code


@pytest.mark.parametrize(
    ("method", "params"),
    [
        ("tools/call", {"name": "NAME", "arguments": {}}),
        ("tools/call", {"name": "add", "arguments": {"NAME": 1}}),
        ("tools/call", {"name": "add", "arguments": {"a": "NAME", "b": 1}}),
        ("tools/call", {"name": "add", "arguments": {"a": 1, "b": 1}, "NAME": 1}),
        ("tools/list", {"cursor": "NAME"}),
        ("resources/read", {"uri": "octoform://NAME"}),
        ("resources/subscribe", {"uri": "octoform://NAME"}),
        ("prompts/get", {"name": "NAME"}),
        (
            "completion/complete",
            {"ref": {"type": "ref/prompt", "name": "NAME"}, "argument": {"name": "a", "value": ""}},
        ),
        ("logging/setLevel", {"level": "NAME"}),
        ("resources/read", {"uri": "octoform://frames/NAME"}),
        ("NAME", {}),
    ],
)
def test_what_a_client_names_at_length_is_not_sent_back(bench: Launched, method: str, params: dict[str, Any]) -> None:
    long = "n\x1b[2J" * 200_000

    async def ask() -> dict[str, Any]:
        async with RawClient(bench.layout.socket) as client:
            given = json.loads(json.dumps(params).replace("NAME", json.dumps(long)[1:-1]))
            answer = await client.ask(request(method.replace("NAME", long), **given))
            assert await adds(client, 0, 1) == 1
            return answer

    before = bench.layout.server_log.stat().st_size
    answer = json.dumps(asyncio.run(ask()))
    assert len(answer) < 4000, answer[:500]
    assert not re.search(r"(?<!\\)(\\\\)*\\u001b", answer)
    assert bench.layout.server_log.stat().st_size - before < 2000


def test_a_line_of_a_hundred_megabytes_ends_its_own_connection(bench: Launched) -> None:
    async def ask() -> None:
        async with RawClient(bench.layout.socket) as guilty, RawClient(bench.layout.socket) as other:
            part = b"x" * (1 << 20)
            for _ in range(100):
                guilty.send_bytes(part)
                try:
                    await asyncio.wait_for(guilty._writer.drain(), 5)
                except (ConnectionError, TimeoutError):
                    break
            assert await adds(other, 0, 20) == 20
            await guilty.closed()

    asyncio.run(ask())
    status = Path(f"/proc/{bench.process.pid}/status").read_text()
    peak = int(status.partition("VmRSS:")[2].split()[0])
    assert peak < 400_000


def test_connections_that_say_nothing_keep_nobody_out(bench: Launched) -> None:
    silent = [connected(bench.layout.socket) for _ in range(60)]
    half = connected(bench.layout.socket)
    half.sendall(json.dumps(request("tools/list")).encode()[:40])

    async def ask() -> int:
        async with RawClient(bench.layout.socket) as client:
            return await adds(client, 0, 10)

    try:
        assert asyncio.run(ask()) == 10
    finally:
        for connection in (*silent, half):
            connection.close()


def test_a_client_that_does_not_read_holds_nobody_up(bench: Launched) -> None:
    deaf = connected(bench.layout.socket)
    deaf.setblocking(False)
    line = json.dumps(request("tools/list")).encode() + b"\n"
    try:
        for _ in range(20_000):
            deaf.send(line)
    except BlockingIOError:
        pass

    async def ask() -> int:
        async with RawClient(bench.layout.socket) as client:
            return await adds(client, 0, 20)

    try:
        assert asyncio.run(ask()) == 20
    finally:
        deaf.close()


def test_the_control_door_stands_when_it_is_knocked_at(bench: Launched) -> None:
    for data in (b"", b"no json\n", b"[]\n", b'{"op": "nothing"}\n', b"x" * 200_000):
        with connected(bench.layout.run / "control.sock") as connection:
            try:
                connection.sendall(data)
            except BrokenPipeError:
                continue
    assert record.ask(bench.layout, {"op": "status"}) is not None


def test_a_killed_process_is_started_again_by_the_next_client(bench: Launched) -> None:
    before = bench.process
    os.kill(before.pid, signal.SIGKILL)

    async def ask() -> Any:
        async with bench.client() as client:
            return (await client.call_tool("add", {"a": 1, "b": 2})).data

    assert asyncio.run(ask()) == {"sum": 3}
    assert bench.process.pid != before.pid
