"""The HTTP door of the launcher in this process: a real uvicorn on loopback in a thread of its own."""

import asyncio
import hashlib
import http.client
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastmcp import Client, FastMCP
from fastmcp.client.transports import StreamableHttpTransport

from octoform.server.process.descriptor import Descriptor
from octoform.server.process.principal import current
from octoform.server.transport.authentication import Tokens
from octoform.server.transport.http import Web

INSTANCE = "0123456789abcdef"
ALL = ("read", "actuate", "irreversible")


def descriptor_in(folder: Path, network: Mapping[str, Any] | None = None) -> Descriptor:
    """The launcher's settings, as far as its door needs them."""
    run = folder / "run"
    run.mkdir(mode=0o700, parents=True, exist_ok=True)
    given = {"interface": "127.0.0.1", "port": 17770, "hosts": [], "origins": [], **(network or {})}
    tools = ({"name": "who", "effect": "read", "devices": []},)
    return Descriptor(folder, "bench", "1.0", "intranet", {}, tools, (), {}, run, folder / "log", given, None)


def write_tokens(run: Path, tokens: Mapping[str, tuple[str, Sequence[str], str | None]]) -> None:
    """Tokens by name: value, effects, end."""
    items = [
        {
            "name": name,
            "sha256": hashlib.sha256(value.encode()).hexdigest(),
            "effects": list(effects),
            "created": "2026-01-01T00:00:00Z",
            "expires": expires,
        }
        for name, (value, effects, expires) in tokens.items()
    ]
    staging = run / "tokens.json.new"
    staging.write_text(json.dumps({"format": 1, "tokens": items}))
    staging.replace(run / "tokens.json")


def server() -> FastMCP[Any]:
    """A server whose tools return who called, and one that takes its time."""
    mcp: FastMCP[Any] = FastMCP("bench")
    mcp.slow = threading.Event()  # type: ignore[attr-defined]
    mcp.ended = threading.Event()  # type: ignore[attr-defined]

    @mcp.tool
    def who() -> dict[str, Any]:
        """The caller."""
        principal = current()
        return {"name": principal.name, "effects": sorted(principal.effects), "transport": principal.transport}

    @mcp.tool
    async def wait() -> str:
        """Waits until it is cancelled."""
        mcp.slow.set()  # type: ignore[attr-defined]
        try:
            await asyncio.sleep(60)
        except asyncio.CancelledError:
            mcp.ended.set()  # type: ignore[attr-defined]
            raise
        return "waited"

    @mcp.custom_route("/private", methods=["GET"])
    async def private(_: Any) -> Any:
        raise AssertionError("a route of the generated server was reached")

    return mcp


@dataclass
class Door:
    """A door that is open."""

    web: Web
    mcp: FastMCP[Any]
    run: Path
    port: int

    @property
    def url(self) -> str:
        """Where clients connect."""
        return self.web.url

    def client(self, token: str, mode: str = "auto", **options: Any) -> Client[Any]:
        """A real client with a token."""
        transport = StreamableHttpTransport(self.url, headers={"Authorization": f"Bearer {token}"})
        return Client(transport, mode=mode, **options)

    def ask(
        self, method: str, path: str, *, body: Any = None, headers: Mapping[str, str] | None = None
    ) -> tuple[int, dict[str, str], bytes]:
        """One plain request; status, headers in lower case, body."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        try:
            connection.request(method, path, body=body, headers=dict(headers or {}))
            answer = connection.getresponse()
            return answer.status, {name.lower(): text for name, text in answer.getheaders()}, answer.read()
        finally:
            connection.close()

    def connect(self) -> socket.socket:
        """A bare connection."""
        return socket.create_connection(("127.0.0.1", self.port), timeout=20)


@contextmanager
def door(folder: Path, network: Mapping[str, Any] | None = None, mcp: FastMCP[Any] | None = None) -> Iterator[Door]:
    """An open door; closed, with its thread, when the block ends."""
    descriptor = descriptor_in(folder, network)
    served = mcp or server()
    web = Web(served, descriptor, Tokens(descriptor.run / "tokens.json"), instance=INSTANCE)
    web.verdict = lambda: "healthy"
    port = web.open().port
    thread = threading.Thread(target=lambda: asyncio.run(web.serve()), daemon=True)
    thread.start()
    opened = Door(web, served, descriptor.run, port)
    until(lambda: opened.ask("GET", "/health")[0] == 200)
    try:
        yield opened
    finally:
        web.stop()
        thread.join(20)
        assert not thread.is_alive()


def until(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    """Wait for a condition; AssertionError when it does not come."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.01)


def listeners(pid: int) -> set[int]:
    """The TCP ports on which a process listens, by the kernel (proc(5))."""
    ours = {str(link.readlink()) for link in Path(f"/proc/{pid}/fd").iterdir() if link.is_symlink()}
    rows = [line.split() for table in ("tcp", "tcp6") for line in Path(f"/proc/net/{table}").read_text().splitlines()]
    return {int(row[1].rpartition(":")[2], 16) for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in ours}


INITIALIZE = json.dumps(
    {
        "jsonrpc": "2.0",
        "id": 1,
        "method": "initialize",
        "params": {
            "protocolVersion": "2025-11-25",
            "capabilities": {},
            "clientInfo": {"name": "test", "version": "1"},
        },
    }
)
MCP_HEADERS = {"Content-Type": "application/json", "Accept": "application/json, text/event-stream"}


def bearer(token: str) -> dict[str, str]:
    """The headers of an MCP request with a token."""
    return {**MCP_HEADERS, "Authorization": f"Bearer {token}"}
