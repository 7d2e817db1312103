"""A server behind the real gate, in this process; the policy as the core would have written it, the rest as it is."""

import contextlib
import json
import sys
import time
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastmcp import Client, FastMCP

from octoform.policy import published as policies
from octoform.policy.enforce import Ledger
from octoform.server.audit.audit_log import Audit
from octoform.server.execution.work import Patience
from octoform.server.gate.gate import Gate
from octoform.server.latch import Latch

QUICK = Patience(answer=0.05, stuck=0.1, again=0.05)
MODES = ("auto", "legacy")


class There:
    """Devices that a test unplugs."""

    def __init__(self) -> None:
        self.gone: dict[str, list[str]] = {}

    def missing(self, tool: str, _device: object) -> list[str]:
        return self.gone.get(tool, [])


@dataclass
class Gated:
    """The server, its gate and what the gate was built from; ``records()`` reads the audit log from the disk."""

    server: FastMCP
    gate: Gate
    latch: Latch
    ledger: Ledger
    there: There
    folder: Path

    def client(self, mode: str = "auto", **more: Any) -> Client[Any]:
        return Client(self.server, mode=mode, **more)

    def records(self, event: str | None = None) -> list[dict[str, Any]]:
        self.gate._records.flush()
        lines = (self.folder / "log" / "audit.jsonl").read_text().splitlines()
        found = [json.loads(line) for line in lines]
        return [each for each in found if event is None or each["event"] == event]

    def counted(self) -> list[tuple[str, ...]]:
        """Decisions and outcomes in short: (decision, code) and (outcome,)."""
        return [
            (each["decision"], *([each["code"]] if "code" in each else []))
            if each["event"] == "decision"
            else (each.get("outcome", each["event"]),)
            for each in self.records()
        ]


def tool_policy(effect: str = "actuate", **changes: Any) -> dict[str, Any]:
    """The entry of policy.json for a tool."""
    whole = {"effect": effect, "decision": "allow", "source": "default", "timeout": 10.0, "result_bytes": 10_000_000}
    return {**whole, "buses": [], "limits": [], **changes}


@contextlib.asynccontextmanager
async def gated(
    folder: Path,
    tools: Mapping[Any, Mapping[str, Any]],
    mode: str = "enforce",
    clock: Callable[[], float] = time.monotonic,
    patience: Patience = QUICK,
) -> AsyncIterator[Gated]:
    """Put these functions behind the gate, each with its entry of policy.json."""
    server = FastMCP("bench")
    for function in tools:
        server.tool(function)
    document = {"format": 1, "mode": mode, "tools": {each.__name__: dict(what) for each, what in tools.items()}}
    policy = policies.parse(document)
    run, log = folder / "run", folder / "log"
    run.mkdir(exist_ok=True)
    latch = Latch(run / "estop.json")
    ledger = Ledger(policy, run / "limits.json", clock)
    there = There()
    gate = Gate(policy, ledger, Audit.open(log), latch, there)  # type: ignore[arg-type]
    gate.patience = patience
    server.add_middleware(gate)
    await gate.arm(server)
    try:
        yield Gated(server, gate, latch, ledger, there, folder)
    finally:
        gate.disarm()
        sys.stderr.flush()
