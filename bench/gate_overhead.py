"""What the gate adds to a call: the server's CPU per call with and without it, in one run, in turns.

Both servers are the same FastMCP server over HTTP, with a blocking and an async tool; one has all of the launcher's
middleware in front (gate with policy, limits, bus, audit log with its witness and output schema; listing, resources,
notifications). The client is plain HTTP in this process, so its cost stays out of the figures, which come from /proc.
Bound: 10 % more CPU per call than the bare server, for each tool and era.
"""

import http.client
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from measuring import PYTHON, ROOT, Row, environment, report

MORE = 0.10
ROUNDS, CALLS = 24, 80
MODERN, LEGACY = "2026-07-28", "2025-11-25"
TOOLS = ("read_voltage", "read_level")

SERVER = """
import asyncio, sys
from pathlib import Path
import uvicorn
from fastmcp import FastMCP
from fastmcp.server.auth import StaticTokenVerifier
sys.path.insert(0, sys.argv[3])

tokens = {"bench": {"client_id": "bench", "scopes": ["read", "actuate"]}}
mcp = FastMCP("bench", version="1", auth=StaticTokenVerifier(tokens=tokens))

@mcp.tool
def read_voltage(channel: int, average: int = 1) -> dict[str, float]:
    return {"volt": 3.3 * channel, "average": average}

@mcp.tool
async def read_level(channel: int, average: int = 1) -> dict[str, float]:
    return {"level": 3.3 * channel, "average": average}

LIMIT = {"kind": "range", "parameter": "channel", "minimum": 0, "maximum": 7, "unit": "", "source": "bench"}
TOOL = {"effect": "read", "decision": "allow", "source": "default", "timeout": 30.0, "result_bytes": 10_000_000,
        "buses": ["usb-1"], "limits": [LIMIT]}

async def main(port, folder):
    if folder != "-":
        from octoform.policy import published as policy
        from octoform.server.audit.audit_log import Audit
        from octoform.server.gate.gate import Gate
        from octoform.server.latch import Latch
        from octoform.policy.enforce import Ledger
        from octoform.server.catalog import offer
        place = Path(folder)
        tools = {"read_voltage": TOOL, "read_level": TOOL}
        rules = policy.parse({"format": 1, "mode": "enforce", "tools": tools})
        ledger, latch = Ledger(rules, place / "limits.json"), Latch(place / "estop.json")
        described = [{"name": name, "effect": "read", "devices": ["usb-1"]} for name in tools]
        shown = offer(mcp, [{"id": "usb-1", "name": "meter", "category": "meter"}], described, rules)
        audit = Audit.open(place, witness=place / "audit.witness")
        gate = Gate(rules, ledger, audit, latch, shown.presence)
        mcp.add_middleware(gate)
        await gate.arm(mcp)
    app = mcp.http_app()
    config = uvicorn.Config(app, host="127.0.0.1", port=port, log_level="error", timeout_keep_alive=300)
    await uvicorn.Server(config).serve()

asyncio.run(main(int(sys.argv[1]), sys.argv[2]))
"""


