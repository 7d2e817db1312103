"""Clients of the Unix socket by themselves: greeted, refused when they are too many, dropped when they do not read."""

import asyncio
import contextlib
import json
import logging
import os
import socket
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import mcp_types
import pytest
from fastmcp.client.elicitation import ElicitResult
from launched import Launched, launched, tool
from mcp.shared.message import SessionMessage
from mcp_types import jsonrpc_message_adapter
from raw_mcp import call

from octoform.endpoint.sockets import connect, greeted
from octoform.server.process.local_socket import listen
from octoform.server.transport import unix_socket


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the door logs."""
    lines: list[str] = []

    class Kept(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            lines.append(record.getMessage())

    monkeypatch.setattr(unix_socket.LOGGER, "handlers", [Kept()])
    monkeypatch.setattr(unix_socket.LOGGER, "filters", [])
    return lines


class Talkative:
    """A server that answers each message with a million bytes, as a session of the protocol would."""

    def __init__(self) -> None:
        self._mcp_server = self
        self.answers = 0
        self.gone = asyncio.Event()

    def create_initialization_options(self) -> None:
        return None

    async def run(self, read: Any, write: Any, _: None) -> None:
        try:
            async for message in read:
                answer = {"jsonrpc": "2.0", "id": message.message.id, "result": {"text": "x" * 1_000_000}}
                await write.send(SessionMessage(jsonrpc_message_adapter.validate_python(answer, by_name=False)))
                self.answers += 1
        finally:
            self.gone.set()


@contextlib.asynccontextmanager
async def talking(folder: Path, requests: int) -> AsyncIterator[tuple[Talkative, socket.socket]]:
    """A client of it that sent so many requests; it reads only if the test does, but for the greeting."""
    server = Talkative()
    door = asyncio.create_task(unix_socket.LocalClients(server).serve(listen(folder / "endpoint.sock")))
    try:
        with await asyncio.to_thread(greeted, folder / "endpoint.sock", 20) as client:
            client.setblocking(False)
            sent = b"".join(json.dumps(call("any")).encode() + b"\n" for _ in range(requests))
            async with asyncio.timeout(60):
                await asyncio.get_running_loop().sock_sendall(client, sent)
                yield server, client
    finally:
        door.cancel()
        await asyncio.gather(door, return_exceptions=True)


def test_a_client_that_does_not_read_fills_no_memory(
    tmp_path: Path, said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unix_socket, "MAX_WAITING", 5_000_000)

    async def scenario() -> None:
        async with talking(tmp_path, 40) as (server, _):
            await server.gone.wait()
            assert 5 <= server.answers <= 10

    asyncio.run(scenario())
    assert "a local client that does not read was sent away" in "".join(said)


def test_a_client_that_takes_nothing_is_sent_away(
    tmp_path: Path, said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unix_socket, "READ_SECONDS", 0.05)

    async def scenario() -> None:
        async with talking(tmp_path, 10) as (server, _):  # more than the socket itself holds: 2 * SEND_BYTES
            await server.gone.wait()

    asyncio.run(scenario())
    assert "it took nothing for" in "".join(said)


def test_a_client_that_reads_gets_everything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also when it closes its own side as soon as it has asked."""
    monkeypatch.setattr(unix_socket, "MAX_WAITING", 50_000_000)

    async def scenario() -> None:
        async with talking(tmp_path, 20) as (server, client):
            client.shutdown(socket.SHUT_WR)
            reader, writer = await asyncio.open_unix_connection(sock=client, limit=1 << 22)
            for _ in range(20):
                assert len(await reader.readline()) > 1_000_000
            assert await reader.readline() == b""
            assert server.answers == 20
            writer.close()

    asyncio.run(scenario())


def test_a_full_house_is_told_as_such(tmp_path: Path, said: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """And not taken for a dead one, in whose place another would be started."""
    monkeypatch.setattr(unix_socket, "MAX_CLIENTS", 1)

    async def scenario() -> None:
        async with talking(tmp_path, 0) as (_, first):
            with await asyncio.to_thread(greeted, tmp_path / "endpoint.sock", 20) as late:
                answer = json.loads(await asyncio.to_thread(late.makefile("rb").read))
            assert answer["id"] is None and "has 1 clients" in answer["error"]["message"]
            first.close()

    asyncio.run(scenario())
    assert "a local client was turned away" in "".join(said)


def test_a_client_that_left_while_it_waited_is_no_trouble(tmp_path: Path, said: list[str]) -> None:
    async def scenario() -> None:
        listener = listen(tmp_path / "endpoint.sock")
        connect(tmp_path / "endpoint.sock", 20).close()
        door = asyncio.create_task(unix_socket.LocalClients(Talkative()).serve(listener))
        (await asyncio.to_thread(greeted, tmp_path / "endpoint.sock", 20)).close()
        door.cancel()
        await asyncio.gather(door, return_exceptions=True)

    asyncio.run(scenario())
    assert said == []


class Pipe:
    """A transport that reports how much waits in it."""

    def __init__(self) -> None:
        self.transport = self
        self.waiting = 0
        self.aborted = False

    def write(self, data: bytes) -> None:
        self.waiting += len(data)

    def get_write_buffer_size(self) -> int:
        return self.waiting

    def is_closing(self) -> bool:
        return self.aborted

    def abort(self) -> None:
        self.aborted = True


def test_a_slow_client_is_kept_as_long_as_it_takes_something(said: list[str]) -> None:
    async def scenario() -> None:
        pipe, left = Pipe(), []
        outbox = unix_socket._Outbox(pipe, lambda: left.append(True))  # type: ignore[arg-type]
        outbox.put(b"x" * 1000)
        for _ in range(50):
            pipe.waiting -= 10  # it took a little until the next look, while more came
            outbox.put(b"y" * 20)
            outbox._look()
            assert not left
        outbox._look()
        assert left and pipe.aborted

    asyncio.run(scenario())
    assert "it took nothing" in "".join(said)


def test_the_log_and_the_question_say_which_process_asks(tmp_path: Path) -> None:
    """Two processes of one user are distinguished, in both eras of the protocol."""
    source = (
        "from fastmcp import FastMCP\nmcp = FastMCP('bench')\n@mcp.tool\ndef fire(times: int) -> int: return times\n"
    )
    seen: list[str] = []

    async def person(message: str, *_: Any) -> Any:
        seen.append(message)
        return ElicitResult(action="accept", content={"value": True})

    async def scenario(endpoint: Launched, mode: str) -> None:
        who = mcp_types.Implementation(name="planner", version=mode)
        async with endpoint.client(mode, elicitation_handler=person, client_info=who) as client:
            await client.call_tool("fire", {"times": 1})

    tools = [tool("fire", "irreversible")]
    with launched(tmp_path, source, tools, policy={"tools": {"fire": {"decision": "confirm"}}}) as endpoint:
        for mode in ("auto", "legacy"):
            asyncio.run(scenario(endpoint, mode))
        lines = (endpoint.layout.logs / "audit.jsonl").read_text().splitlines()
    decisions = [record for record in map(json.loads, lines) if record["event"] == "decision"]
    assert [record["client"] for record in decisions] == ["planner auto"] * 2 + ["planner legacy"] * 2
    assert {record["uid"] for record in decisions} == {os.getuid()}
    assert len({record["pid"] for record in decisions}) == 2 and all(record["pid"] > 1 for record in decisions)
    for message, record in zip(seen, decisions[::2], strict=True):
        words = f'asked for by local (a client that calls itself "{record["client"]}", process {record["pid"]} of user '
        assert f"{words}{os.getuid()})?" in message
