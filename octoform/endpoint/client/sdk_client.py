"""Send the serving environment's own MCP client on one errand to the running endpoint; read what it brings back."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from octoform.base.files import parse
from octoform.endpoint.bounded_program import Finished, ForkServer, run, serving_environment
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.environment.model import Environment, at
from octoform.endpoint.publication import client_command
from octoform.endpoint.published_files import read_manifest
from octoform.records import dataclass
from octoform.state.layout import Layout

SCRIPT = Path(__file__).parents[1] / "scripts" / "mcp_client.py"
START_SECONDS = 120.0
"""For a server's start on a small board; a second or two elsewhere."""
_MARGIN = 10.0
REFUSAL = "octoform: refused:"


@dataclass(frozen=True, slots=True)
class ClientReport:
    """The client's observations; ``tools`` and ``calls`` in the form that scripts/mcp_client.py describes."""

    answered: bool
    error: str | None
    protocol: str | None
    server: dict[str, Any] | None
    tools: list[dict[str, Any]]
    calls: list[dict[str, Any]]
    seconds: float
    survivors: int
    log: str


def recorded_environment(layout: Layout) -> Environment | None:
    """The environment that the applied endpoint names, or None when nothing (whole) is applied."""
    manifest = read_manifest(layout)
    return at(Path(str(manifest["environment"]))) if manifest and "environment" in manifest else None


def converse(
    layout: Layout,
    environment: Environment,
    calls: Sequence[ToolCall] = (),
    *,
    again: int = 0,
    mode: str = "auto",
    seconds: float = math.inf,
) -> ClientReport:
    """Connect as any client does, list the tools, make the calls; blocks until the client is gone again.

    Each call is made ``again`` so often, after all others, where it was answered at once with numbers and no picture.
    ``mode`` is ``auto`` (the newest protocol first) or ``legacy`` (the handshake). After ``seconds`` the client is
    ended, whatever it has come to.
    """
    task = {
        "command": client_command(layout),
        "mode": mode,
        "start_seconds": START_SECONDS,
        "calls": [
            {"tool": call.tool, "arguments": dict(call.arguments), "seconds": call.seconds, "again": again}
            for call in calls
        ],
    }
    timeout = START_SECONDS + _MARGIN + sum(call.seconds * (1 + again) for call in calls)
    finished = run(
        [str(environment.python), "-I", str(SCRIPT)],
        cwd=layout.project,
        environment=serving_environment(),
        timeout=min(timeout, seconds),
        stdin=json.dumps(task),
        fork_server=ForkServer.at(environment.python),
    )
    return _report_of(finished)


def _report_of(finished: Finished) -> ClientReport:
    log = finished.stderr[-4000:]
    try:
        value = parse(finished.stdout)
    except ValueError:
        reason = "the client gave up" if finished.timed_out else _last_line(log) or f"exit status {finished.status}"
        value = {"answered": False, "error": reason, "protocol": None, "server": None, "tools": [], "calls": []}
    if not value["answered"]:
        value["error"] = _refusal(log) or value["error"]
    return ClientReport(**value, seconds=finished.seconds, survivors=finished.survivors, log=log)


def _refusal(log: str) -> str | None:
    """The launcher's own sentence, when it refused to serve."""
    lines = [line.removeprefix(REFUSAL).strip() for line in log.splitlines() if line.startswith(REFUSAL)]
    return lines[0] if lines else None


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1][:500] if lines else ""
