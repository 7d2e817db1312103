"""Programs of the system that tools need and this host lacks, also where what was accepted has been damaged since."""

import json
from typing import Any

import pytest

from octoform.endpoint.environment.system_programs import missing_programs
from octoform.state.layout import Layout

PROGRAM = "octoform-no-such-program"
SERVER = f"""
import subprocess

from fastmcp import FastMCP

mcp = FastMCP("bench")


@mcp.tool
def read_state() -> str:
    return subprocess.run(["{PROGRAM}"], capture_output=True, text=True, timeout=5).stdout
"""
INTERFACE: dict[str, Any] = {"tools": [{"name": "read_state", "description": f"Read the state by {PROGRAM}."}]}


def accepted(layout: Layout, server: str, interface: str) -> Layout:
    for stage, text in (("serve", server), ("interface", interface)):
        layout.output(stage).parent.mkdir(parents=True, exist_ok=True)
        layout.output(stage).write_text(text)
    return layout


def test_a_program_that_is_not_here_is_named_with_the_tools_that_need_it(layout: Layout) -> None:
    assert missing_programs(accepted(layout, SERVER, json.dumps(INTERFACE)), {}) == {PROGRAM: ["read_state"]}


@pytest.mark.parametrize("server", ["", "def", "(" * 300, "x = 1\0", "\ud7ff = ''"], ids=range(5))
def test_a_server_that_is_no_python_any_more_needs_none(layout: Layout, server: str) -> None:
    assert missing_programs(accepted(layout, server, json.dumps(INTERFACE)), {}) == {}


@pytest.mark.parametrize(
    "interface",
    ["", "[" * 1000, "7", "[]", '{"tools": 7}', '{"tools": [7]}', '{"tools": [{"name": "read_state"}]}',
     '{"tools": [{"name": ["read_state"], "description": 7}]}'],
    ids=range(8),
)  # fmt: skip
def test_an_interface_that_is_none_any_more_names_none(layout: Layout, interface: str) -> None:
    assert missing_programs(accepted(layout, SERVER, interface), {}) == {}
