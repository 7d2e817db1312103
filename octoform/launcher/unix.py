"""Clients of this machine: each connection to the Unix socket is an MCP client with the framing of stdio.

One process owns the devices and serves them all. A client that sends what is no message, or too large a one, gets an
error and hurts nobody else; one that goes takes its running calls with it.
"""

import asyncio
import json
import socket
from typing import Any

import anyio
import mcp_types
from fastmcp.server.context import reset_transport, set_transport
from mcp.shared._context_streams import ContextReceiveStream, ContextSendStream, create_context_streams
from mcp.shared.message import SessionMessage

from .saying import say
from .socketfile import is_mine

LONGEST_LINE = 8 * 1024 * 1024
"""Bytes of one message from a client."""
MOST_CLIENTS = 100
_CHUNK = 1 << 16

Incoming = ContextSendStream[SessionMessage | Exception]
Outgoing = ContextReceiveStream[SessionMessage]


class LocalClients:
    """Serves ``server`` (FastMCP) to the clients of a listening Unix socket."""

    def __init__(self, server: Any) -> None:
        self._server = server
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def count(self) -> int:
        """How many clients are connected."""
        return len(self._tasks)

    async def serve(self, listener: socket.socket) -> None:
        """Take clients until cancelled; all of them are gone when this returns."""
        listener.setblocking(False)
        loop = asyncio.get_running_loop()
        try:
            while True:
                connection, _ = await loop.sock_accept(listener)
                self._admit(connection)
        finally:
            listener.close()
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    def _admit(self, connection: socket.socket) -> None:
        if not is_mine(connection) or len(self._tasks) >= MOST_CLIENTS:
            say("a local client was turned away")
            connection.close()
            return
        task = asyncio.create_task(self._client(connection))
        self._tasks.add(task)
        task.add_done_callback(self._gone)

    def _gone(self, task: "asyncio.Task[None]") -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (problem := task.exception()) is not None:
            say(f"a local client's connection failed: {problem!r}")

    async def _client(self, connection: socket.socket) -> None:
        reader, writer = await asyncio.open_unix_connection(sock=connection, limit=_CHUNK)
        to_server, read = create_context_streams[SessionMessage | Exception](0)
        write, from_server = create_context_streams[SessionMessage](0)
        token = set_transport("stdio")
        low_level = self._server._mcp_server
        try:
            async with anyio.create_task_group() as group:
                group.start_soon(_read, reader, writer, to_server)
                group.start_soon(_write, writer, from_server)
                await low_level.run(read, write, low_level.create_initialization_options())
                group.cancel_scope.cancel()
        finally:
            reset_transport(token)
            writer.close()


async def _read(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, incoming: Incoming) -> None:
    async with incoming:
        lines = _Lines(reader)
        while (line := await lines.next()) is not None:
            if not line.strip():
                continue
            try:
                message = mcp_types.jsonrpc_message_adapter.validate_json(line, by_name=False)
            except ValueError:
                await _refuse(writer, line)
                continue
            if isinstance(message, mcp_types.JSONRPCNotification) and b'"id"' in line and "id" in json.loads(line):
                # A request whose id is no id would pass for a notification, and its sender would wait for ever.
                await _refuse(writer, line)
                continue
            try:
                await incoming.send(SessionMessage(message))
            except (anyio.BrokenResourceError, anyio.ClosedResourceError):
                return
        if lines.too_long:
            await _send_error(writer, None, -32600, f"a message may have at most {LONGEST_LINE} bytes")


class _Lines:
    """The lines of a connection, none longer than LONGEST_LINE."""

    def __init__(self, reader: asyncio.StreamReader) -> None:
        self._reader = reader
        self._rest = bytearray()
        self.too_long = False

    async def next(self) -> bytes | None:
        """The next line without its end; None at the end, or when a line is too long."""
        searched = 0
        while (end := self._rest.find(b"\n", searched)) < 0:
            searched = len(self._rest)
            if searched > LONGEST_LINE:
                self.too_long = True
                return None
            try:
                part = await self._reader.read(_CHUNK)
            except ConnectionError:
                return None
            if not part:
                return None
            self._rest += part
        line = bytes(self._rest[:end])
        del self._rest[: end + 1]
        return line


async def _refuse(writer: asyncio.StreamWriter, line: bytes) -> None:
    """Answer what is no message as JSON-RPC has it: -32700 for no JSON, -32600 for JSON that is no message."""
    try:
        value = json.loads(line)
    except (ValueError, RecursionError):
        await _send_error(writer, None, -32700, "this is no JSON")
        return
    identity = value.get("id") if isinstance(value, dict) else None
    known = identity if isinstance(identity, str | int) and not isinstance(identity, bool) else None
    await _send_error(writer, known, -32600, "this is no JSON-RPC message")


async def _send_error(writer: asyncio.StreamWriter, identity: str | int | None, code: int, text: str) -> None:
    answer = {"jsonrpc": "2.0", "id": identity, "error": {"code": code, "message": text}}
    writer.write(json.dumps(answer).encode() + b"\n")
    try:
        await writer.drain()
    except ConnectionError:
        return


async def _write(writer: asyncio.StreamWriter, outgoing: Outgoing) -> None:
    async with outgoing:
        async for message in outgoing:
            text = message.message.model_dump_json(by_alias=True, exclude_unset=True)
            writer.write(text.encode() + b"\n")
            try:
                await writer.drain()
            except ConnectionError:
                return