@dataclass
class Served:
    """A server process and one connection of each era to it."""

    process: "subprocess.Popen[bytes]"
    port: int

    def __post_init__(self) -> None:
        self._wires = {era: http.client.HTTPConnection("127.0.0.1", self.port, timeout=30) for era in (MODERN, LEGACY)}
        self._session = ""
        self._number = 0

    def open(self) -> None:
        """Begin the handshake era's session."""
        for wire in self._wires.values():
            wire.close()
        hello = {"protocolVersion": LEGACY, "capabilities": {}, "clientInfo": {"name": "bench", "version": "1"}}
        _, headers = self._post(LEGACY, {}, {"id": 0, "method": "initialize", "params": hello})
        self._session = headers["mcp-session-id"]
        self._post(LEGACY, {}, {"method": "notifications/initialized"})

    def call(self, era: str, tool: str) -> None:
        """Call a tool once; an answer without the expected data is an error of the benchmark."""
        self._number += 1
        params: dict[str, Any] = {"name": tool, "arguments": {"channel": 2}}
        headers = {}
        if era == MODERN:
            own = "io.modelcontextprotocol"
            params["_meta"] = {f"{own}/protocolVersion": MODERN, f"{own}/clientCapabilities": {}}
            params["_meta"][f"{own}/clientInfo"] = {"name": "bench", "version": "1"}
            headers = {"Mcp-Method": "tools/call", "Mcp-Name": tool}
        body, _ = self._post(era, headers, {"id": self._number, "method": "tools/call", "params": params})
        if b"6.6" not in body:
            raise RuntimeError(f"{tool} answered {body[:500]!r}")

    def cpu(self) -> float:
        """CPU seconds of the process's threads so far, to the nanosecond; the ticks of `stat` are too coarse."""
        tasks = Path(f"/proc/{self.process.pid}/task").glob("*/schedstat")
        return sum(int(task.read_text().split()[0]) for task in tasks) / 1e9

    def _post(
        self, era: str, headers: Mapping[str, str], message: Mapping[str, Any]
    ) -> tuple[bytes, Mapping[str, str]]:
        wire = self._wires[era]
        sent = {"Content-Type": "application/json", "Accept": "application/json, text/event-stream", **headers}
        sent["Authorization"], sent["MCP-Protocol-Version"] = "Bearer bench", era
        if era == LEGACY and self._session:
            sent["Mcp-Session-Id"] = self._session
        wire.request("POST", "/mcp", json.dumps({"jsonrpc": "2.0", **message}), sent)
        answer = wire.getresponse()
        return answer.read(), {name.lower(): value for name, value in answer.getheaders()}


@contextmanager
def served(port: int, folder: str) -> Iterator[Served]:
    """A server, ready to be called."""
    argv = [PYTHON, "-c", SERVER, str(port), folder, str(ROOT)]
    process = subprocess.Popen(argv, env=environment({"FASTMCP_CHECK_FOR_UPDATES": "off"}))
    try:
        server = Served(process, port)
        deadline = time.monotonic() + 60
        while True:
            try:
                server.open()
                break
            except OSError:
                if process.poll() is not None or time.monotonic() > deadline:
                    raise
                time.sleep(0.1)
        yield server
    finally:
        process.terminate()
        process.wait(30)


def measure(servers: Mapping[str, Served]) -> dict[tuple[str, str, str], float]:
    """Milliseconds of CPU per call: (which server, era, tool)."""
    spent: dict[tuple[str, str, str], list[float]] = {}
    for number in range(ROUNDS + 1):
        for era in (MODERN, LEGACY):
            for tool in TOOLS:
                for name in sorted(servers, reverse=bool(number % 2)):
                    server = servers[name]
                    before = server.cpu()
                    for _ in range(CALLS):
                        server.call(era, tool)
                    if number:  # the first round warms up
                        spent.setdefault((name, era, tool), []).append((server.cpu() - before) / CALLS * 1000)
    # Whatever else runs on the machine adds to a round and never takes from it: the quietest quarter counts.
    return {key: statistics.fmean(sorted(values)[: ROUNDS // 4]) for key, values in spent.items()}


def main() -> int:
    """Measure, print, and say whether the bound holds."""
    with (
        tempfile.TemporaryDirectory() as folder,
        served(free_port(), "-") as bare,
        served(free_port(), folder) as gated,
    ):
        found = measure({"bare": bare, "gated": gated})
    rows = []
    for era in (MODERN, LEGACY):
        for tool, kind in zip(TOOLS, ("blocking", "async"), strict=True):
            without, with_gate = found["bare", era, tool], found["gated", era, tool]
            rows.append(Row(f"bare, {era}, {kind} tool", without, "ms CPU"))
            note = f"{(with_gate / without - 1) * 100:+.1f} %"
            rows.append(Row(f"gate, {era}, {kind} tool", with_gate, "ms CPU", without * (1 + MORE), note))
    return report("the gate's CPU per call over HTTP", rows)


def free_port() -> int:
    """A port that nobody listens on now."""
    import socket

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


if __name__ == "__main__":
    sys.exit(main())
