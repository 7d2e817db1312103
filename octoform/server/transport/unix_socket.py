"""Clients of this machine: each connection to the Unix socket is an MCP client with the framing of stdio.

Each is greeted with an empty line as it is taken. The kernel also connects clients to a process that is being killed;
without the greeting they could not know that no one will ever answer, and a process has to be started.

One process owns the devices and serves them all. A client that sends what is no message, or too large a one, gets an
error and hurts no one else; one that goes takes its running calls with it; one that does not read is sent away before
what waits for it fills the memory. A shortage of descriptors closes the door only for as long as it lasts.
"""

import asyncio
import json
import logging
import os
import socket
from collections.abc import Callable
from typing import Any

import anyio
import mcp_types
from anyio.streams.memory import MemoryObjectReceiveStream, MemoryObjectSendStream
from fastmcp.server.context import reset_transport, set_transport
from mcp.shared.message import SessionMessage

from octoform.base.files import parse
from octoform.server.internals import low_level
from octoform.server.process.local_socket import PASSING, PAUSE, connected, peer
from octoform.server.process.stderr_log import Throttle

MAX_LINE = 8 * 1024 * 1024
"""Bytes of one message from a client."""
GREETING = b"\n"
"""The greeting, before any message: a line that readers of lines pass over."""
MAX_CLIENTS = 100
SEND_BYTES = 1 << 20
MAX_WAITING = 64 * 1024 * 1024
"""Bytes that may wait for a client when the next message comes for it."""
READ_SECONDS = 30.0
"""How long a client may take nothing of what waits for it."""
_CHUNK = 1 << 16
LOGGER = logging.getLogger("octoform.unix")
LOGGER.addFilter(Throttle())

Incoming = MemoryObjectSendStream[SessionMessage | Exception]
Outgoing = MemoryObjectReceiveStream[SessionMessage]


class LocalClients:
    """Serves ``server`` (FastMCP) to the clients of a listening Unix socket."""

    def __init__(self, server: Any) -> None:
        self._server = server
        self._tasks: set[asyncio.Task[None]] = set()
        self._listener: tuple[socket.socket, int] | None = None

    @property
    def lost(self) -> bool:
        """True when something else in this process took the door's descriptor away: no one can come in any more."""
        if self._listener is None:
            return False
        listener, inode = self._listener
        try:
            return os.fstat(listener.fileno()).st_ino != inode
        except OSError:
            return True

    @property
    def count(self) -> int:
        """How many clients are connected."""
        return len(self._tasks)

    async def serve(self, listener: socket.socket) -> None:
        """Take clients until cancelled; all of them are gone when this returns."""
        listener.setblocking(False)
        self._listener = listener, os.fstat(listener.fileno()).st_ino
        try:
            while True:
                self._admit(await _accepted(listener))
        finally:
            if self.lost:
                listener.detach()  # the number is not ours to close
            self._listener = None
            listener.close()
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    def _admit(self, connection: socket.socket) -> None:
        if not peer(connection).mine:
            LOGGER.error("a client of another user was turned away")
            connection.close()
            return
        if not _greet(connection, full=len(self._tasks) >= MAX_CLIENTS):
            connection.close()
            return
        task = asyncio.create_task(self._client(connection))
        self._tasks.add(task)
        task.add_done_callback(self._gone)

    def _gone(self, task: "asyncio.Task[None]") -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (problem := task.exception()) is not None:
            LOGGER.error("a local client's connection failed: %r", problem)

    async def _client(self, connection: socket.socket) -> None:
        # A picture then leaves in one or two steps instead of many; the system grants what it may.
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BYTES)
        connected(peer(connection))  # this task's context, and that of all it starts
        reader, writer = await asyncio.open_unix_connection(sock=connection, limit=_CHUNK)
        to_server, read = anyio.create_memory_object_stream[SessionMessage | Exception](0)
        write, from_server = anyio.create_memory_object_stream[SessionMessage](0)
        token = set_transport("stdio")
        inner = low_level(self._server)
        try:
            async with anyio.create_task_group() as group:
                outbox = _Outbox(writer, group.cancel_scope.cancel)
                group.start_soon(_read, reader, outbox, to_server)
                group.start_soon(_write, outbox, from_server)
                await inner.run(read, write, inner.create_initialization_options())
                group.cancel_scope.cancel()
        finally:
            reset_transport(token)
            writer.close()


async def _accepted(listener: socket.socket) -> socket.socket:
    """The next connection; in a shortage it comes as soon as there is room again."""
    short = False
    while True:
        try:
            connection, _ = await asyncio.get_running_loop().sock_accept(listener)
            return connection
        except OSError as problem:
            if problem.errno not in PASSING:
                raise
            if not short:
                LOGGER.error("no local client can be taken now: %s", problem)
            short = True
        await asyncio.sleep(PAUSE)


