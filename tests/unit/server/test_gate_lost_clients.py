"""A client that is gone takes its call with it: a closed pipe, a closed HTTP stream, on the running endpoint."""

import http.client
import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from launched import LOOPBACK, Launched, launched, tool
from waiting import until

SOURCE = """
import time
from pathlib import Path
from fastmcp import FastMCP

mcp = FastMCP("bench")

@mcp.tool
def turn(folder: str) -> int:
    Path(folder, "begun").touch()
    try:
        while True:
            time.sleep(0.01)
    finally:
        Path(folder, "ended").touch()
"""
META = {
    "io.modelcontextprotocol/protocolVersion": "2026-07-28",
    "io.modelcontextprotocol/clientCapabilities": {},
    "io.modelcontextprotocol/clientInfo": {"name": "test", "version": "1"},
}


def message(folder: Path) -> str:
    params = {"name": "turn", "arguments": {"folder": str(folder)}, "_meta": META}
    return json.dumps({"jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": params})


def leave_http(endpoint: Launched, folder: Path) -> None:
    address = endpoint.url.removeprefix("http://").partition("/")[0]
    wire = http.client.HTTPConnection(address, timeout=10)
    headers = {"Content-Type": "application/json", "Accept": "application/json, text/event-stream"}
    headers |= {"MCP-Protocol-Version": "2026-07-28", "Mcp-Method": "tools/call", "Mcp-Name": "turn"}
    wire.request("POST", "/mcp", message(folder), {**headers, "Authorization": f"Bearer {endpoint.token()}"})
    until((folder / "begun").exists)
    wire.close()


def leave_pipe(endpoint: Launched, folder: Path) -> None:
    with subprocess.Popen(endpoint.command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL) as process:
        assert process.stdin is not None
        process.stdin.write(message(folder).encode() + b"\n")
        process.stdin.flush()
        until((folder / "begun").exists)
        process.kill()


@pytest.mark.parametrize("leave", [leave_http, leave_pipe])
def test_the_device_stops_when_its_client_is_gone(tmp_path: Path, leave: Callable[[Launched, Path], None]) -> None:
    with launched(tmp_path, SOURCE, tools=[tool("turn", "actuate")], network=LOOPBACK) as endpoint:
        leave(endpoint, tmp_path)
        until((tmp_path / "ended").exists)
        log = endpoint.layout.logs / "audit.jsonl"
        until(lambda: '"outcome":"cancelled"' in log.read_text())
