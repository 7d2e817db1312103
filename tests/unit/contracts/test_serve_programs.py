"""Which tools cannot do without a program of the system, and which have another way."""

import textwrap

from octoform.contracts.rules.serve.code_rules import programs_of, tools_starting

_SERVER = """
import shutil
import subprocess

from fastmcp import FastMCP

import runtime

mcp = FastMCP("bench")


def recorded(seconds):
    return subprocess.run(["arecord", "-d", str(seconds)], capture_output=True, timeout=30).stdout


@mcp.tool(annotations={})
@runtime.logged
def record_audio(seconds: int):
    return recorded(seconds)


@mcp.tool(annotations={})
@runtime.logged
def read_health():
    try:
        return subprocess.run(["smartctl", "-j"], capture_output=True, timeout=5).stdout
    except FileNotFoundError:
        raise ToolError("smartctl is missing")


@mcp.tool(annotations={})
@runtime.logged
def read_volume():
    if shutil.which("amixer"):
        said = subprocess.run(["amixer"], capture_output=True, timeout=5).stdout
    else:
        said = runtime.read_text(runtime.device("a").path("sound") / "volume")
    return said


@mcp.tool(annotations={})
@runtime.logged
def read_signal():
    try:
        return subprocess.run(["iw", "dev"], capture_output=True, timeout=5).stdout
    except OSError:
        return runtime.read_text(runtime.device("a").path("net") / "signal")
"""


def test_a_tool_needs_a_program_unless_it_has_another_way() -> None:
    text = textwrap.dedent(_SERVER)
    assert programs_of(text) == {"arecord", "smartctl", "amixer", "iw"}
    assert tools_starting(text) == {"arecord": ["record_audio"], "smartctl": ["read_health"]}
