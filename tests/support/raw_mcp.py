"""MCP without a client library: lines on a socket as anybody may send them, many at once."""

import asyncio
import itertools
import json
import os
import socket
from pathlib import Path
from typing import Any

VERSION = "2026-07-28"
ENVELOPE = {
    "io.modelcontextprotocol/protocolVersion": VERSION,
    "io.modelcontextprotocol/clientInfo": {"name": "raw", "version": "1"},
    "io.modelcontextprotocol/clientCapabilities": {},
}
_numbers = itertools.count(1)


def request(method: str, **params: Any) -> dict[str, Any]:
    """A request of the newest protocol with an id of its own."""
    meta = {**ENVELOPE, **params.pop("_meta", {})}
    return {"jsonrpc": "2.0", "id": next(_numbers), "method": method, "params": {**params, "_meta": meta}}


def call(tool: str, arguments: dict[str, Any] | None = None, **meta: Any) -> dict[str, Any]:
    """A call of a tool."""
    return request("tools/call", name=tool, arguments=arguments or {}, _meta=meta)


def connected(path: Path) -> socket.socket:
    """A connected socket of an endpoint, whatever the length of its name."""
    client = socket.socket(socket.AF_UNIX)
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        client.connect(f"/proc/self/fd/{folder}/{path.name}")
    finally:
        os.close(folder)
    return client


class RawClient:
    """One connection with as many requests under way as one likes; answers find their request by its id."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._waiting: dict[Any, asyncio.Future[dict[str, Any]]] = {}
        self.stray: list[dict[str, Any]] = []

    async def __aenter__(self) -> "RawClient":
        connection = connected(self._path)
        connection.setblocking(False)
        self._reader, self._writer = await asyncio.open_unix_connection(sock=connection, limit=1 << 27)
        self._listening = asyncio.create_task(self._listen())
        return self

    async def __aexit__(self, *_: object) -> None:
        self._writer.close()
        self._listening.cancel()

    def send_bytes(self, data: bytes) -> None:
        """Send what need not be a message."""
        self._writer.write(data)

    async def ask(self, message: dict[str, Any], seconds: float = 30.0) -> dict[str, Any]:
        """The answer to a request."""
        future = asyncio.get_running_loop().create_future()
        self._waiting[message["id"]] = future
        self.send_bytes(json.dumps(message).encode() + b"\n")
        await self._writer.drain()
        return await asyncio.wait_for(future, seconds)

    async def next_stray(self, seconds: float = 10.0) -> dict[str, Any]:
        """The next message that answers no request of ours."""
        async with asyncio.timeout(seconds):
            while not self.stray:
                await asyncio.sleep(0.005)
        return self.stray.pop(0)

    async def closed(self, seconds: float = 10.0) -> None:
        """Wait until the endpoint has closed the connection."""
        await asyncio.wait_for(asyncio.shield(self._listening), seconds)

    async def _listen(self) -> None:
        while line := await self._line():
            if not line.strip():
                continue  # the greeting
            message = json.loads(line)
            future = self._waiting.pop(message.get("id"), None)
            if future is None:
                self.stray.append(message)
            elif not future.done():
                future.set_result(message)

    async def _line(self) -> bytes:
        try:
            return await self._reader.readline()
        except ConnectionError:
            return b""
