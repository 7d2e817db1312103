"""A client that stays connected over a case, by the command that every client is given, and what it may count on.

Whatever becomes of the endpoint, its client is not dropped, and a tool that has not changed has its schema and works.
"""

import json
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from anyio.from_thread import start_blocking_portal
from fastmcp import Client
from fastmcp.client.transports import StdioTransport

SECONDS = 30.0


class Connected:
    """A session that is open until `close`."""

    def __init__(self, endpoint: Path) -> None:
        self._open = ExitStack()
        program, *arguments = json.loads((endpoint / "connection.json").read_bytes())["command"]
        self._portal = self._open.enter_context(start_blocking_portal())
        client = Client(StdioTransport(program, arguments), timeout=SECONDS)
        self._client: Any = self._open.enter_context(self._portal.wrap_async_context_manager(client))

    def tools(self) -> dict[str, dict[str, Any]]:
        """Input schema by name, as this session lists them now."""
        return {tool.name: dict(schema_of(tool)) for tool in self._portal.call(self._client.list_tools)}

    def works(self, tool: str, arguments: dict[str, Any]) -> bool:
        """Whether a call succeeds."""

        async def call() -> bool:
            return not (await self._client.call_tool(tool, arguments, raise_on_error=False)).is_error

        return bool(self._portal.call(call))

    def close(self) -> None:
        """End the session."""
        self._open.close()


def schema_of(tool: Any) -> dict[str, Any]:
    """Its input schema, whatever the version of the SDK calls it."""
    found = tool.model_dump(by_alias=True)
    return dict(found["inputSchema"])
