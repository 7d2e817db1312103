"""What a client is told about the tools: the same for everybody who may use them, in an order that never changes.

The generated server says what its tools take and give. What they mean for the room stands in the descriptor (all four
hints, the effect class) and in what is plugged in now, and reaches the list here. A tool that may not be called at all
is not shown: a model plans with what it sees.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from fastmcp.server.middleware import CallNext, Middleware, MiddlewareContext
from fastmcp.tools.base import Tool
from mcp_types import ListToolsRequest, ToolAnnotations

from .policy import Policy
from .presence import Presence
from .principal import current

EFFECT = "octoform/effect"
ABSENT = "octoform/absent"
WORST = {"readOnlyHint": False, "destructiveHint": True, "idempotentHint": False, "openWorldHint": True}
"""What the protocol assumes of a tool that says nothing."""


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
