"""Everything that makes the endpoint good to talk to, put together around one server.

What a client is told (tools, resources) and when it is told anew (a device came or went, a picture was taken) hang
together; whether a call is let through is the gate's question and not asked here.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from .changes import Changes
from .listing import Listing
from .onlytools import only_tools
from .policy import Policy
from .presence import Presence
from .resources import DEVICES, FRAMES, Frames, Resources


@dataclass(frozen=True)
class Offer:
    """What the process runs and feeds: ``presence`` from start to stop, ``frames`` with every result of a call."""

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
