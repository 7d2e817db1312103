"""A small server behind the launcher's offer (listing, resources, notifications), without a process around it."""

import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

import anyio
import pytest
from fastmcp import FastMCP
from fastmcp.tools.base import ToolResult
from fastmcp.utilities.types import Image
from mcp.client.subscriptions import listen
from mcp.shared.subscriptions import ResourcesListChanged, ResourceUpdated, ToolsListChanged
from mcp_types import (
    EmptyResult,
    ResourceListChangedNotification,
    ResourceUpdatedNotification,
    SubscribeRequest,
    SubscribeRequestParams,
    TextContent,
    ToolListChangedNotification,
)

from octoform.policy.published import Mode, Policy, ToolPolicy
from octoform.server.catalog import Offer, offer

ERAS = ("legacy", "auto")
PICTURE = b"\x89PNG\r\n\x1a\n" + bytes(range(200))
DEVICES = [
    {"id": "usb-046d-0825", "name": "C270 HD Webcam", "category": "camera"},
    {"id": "hwmon-nct6775", "name": "Nuvoton NCT6775", "category": "sensor"},
]
TOOLS: list[dict[str, Any]] = [
    {"name": "read_temperature", "effect": "read", "devices": ["hwmon-nct6775"], "annotations": {"readOnlyHint": True}},
    {"name": "capture_image", "effect": "read", "devices": ["usb-046d-0825"], "annotations": {}},
    {
        "name": "move_rail",
        "effect": "actuate",
        "devices": ["usb-046d-0825", "hwmon-nct6775"],
        "annotations": {
            "readOnlyHint": False,
            "destructiveHint": False,
            "idempotentHint": True,
            "openWorldHint": False,
        },
    },
    {"name": "format_disk", "effect": "irreversible", "devices": [], "annotations": {}},
]


def policy_of(mode: Mode = "enforce", deny: Sequence[str] = ()) -> Policy:
    """A policy over TOOLS that allows all but ``deny``."""
    return Policy(
        mode,
        {
            tool["name"]: ToolPolicy(tool["effect"], "deny" if tool["name"] in deny else "allow", "test", 30.0, 10**7)
            for tool in TOOLS
        },
    )


def server_of_tools() -> FastMCP:
    """A server with the tools of TOOLS, in an order that is not theirs, one more, and a resource of its own."""
    server: FastMCP = FastMCP("small")

    @server.tool(description="Read all temperatures.")
    def read_temperature(channel: int = 0) -> dict[str, float]:
        return {"value": 21.5}

    @server.tool(title="Snap")
    def capture_image() -> ToolResult:
        return ToolResult(content=[Image(data=PICTURE, format="png")], structured_content={"width": 2})

    @server.tool
    def move_rail(steps: int) -> int:
        return steps

    @server.tool
    def format_disk() -> str:
        return "done"

    @server.tool
    def not_in_the_policy() -> str:
        return "never shown"

    @server.resource("sensor://own", mime_type="text/plain")
    def own() -> str:
        return "of the server"

    return server


def offered(policy: Policy | None = None, **more: Any) -> tuple[FastMCP, Offer]:
    """That server with the offer around it."""
    server = server_of_tools()
    return server, offer(server, DEVICES, TOOLS, policy or policy_of(), **more)


def picture(data: bytes = PICTURE, words: str = "") -> ToolResult:
    """A tool's result with a picture in it."""
    text = [TextContent(type="text", text=words)] if words else []
    return ToolResult(content=[*text, Image(data=data, format="png").to_image_content()])


@contextmanager
def runtime_beside(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package ``runtime`` as a generated server finds it: beside itself."""
    folder.mkdir(exist_ok=True)
    (folder / "runtime").symlink_to(Path(__file__).parents[2] / "octoform" / "runtime")
    monkeypatch.syspath_prepend(str(folder))
    _forget_runtime()  # a server without one may have found the folder of its tests, which has this name too
    try:
        yield
    finally:
        _forget_runtime()


def _forget_runtime() -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == "runtime"]:
        del sys.modules[name]


def until(condition: Callable[[], object], seconds: float = 10.0) -> None:
    """Wait for a condition; fails when it does not come true."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not come true in time"
        time.sleep(0.01)


@asynccontextmanager
async def hearing(client: Callable[..., Any], era: str, *uris: str) -> AsyncIterator[tuple[Any, list[tuple[str, str]]]]:
    """A connected client and the notifications that it gets: ("tools" | "resources" | "updated", URI or "").

    ``client`` makes one (``mode=``, ``message_handler=``). ``uris`` are the resources that it subscribes to.
    """
    heard: list[tuple[str, str]] = []

    async def told(message: Any) -> None:
        if isinstance(message, ResourceUpdatedNotification):
            heard.append(("updated", str(message.params.uri)))
        elif isinstance(message, ToolListChangedNotification | ResourceListChangedNotification):
            heard.append(("tools" if isinstance(message, ToolListChangedNotification) else "resources", ""))

    async def read(stream: Any) -> None:
        async for event in stream:
            heard.append((_KINDS[type(event)], getattr(event, "uri", "")))

    # A client of the later era hands a stream's events to both.
    async with client(mode=era, message_handler=told if era == "legacy" else None) as connected:
        if era == "legacy":
            for uri in uris:
                await connected.session.send_request(
                    SubscribeRequest(params=SubscribeRequestParams(uri=uri)), EmptyResult
                )
            await connected.ping()  # answered after the server knows that the handshake is over
            yield connected, heard
            return
        listening = listen(
            connected.session, tools_list_changed=True, resources_list_changed=True, resource_subscriptions=uris
        )
        async with listening as stream, anyio.create_task_group() as group:
            group.start_soon(read, stream)
            yield connected, heard
            group.cancel_scope.cancel()


_KINDS = {ToolsListChanged: "tools", ResourcesListChanged: "resources", ResourceUpdated: "updated"}


async def heard_all(heard: list[tuple[str, str]], wanted: Sequence[tuple[str, str]], seconds: float = 10.0) -> None:
    """Wait until a client got all of ``wanted``, in any order and nothing else."""
    with anyio.move_on_after(seconds):
        while sorted(heard) != sorted(wanted):
            await anyio.sleep(0.01)
    assert sorted(heard) == sorted(wanted), heard
