"""What runs is what was judged: the tool under guard, not whatever a second look by name would find.

FastMCP looks a tool up by name for every call, through all providers and transforms, and for a call of the newer era
once more through the whole list, to see which headers it asks for. Both questions have the same answer every time for
a server that registers its tools as it is loaded, so they are answered from what was worked out then. Most tools need
nothing but their arguments; their function is called with the very values that were judged. Where a server changes what
it shows while it runs, or anything else stands before the tool, FastMCP is asked as ever.
"""

import inspect
from collections.abc import Mapping
from typing import Any

from fastmcp.tools.base import InputRequiredToolResult, Tool, ToolResult
from fastmcp.tools.function_tool import FunctionTool
from mcp_types import InputRequiredResult

from . import principal
from .entries import Entries
from .guarding import current
from .shapes import Effective


def pin(server: Any, entries: Entries) -> None:
    """Answer the server's questions for a tool of the running call, and for input schemas, from the entries."""
    lookup = server.get_tool

    async def get_tool(name: str, version: Any = None) -> Tool | None:
        work = current.get()
        pinned = work.pinned if work is not None and work.tool == name else None
        if pinned is not None and _steady(server, pinned):
            return pinned
        found: Tool | None = await lookup(name, version)
        return found

    def input_schema(name: str) -> Mapping[str, Any] | None:
        entry = entries.get(name)
        visible = entry is not None and entry.policy.effect in principal.current().effects
        return entry.schema if entry is not None and visible else None

    server.get_tool = get_tool
    server._mcp_server.get_tool_input_schema = input_schema


def innermost(server: Any, middleware: Any, tool: Tool) -> bool:
    """Whether nothing stands between this middleware and the tool."""
    return _steady(server, tool) and server.middleware[-1] is middleware and not server._extensions


async def straight(tool: FunctionTool, effective: Effective) -> ToolResult:
    """The result of a tool that needs nothing but its arguments, converted as FastMCP does."""
    value = tool.fn(*effective.args, **effective.kwargs)
    if inspect.isawaitable(value):
        value = await value
    if isinstance(value, InputRequiredResult):
        return InputRequiredToolResult(value)
    return tool.convert_result(value)


def _steady(server: Any, tool: Tool) -> bool:
    """Whether the server has nothing between a name and this tool, and still has it."""
    provider = server.local_provider
    plain = not server._transforms and len(server.providers) == 1 and not provider._transforms
    return plain and provider._components.get(tool.key) is tool
