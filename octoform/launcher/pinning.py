"""What runs is what was judged: the tool under guard, not whatever a second look by name would find.

FastMCP looks a tool up by name for every call, through all providers and transforms, and for a call of the newer era
once more through the whole list, to see which headers it asks for. Both questions have the same answer every time for
a server that registers its tools as it is loaded, so they are answered from what was worked out then. Where a server
changes what it shows while it runs, FastMCP is asked as ever.
"""

from collections.abc import Mapping
from typing import Any

from fastmcp.tools.base import Tool

from . import principal
from .entries import Entries
from .guarding import current


def pin(server: Any, entries: Entries) -> None:
    """Answer the server's questions for a tool of the running call, and for input schemas, from the entries."""
    lookup = server.get_tool

    async def get_tool(name: str, version: Any = None) -> Tool | None:
        work = current.get()
        pinned = work.pinned if work is not None and work.tool == name else None
        if pinned is not None and _steady(server) and server.local_provider._components.get(pinned.key) is pinned:
            return pinned
        found: Tool | None = await lookup(name, version)
        return found

    def input_schema(name: str) -> Mapping[str, Any] | None:
        entry = entries.get(name)
        visible = entry is not None and entry.policy.effect in principal.current().effects
        return entry.schema if entry is not None and visible else None

    server.get_tool = get_tool
    server._mcp_server.get_tool_input_schema = input_schema


def _steady(server: Any) -> bool:
    """Whether the server has nothing between a name and its tool."""
    return not server._transforms and len(server.providers) == 1 and not server.local_provider._transforms
