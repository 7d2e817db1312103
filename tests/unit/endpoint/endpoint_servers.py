"""Servers in the shape that SERVE asks for, good and bad, and a folder of tiny wheels."""

import base64
import hashlib
import os
import shutil
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from launched import policy_of

from octoform.endpoint.environment.model import Environment
from octoform.endpoint.publication import Service, write_endpoint
from octoform.state.layout import Layout

RUNTIME = Path(__file__).parents[3] / "octoform" / "runtime"

HEADER = '''# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp>=4.1,<4.2"]
# ///
"""A server of two tools."""

from fastmcp import FastMCP
from fastmcp.exceptions import ToolError
from fastmcp.tools.base import ToolResult
from fastmcp.utilities.types import Image

import runtime

mcp = FastMCP("bench")
READ = {"readOnlyHint": True, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}


@mcp.tool(annotations=READ)
@runtime.logged
def read_clock() -> dict[str, str]:
    """The time of the clock."""
    return {"time": "2026-01-01T00:00:00Z"}
'''

CLOCK: dict[str, Any] = {
    "name": "read_clock",
    "effect": "read",
    "input_schema": {"type": "object", "properties": {}, "additionalProperties": False},
}
VOLTAGE: dict[str, Any] = {
    "name": "read_voltage",
    "effect": "read",
    "input_schema": {
        "type": "object",
        "properties": {"channel": {"type": "integer", "minimum": 1, "maximum": 8, "description": "1 to 8"}},
        "required": ["channel"],
    },
}


def tool(body: str, *, name: str = "read_voltage", head: str = "", logged: bool = True, returns: str = "float") -> str:
    """The text of a second tool with this body; ``head`` are its parameters."""
    lines = [
        "@mcp.tool(annotations=READ)",
        *(["@runtime.logged"] if logged else []),
        f"def {name}({head}) -> {returns}:",
        '    """A voltage, in volts."""',
        *(f"    {line}" for line in body.splitlines()),
    ]
    return "\n\n" + "\n".join(lines) + "\n"


GOOD = HEADER + tool("return channel * 1.5", head="channel: int")


def lay_out(folder: Path, source: str) -> Path:
    """server.py with the real runtime beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "server.py").write_text(source, encoding="utf-8")
    shutil.copytree(RUNTIME, folder / "runtime", ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True)
    return folder


def service_of(tools: Sequence[dict[str, Any]]) -> Service:
    """These tools on a pipe, everything allowed."""
    lines = [{"devices": [], **tool} for tool in tools]
    return Service(lines, policy_of(lines))


def publish(layout: Layout, environment: Environment, source: str = GOOD, *tools: dict[str, Any]) -> dict[str, Any]:
    """Put the server into the state folder, write its endpoint, give the INTERFACE artifact."""
    interface: dict[str, Any] = {"format": 1, "tools": list(tools or (CLOCK, VOLTAGE)), "left_out": []}
    lay_out(layout.output("serve").parent, source)
    problems = write_endpoint(layout, environment, service_of(interface["tools"]), {})
    assert not problems
    return interface


def processes_of(layout: Layout) -> list[str]:
    """Command lines of live processes that name this project."""
    needle = os.fsencode(str(layout.project))
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and entry.name != str(os.getpid()):
            try:
                line = (entry / "cmdline").read_bytes()
            except OSError:
                continue
            if needle in line:
                found.append(line.decode(errors="replace"))
    return found


class Wheelhouse:
    """Writes wheels of pure-Python packages into a folder that stands for an index."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True)
        self.folder = folder

    def add(self, name: str, version: str, *requires: str) -> Path:
        """A package with one empty module; ``requires`` are its dependencies."""
        metadata = [
            f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}",
            *(f"Requires-Dist: {r}" for r in requires),
        ]
        info = f"{name}-{version}.dist-info"
        files = {
            f"{name}.py": f"VERSION = {version!r}\n",
            f"{info}/METADATA": "\n".join(metadata) + "\n",
            f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: tests\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        }
        record = [f"{path},sha256={_hash(text)},{len(text)}" for path, text in files.items()]
        files[f"{info}/RECORD"] = "\n".join([*record, f"{info}/RECORD,,"]) + "\n"
        wheel = self.folder / f"{name}-{version}-py3-none-any.whl"
        with zipfile.ZipFile(wheel, "w") as archive:
            for path, text in files.items():
                archive.writestr(path, text)
        return wheel


def _hash(text: str) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b"=").decode()