def _greet(connection: socket.socket, full: bool) -> bool:
    """Inform a client that it was accepted, or that there are too many; False when it has to go."""
    text = _error(None, -32000, f"this endpoint has {MAX_CLIENTS} clients and takes no more") if full else b""
    try:
        connection.send(GREETING + text)
    except OSError:  # it is gone
        return False
    if full:
        LOGGER.error("a local client was turned away: there are %s", MAX_CLIENTS)
    return not full


class _Outbox:
    """The queue of messages to a client. ``leave`` is called when it has to go because it does not read."""

    def __init__(self, writer: asyncio.StreamWriter, leave: Callable[[], None]) -> None:
        self._transport = writer.transport
        self._leave = leave
        self._sent = 0
        self._taken = -1
        self._timer: asyncio.TimerHandle | None = None

    def put(self, line: bytes) -> None:
        """Send one message with the end of its line, which waits where the client is not ready for it."""
        if self._transport.is_closing():
            return
        waiting = self._transport.get_write_buffer_size()
        if waiting > MAX_WAITING:
            self._give_up(f"{waiting} bytes wait for it")
            return
        self._transport.write(line)
        self._sent += len(line)
        if self._timer is None:
            self._look()

    def _look(self) -> None:
        """As long as something waits, see that some of it was taken since the last look."""
        self._timer = None
        waiting = self._transport.get_write_buffer_size()
        taken = self._sent - waiting
        if not waiting:
            return
        if taken == self._taken:
            self._give_up(f"it took nothing for {READ_SECONDS:.0f} s")
            return
        self._taken = taken
        self._timer = asyncio.get_running_loop().call_later(READ_SECONDS, self._look)

    def _give_up(self, why: str) -> None:
        LOGGER.error("a local client that does not read was sent away: %s", why)
        self._transport.abort()
        self._leave()


async def _read(reader: asyncio.StreamReader, outbox: _Outbox, incoming: Incoming) -> None:
    async with incoming:
        lines = _Lines(reader)
        while (line := await lines.next()) is not None:
            if not line.strip():
                continue
            try:
                message = mcp_types.jsonrpc_message_adapter.validate_json(line, by_name=False)
            except ValueError:
                _refuse(outbox, line)
                await asyncio.sleep(0)  # others get their turn, however much of it there is
                continue
            if isinstance(message, mcp_types.JSONRPCNotification) and is_request(line):
                # A request whose id is no id would pass for a notification, and its sender would wait without end.
                _refuse(outbox, line)
                await asyncio.sleep(0)  # others get their turn, however much of it there is
                continue
            try:
                await incoming.send(SessionMessage(message))
            except (anyio.BrokenResourceError, anyio.ClosedResourceError):
                return
        if lines.too_long:
            outbox.put(_error(None, -32600, f"a message may have at most {MAX_LINE} bytes"))


class _Lines:
    """The lines of a connection, none longer than MAX_LINE."""

    def __init__(self, reader: asyncio.StreamReader) -> None:
        self._reader = reader
        self._rest = bytearray()
        self.too_long = False

    async def next(self) -> bytes | None:
        """The next line without its end; None at the end, or when a line is too long."""
        searched = 0
        while (end := self._rest.find(b"\n", searched)) < 0:
            searched = len(self._rest)
            if searched > MAX_LINE:
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


def is_request(text: bytes) -> bool:
    """Whether a message has a method and an id, whatever its id is; true as well for what is no strict JSON."""
    try:
        message = parse(text)
    except ValueError:
        return True
    return isinstance(message, dict) and "method" in message and "id" in message


def _refuse(outbox: _Outbox, line: bytes) -> None:
    """Answer what is no message as JSON-RPC has it: -32700 for no JSON, -32600 for JSON that is no message."""
    try:
        value = parse(line)
    except ValueError:
        outbox.put(_error(None, -32700, "this is no JSON"))
        return
    identity = value.get("id") if isinstance(value, dict) else None
    known = identity if isinstance(identity, str | int) and not isinstance(identity, bool) else None
    outbox.put(_error(known, -32600, "this is no JSON-RPC message"))


def _error(identity: str | int | None, code: int, text: str) -> bytes:
    """An error as JSON-RPC has it, as a line."""
    answer = {"jsonrpc": "2.0", "id": identity, "error": {"code": code, "message": text}}
    return json.dumps(answer).encode() + b"\n"


async def _write(outbox: _Outbox, outgoing: Outgoing) -> None:
    async with outgoing:
        async for message in outgoing:
            outbox.put(message.message.model_dump_json(by_alias=True, exclude_unset=True).encode() + b"\n")
