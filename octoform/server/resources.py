"""MCP resources, readable without a call: the inventory of devices, and the latest picture of each tool.

A picture costs a camera's time and moves a lot of bytes; a client that only wants to look again at what was seen reads
it here. Pictures are kept in memory alone, one for each tool, so nothing of the room reaches the disk.
"""

import base64
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from fastmcp.resources import ResourceContent, ResourceResult, ResourceTemplate, TextResource
from fastmcp.resources.base import Resource
from fastmcp.server.middleware import CallNext, Middleware, MiddlewareContext
from mcp.shared.exceptions import MCPError
from mcp_types import (
    INVALID_PARAMS,
    ImageContent,
    ListResourcesRequest,
    ListResourceTemplatesRequest,
    ReadResourceRequestParams,
)
from pydantic import AnyUrl

from octoform.base.clock import stamp
from octoform.base.escaping import display
from octoform.server.notifications import Changes
from octoform.server.process.device_presence import Presence
from octoform.server.process.principal import current

DEVICES = "octoform://devices"
FRAMES = "octoform://frames/"
FRAME_BYTES = 5_000_000
"""The largest picture that is kept."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A picture as a tool gave it, and when (UTC)."""

    data: bytes
    mime_type: str
    taken: datetime


class Frames:
    """The latest picture of each tool."""

    def __init__(self, changes: Changes, now: Callable[[], datetime] = lambda: datetime.now(UTC)) -> None:
        self._changes = changes
        self._now = now
        self._frames: dict[str, Frame] = {}

    def keep(self, tool: str, result: Any) -> None:
        """Remember the last picture in a tool's result, unless it is too large; subscribers are notified."""
        pictures = [part for part in getattr(result, "content", None) or () if isinstance(part, ImageContent)]
        if not pictures or len(pictures[-1].data) > FRAME_BYTES * 4 // 3 + 4:
            return
        try:
            data = base64.b64decode(pictures[-1].data, validate=True)
        except ValueError:  # the client's own check reports it; there is no picture to keep
            return
        first = tool not in self._frames
        self._frames[tool] = Frame(data, pictures[-1].mime_type, self._now())
        if first:
            self._changes.resources()
        self._changes.updated(FRAMES + tool)

    def latest(self, tool: str) -> Frame | None:
        """The latest picture; None when there is none yet."""
        return self._frames.get(tool)

    def all(self) -> dict[str, Frame]:
        """The latest pictures by tool."""
        return dict(self._frames)


class Resources(Middleware):
    """Serves them beside the generated server's own. ``visible`` states which tools the caller is shown."""

    def __init__(
        self,
        devices: Iterable[Mapping[str, Any]],
        tools: Iterable[Mapping[str, Any]],
        presence: Presence,
        frames: Frames,
        visible: Callable[[str], bool],
    ) -> None:
        self._devices = sorted(devices, key=lambda device: str(device["id"]))
        self._tools = {tool["name"]: tuple(tool.get("devices") or ()) for tool in tools}
        self._presence = presence
        self._frames = frames
        self._visible = visible

    async def __call__(self, context: MiddlewareContext[Any], call_next: CallNext[Any, Any]) -> Any:
        """Straight to the point: the general way builds three wrappers for each message."""
        if context.method == "resources/list":
            return await self.on_list_resources(context, call_next)
        if context.method == "resources/templates/list":
            return await self.on_list_resource_templates(context, call_next)
        if isinstance(context.message, ReadResourceRequestParams):
            return await self.on_read_resource(context, call_next)
        return await call_next(context)

    async def on_list_resources(
        self,
        context: MiddlewareContext[ListResourcesRequest],
        call_next: CallNext[ListResourcesRequest, Sequence[Resource]],
    ) -> Sequence[Resource]:
        """Those that the caller may read, by URI."""
        if "read" not in current().effects:
            return []
        kept = {tool: frame for tool, frame in self._frames.all().items() if self._visible(tool)}
        own = [_inventory_resource(), *(_frame_resource(tool, frame) for tool, frame in kept.items())]
        return sorted([*own, *await call_next(context)], key=lambda resource: str(resource.uri))

    async def on_list_resource_templates(
        self,
        context: MiddlewareContext[ListResourceTemplatesRequest],
        call_next: CallNext[ListResourceTemplatesRequest, Sequence[ResourceTemplate]],
    ) -> Sequence[ResourceTemplate]:
        """The generated server's own; none for a caller that may not read."""
        return await call_next(context) if "read" in current().effects else []

    async def on_read_resource(
        self,
        context: MiddlewareContext[ReadResourceRequestParams],
        call_next: CallNext[ReadResourceRequestParams, ResourceResult],
    ) -> ResourceResult:
        """The content of one; -32602 with a sentence when there is none."""
        uri = str(context.message.uri)
        if "read" not in current().effects:
            raise _missing(uri, f"there is no resource {display(uri)} for this token")
        if uri == DEVICES:
            return ResourceResult([ResourceContent(json.dumps(self._inventory()), "application/json")])
        if not uri.startswith(FRAMES):
            return await call_next(context)
        tool = uri.removeprefix(FRAMES)
        frame = self._frames.latest(tool) if self._visible(tool) else None
        if frame is None:
            raise _missing(uri, f"there is no picture at {display(uri)}; a tool that takes one has to be called first")
        return ResourceResult([ResourceContent(frame.data, frame.mime_type, {"octoform/taken": _time(frame)})])

    def _inventory(self) -> dict[str, Any]:
        return {"devices": [self._device(device) for device in self._devices]}

    def _device(self, device: Mapping[str, Any]) -> dict[str, Any]:
        there = self._presence.present(device["id"])
        tools = sorted(name for name, devices in self._tools.items() if device["id"] in devices and self._visible(name))
        return {
            "id": device["id"],
            "name": device.get("name"),
            "category": device.get("category"),
            "present": "unknown" if there is None else there,
            "tools": tools,
        }


def _missing(uri: str, text: str) -> MCPError:
    return MCPError(code=INVALID_PARAMS, message=text, data={"uri": uri})


def _time(frame: Frame) -> str:
    return stamp(frame.taken, 3)


def _frame_resource(tool: str, frame: Frame) -> Resource:
    return TextResource(
        uri=AnyUrl(FRAMES + tool),
        name=f"frame_{tool}",
        title=f"Latest picture of {tool}",
        description=f"The latest picture that {tool} gave to any client; reading it takes no new one.",
        mime_type=frame.mime_type,
        text="",
    )


def _inventory_resource() -> Resource:
    return TextResource(
        uri=AnyUrl(DEVICES),
        name="devices",
        title="Devices",
        description="The devices of this host: what they are, whether they are there now, and which tools use them.",
        mime_type="application/json",
        text="",
    )
