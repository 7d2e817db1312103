"""Everything that makes the endpoint good to talk to, put together around one server.

What a client is notified (tools, resources) and when it is notified again (a device came or went, a picture was taken)
hang together; whether a call is let through is the gate's question and not asked here.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fastmcp import FastMCP
from fastmcp.prompts.base import Prompt
from fastmcp.resources import ResourceTemplate
from fastmcp.resources.base import Resource
from fastmcp.server.middleware import CallNext, Middleware, MiddlewareContext
from fastmcp.server.middleware.dereference import DereferenceRefsMiddleware
from fastmcp.tools.base import Tool
from mcp.shared.exceptions import MCPError
from mcp_types import (
    INVALID_PARAMS,
    GetPromptRequestParams,
    ListToolsRequest,
    ReadResourceRequestParams,
    ToolAnnotations,
)

from octoform.base.escaping import display, escaped
from octoform.policy.published import Policy
from octoform.server.internals import low_level, strip
from octoform.server.notifications import Changes
from octoform.server.process.device_presence import Presence
from octoform.server.process.principal import current
from octoform.server.resources import DEVICES, FRAMES, Frames, Resources

# The list of tools that a client gets: the same for everybody who may use them, in an order that never changes.
#
# The generated server declares what its tools take and give. Their effects are in the descriptor (all four
# hints, the effect class) and in what is plugged in now, and reaches the list here. A tool that may not be called at
# all is not shown: a model plans with what it sees.

EFFECT = "octoform/effect"
ABSENT = "octoform/absent"
WORST = {"readOnlyHint": False, "destructiveHint": True, "idempotentHint": False, "openWorldHint": True}
"""The protocol's defaults for a tool that declares nothing."""


class Listing(Middleware):
    """Rewrites tools/list. ``tools`` are the descriptor's."""

    def __init__(self, tools: Iterable[Mapping[str, Any]], policy: Policy, presence: Presence) -> None:
        self._tools = {tool["name"]: tool for tool in tools}
        self._policy = policy
        self._presence = presence

    def visible(self, name: str) -> bool:
        """Whether the caller of the current request is shown this tool."""
        policy = self._policy.tools.get(name)
        if policy is None or policy.effect not in current().effects:
            return False
        return policy.decision != "deny" or self._policy.mode == "shadow"

    async def __call__(self, context: MiddlewareContext[Any], call_next: CallNext[Any, Any]) -> Any:
        """Straight to the point: the general way builds three wrappers for each message."""
        if context.method == "tools/list":
            return await self.on_list_tools(context, call_next)
        return await call_next(context)

    async def on_list_tools(
        self,
        context: MiddlewareContext[ListToolsRequest],
        call_next: CallNext[ListToolsRequest, Sequence[Tool]],
    ) -> Sequence[Tool]:
        """The visible tools by name, each with annotations, effect class and the devices that are absent."""
        shown = [self._described(tool) for tool in await call_next(context) if self.visible(tool.name)]
        return sorted(shown, key=lambda tool: tool.name)

    def _described(self, tool: Tool) -> Tool:
        absent = self._presence.absent(tool.name)
        meta = {**(tool.meta or {}), EFFECT: self._policy.tools[tool.name].effect}
        description = tool.description or ""
        if absent:
            meta[ABSENT] = absent
            description = f"[device absent: {', '.join(absent)}] {description}".rstrip()
        title = tool.annotations.title if tool.annotations else None
        hints = WORST | dict(self._tools.get(tool.name, {}).get("annotations") or {})
        annotations = ToolAnnotations.model_validate({"title": title} | hints)
        return tool.model_copy(update={"annotations": annotations, "meta": meta, "description": description or None})


# Takes from the generated server everything that is no tool, because the gate stands before tools alone.
#
# Code behind a resource, a prompt or a completion would run without policy, audit log, lock, limit or timeout, with the
# emergency stop engaged, and for a token that may only read. Middleware of the generated code would stand before the
# gate. The contract of SERVE refuses such a server; this holds for one that was hidden from it.


def only_tools(server: Any) -> Middleware:
    """Strip a FastMCP server; the middleware given back belongs behind whatever offers resources of our own."""
    server.middleware[:] = [each for each in server.middleware if type(each) is DereferenceRefsMiddleware]
    # What a server answers that has nothing on it; completions and extensions come on top of that.
    strip(server, FastMCP("plain"))
    low_level(server).middleware.insert(0, _brief)
    return _Nothing()


MAX_REPEATED = 300
"""Characters of a client's own text that an error repeats: its sender knows it, and a log need not hold it twice."""


async def _brief(context: Any, call_next: Any) -> Any:
    """Bound what an error repeats of a request, such as the megabyte that was given as a method's name."""
    try:
        return await call_next(context)
    except MCPError as problem:
        if problem.error.data is not None:
            problem.error.data = _shortened(problem.error.data)
        raise


def _shortened(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _shortened(item) for name, item in value.items()}
    return escaped(value[:MAX_REPEATED]) if isinstance(value, str) else value


class _Nothing(Middleware):
    """Where the server's own resources and prompts would be there is nothing."""

    async def __call__(self, context: MiddlewareContext[Any], call_next: CallNext[Any, Any]) -> Any:
        """Straight to the point: the general way builds three wrappers for each message."""
        message = context.message
        if isinstance(message, ReadResourceRequestParams):
            uri = str(message.uri)
            raise MCPError(code=INVALID_PARAMS, message=f"there is no resource {display(uri)}", data={"uri": uri})
        if isinstance(message, GetPromptRequestParams):
            raise MCPError(code=INVALID_PARAMS, message=f"there is no prompt {display(message.name)}")
        if context.method in ("resources/list", "resources/templates/list", "prompts/list"):
            nothing: Sequence[Resource | ResourceTemplate | Prompt] = []
            return nothing
        return await call_next(context)


@dataclass(frozen=True)
class Offer:
    """The parts that the process runs: ``presence`` from start to stop, ``frames`` with every result of a call."""

    changes: Changes
    presence: Presence
    frames: Frames
    listing: Listing


def offer(
    server: Any, devices: Iterable[Mapping[str, Any]], tools: Iterable[Mapping[str, Any]], policy: Policy
) -> Offer:
    """Add listing, resources and notifications to a FastMCP server; devices and tools are the descriptor's.

    Of what the server has itself, its tools alone are left.
    """
    nothing_else = only_tools(server)

    def plugged(_: frozenset[str]) -> None:
        changes.tools()
        changes.updated(DEVICES)

    def readable(uri: str) -> bool:
        return not uri.startswith(FRAMES) or listing.visible(uri.removeprefix(FRAMES))

    devices, tools = list(devices), list(tools)
    presence = Presence(devices, tools, plugged)
    listing = Listing(tools, policy, presence)
    changes = Changes(server, readable)
    frames = Frames(changes)
    server.add_middleware(listing)
    server.add_middleware(Resources(devices, tools, presence, frames, listing.visible))
    server.add_middleware(nothing_else)
    return Offer(changes, presence, frames, listing)
