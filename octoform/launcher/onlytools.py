"""Takes from the generated server everything that is no tool, because the gate stands before tools alone.

Code behind a resource, a prompt or a completion would run without policy, audit log, lock, limit or timeout, with the
emergency stop engaged, and for a token that may only read. Middleware of the generated code would stand before the
gate. The contract of SERVE refuses such a server; this holds for one that was hidden from it.
"""

from collections.abc import Sequence
from typing import Any

from fastmcp import FastMCP
from fastmcp.prompts.base import Prompt
from fastmcp.resources import ResourceTemplate
from fastmcp.resources.base import Resource
from fastmcp.server.middleware import CallNext, Middleware, MiddlewareContext
from fastmcp.server.middleware.dereference import DereferenceRefsMiddleware
from mcp.shared.exceptions import MCPError
from mcp_types import INVALID_PARAMS, GetPromptRequestParams, ReadResourceRequestParams


def only_tools(server: Any) -> Middleware:
    """Strip a FastMCP server; the middleware given back belongs behind whatever offers resources of our own."""
    server.middleware[:] = [each for each in server.middleware if type(each) is DereferenceRefsMiddleware]
    # What a server answers that has nothing on it; completions and extensions come on top of that.
    plain = FastMCP("plain")._mcp_server
    low_level = server._mcp_server
    for handlers, known in (
        (low_level._request_handlers, plain._request_handlers),
        (low_level._notification_handlers, plain._notification_handlers),
    ):
        for method in handlers.keys() - known.keys():
            del handlers[method]
    server._extensions.clear()
    return _Nothing()


class _Nothing(Middleware):
    """Where the server's own resources and prompts would be there is nothing."""

    async def __call__(self, context: MiddlewareContext[Any], call_next: CallNext[Any, Any]) -> Any:
        """Straight to the point: the general way builds three wrappers for each message."""
        message = context.message
        if isinstance(message, ReadResourceRequestParams):
            raise MCPError(
                code=INVALID_PARAMS, message=f"there is no resource {message.uri}", data={"uri": str(message.uri)}
            )
        if isinstance(message, GetPromptRequestParams):
            raise MCPError(code=INVALID_PARAMS, message=f"there is no prompt {message.name}")
        if context.method in ("resources/list", "resources/templates/list", "prompts/list"):
            nothing: Sequence[Resource | ResourceTemplate | Prompt] = []
            return nothing
        return await call_next(context)
