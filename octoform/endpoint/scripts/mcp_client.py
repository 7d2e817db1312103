"""A real MCP client for one errand: start the launcher, list its tools, call some, report all of it.

Run as ``python -I mcp_client.py`` with one JSON object on stdin::

    {"command": ["..."], "mode": "auto" | "legacy", "start_seconds": 30.0, "calls":
     [{"tool": "...", "arguments": {}, "seconds": 15.0, "again": 2}]}

One JSON object on stdout: ``{"answered", "error", "protocol", "server", "tools", "calls"}``; each call is
``{"tool", "arguments", "is_error", "problem", "field", "refused", "message", "structured", "pictures", "ms", "again"}``
where ``problem`` is null, ``unknown_tool``, ``bad_argument``, ``timeout``, ``output_schema`` or ``protocol``,
``refused`` is the gate's code when it did not let the tool begin, and ``again`` are the results of its repetitions.
"""

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import AsyncIterator
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import anyio
from fastmcp import Client
from fastmcp.client.transports.base import ClientTransport, TransportOptions
from mcp.server.stdio import stdio_server

sys.path.insert(0, str(Path(__file__).resolve().parent))

from picture import figures
from toolschema import as_tool, first_fault, result_text

PASSED = ("HOME", "LOGNAME", "PATH", "SHELL", "TERM", "USER")
"""The environment that the SDK's clients give a stdio server: a tool that needs more fails in a real client too."""
MARK = "OCTOFORM_RUN"
"""Lets the caller find whatever is left running."""
REFUSED = "octoform/refused"
"""By this the gate marks what it refused before the tool began."""
QUICK_MS = 1000.0
"""A call that is answered as fast is made again."""
CLOSE_SECONDS = 3.0
"""Seconds that a server has for its end after its stdin was closed."""


class StartedTransport(ClientTransport):
    """Speaks with a running process over its pipes; the process is ended with the session."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self.process = process

    @contextlib.asynccontextmanager
    async def connect_session(
        self, *, transport_options: TransportOptions | None = None, **session: Any
    ) -> AsyncIterator[Any]:
        """The SDK's own framing over the pipes, its own session above."""
        options = transport_options or TransportOptions()
        assert self.process.stdout is not None and self.process.stdin is not None
        incoming = anyio.wrap_file(TextIOWrapper(self.process.stdout, encoding="utf-8", errors="replace"))
        outgoing = anyio.wrap_file(TextIOWrapper(self.process.stdin, encoding="utf-8"))
        async with stdio_server(incoming, outgoing) as (read, write):
            try:
                async with options.session_class(read_stream=read, write_stream=write, **session) as client:
                    yield client
            finally:
                with anyio.CancelScope(shield=True):
                    await anyio.to_thread.run_sync(end, self.process)


def end(process: "subprocess.Popen[bytes]") -> None:
    """Close the server's stdin, as the protocol has it, and stop it when it does not go."""
    assert process.stdin is not None
    with contextlib.suppress(BrokenPipeError):
        process.stdin.close()
    try:
        process.wait(CLOSE_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


async def errand(task: dict[str, Any], process: "subprocess.Popen[bytes]") -> dict[str, Any]:
    """Connect, list, call; what fails is part of the answer."""
    report: dict[str, Any] = {
        "answered": False,
        "error": None,
        "protocol": None,
        "server": None,
        "tools": [],
        "calls": [],
    }
    seconds = task["start_seconds"]
    try:
        transport = StartedTransport(process)
        async with Client(transport, mode=task["mode"], init_timeout=seconds, timeout=seconds) as client:
            tools = await client.list_tools()
            info = client.server_info
            report.update(answered=True, protocol=client.protocol_version)
            report["server"] = {"name": info.name, "version": info.version} if info else None
            wire = [tool.model_dump(mode="json", by_alias=True, exclude_none=True) for tool in tools]
            report["tools"] = [as_tool(tool) for tool in wire]
            schemas = {tool["name"]: tool["inputSchema"] for tool in wire}
            for call in task["calls"]:
                report["calls"].append({**await one_call(client, call, schemas), "again": []})
            for turn in range(max((call.get("again", 0) for call in task["calls"]), default=0)):
                for call, answer in zip(task["calls"], report["calls"], strict=True):
                    if turn < call.get("again", 0) and is_quick(answer):
                        repeated = await one_call(client, call, schemas)
                        answer["again"].append(repeated["structured"])
    except Exception as problem:  # noqa: BLE001 - the answer is the only way to report to the caller
        report["error"] = f"{type(problem).__name__}: {problem}"[:1000]
    return report


def is_quick(answer: dict[str, Any]) -> bool:
    """Whether a call was answered at once, with numbers: then it costs nothing to see whether they move."""
    well = not answer["is_error"] and answer["problem"] is None and answer["refused"] is None
    return well and not answer["pictures"] and answer["ms"] < QUICK_MS and has_number(answer["structured"])


def has_number(value: Any) -> bool:
    """Whether a number stands anywhere in a result."""
    if isinstance(value, dict | list):
        return any(has_number(item) for item in (value.values() if isinstance(value, dict) else value))
    return isinstance(value, int | float) and not isinstance(value, bool)


async def one_call(client: Client[Any], call: dict[str, Any], schemas: dict[str, Any]) -> dict[str, Any]:
    """One call, its problem classified."""
    answer: dict[str, Any] = {
        "tool": call["tool"],
        "arguments": call["arguments"],
        "is_error": True,
        "problem": None,
        "field": None,
        "refused": None,
        "message": "",
        "structured": None,
        "pictures": [],
        "ms": 0.0,
    }
    schema = schemas.get(call["tool"])
    if schema is None:
        return {**answer, "problem": "unknown_tool"}
    arguments = call["arguments"]
    if fault := first_fault(arguments, schema):
        return {**answer, "problem": "bad_argument", **fault}
    started = time.monotonic()
    try:
        with anyio.fail_after(call["seconds"]):
            result = await client.call_tool_mcp(call["tool"], arguments, timeout=call["seconds"])
        wire = result.model_dump(mode="json", by_alias=True, exclude_none=True)
        answer.update(outcome(wire))
    except Exception as problem:  # noqa: BLE001 - classified and reported
        answer.update(problem=problem_kind(problem), message=str(problem)[:1000])
    answer["ms"] = round((time.monotonic() - started) * 1000, 1)
    return answer


def problem_kind(problem: Exception) -> str:
    """Which of the problems of the module's docstring an exception is."""
    text = str(problem)
    if isinstance(problem, TimeoutError) or "timed out" in text.lower():
        return "timeout"
    return "output_schema" if "structured content" in text.lower() or "output schema" in text.lower() else "protocol"


def outcome(wire: dict[str, Any]) -> dict[str, Any]:
    """The parts of a result; of pictures only what they look like."""
    return {
        "is_error": bool(wire.get("isError")),
        "refused": (wire.get("_meta") or {}).get(REFUSED),
        "message": result_text(wire),
        "structured": wire.get("structuredContent"),
        "pictures": [figures(item["data"]) for item in wire.get("content", []) if item.get("type") == "image"],
    }


def main() -> None:
    """Read the task, start the server, talk to it, print the report."""
    task: dict[str, Any] = json.load(sys.stdin)
    environment = {name: os.environ[name] for name in (*PASSED, MARK) if name in os.environ}
    process = subprocess.Popen(
        task["command"], env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    )
    json.dump(anyio.run(errand, task, process), sys.stdout)


if __name__ == "__main__":
    main()
