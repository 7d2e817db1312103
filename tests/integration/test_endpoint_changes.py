"""That clients which are connected hear of what changes in the room: both eras, over the pipe and over HTTP."""

import asyncio
import json
from collections.abc import Iterator
from typing import Any

import pytest
from launched import LOOPBACK, Launched, launched, tool
from offered import ERAS, heard_all, hearing
from plugged import CAMERA, SENSOR, Host

from octoform.endpoint.access.tokens import create

FRAME = "octoform://frames/capture_image"
DEVICES = [
    {"id": CAMERA, "name": "C270 HD Webcam", "category": "camera"},
    {"id": SENSOR, "name": "AMD K10 temperature sensor", "category": "sensor"},
]
TOOLS = [
    tool("capture_image", "read", CAMERA),
    tool("read_temperature", "read", SENSOR),
    tool("move_rail", "actuate", CAMERA),
]
SOURCE = '''
import runtime
from fastmcp import FastMCP
from fastmcp.tools import ToolResult
from fastmcp.utilities.types import Image

mcp = FastMCP("bench")


@mcp.tool
@runtime.logged
def read_temperature() -> float:
    """Read the temperature in degrees Celsius."""
    return 21.5


@mcp.tool
@runtime.logged
def move_rail() -> str:
    """Move the rail."""
    return "moved"


@mcp.tool
@runtime.logged
def capture_image() -> ToolResult:
    """Take one picture."""
    return ToolResult(content=[Image(data=b"\\x89PNG picture", format="png")], structured_content={"width": 2})
'''
TRANSPORTS = ("pipe", "http")


class Room:
    """An endpoint, and the host that it sees."""

    def __init__(self, endpoint: Launched, host: Host) -> None:
        self.endpoint = endpoint
        self.host = host

    def client(self, transport: str) -> Any:
        """What makes a client over a transport."""
        return self.endpoint.client if transport == "pipe" else self.endpoint.http_client


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Room]:
    folder = tmp_path_factory.mktemp("room")
    host = Host(folder / "root")
    host.plug(CAMERA, SENSOR)
    environ = {"OCTOFORM_SYSROOT": str(host.root)}
    with launched(folder, SOURCE, TOOLS, network=LOOPBACK, devices=DEVICES, environ=environ) as endpoint:
        yield Room(endpoint, host)


async def tools_of(client: Any) -> dict[str, Any]:
    return {each.name: each for each in await client.list_tools()}


async def inventory(client: Any) -> dict[str, Any]:
    read = (await client.read_resource("octoform://devices"))[0]
    return {device["id"]: device for device in json.loads(read.text)["devices"]}


@pytest.mark.parametrize("transport", TRANSPORTS)
@pytest.mark.parametrize("era", ERAS)
def test_a_device_that_goes_and_comes_is_told_and_named(room: Room, transport: str, era: str) -> None:
    change = [("tools", ""), ("updated", "octoform://devices")]

    async def watch() -> None:
        async with hearing(room.client(transport), era, "octoform://devices") as (client, heard):
            while (await inventory(client))[CAMERA]["present"] is not True:
                await asyncio.sleep(0.05)
            heard.clear()
            room.host.unplug_camera()
            await heard_all(heard, change)

            tools = await tools_of(client)
            refused = await client.call_tool("capture_image", {}, raise_on_error=False)
            assert (await inventory(client))[CAMERA]["present"] is False

            room.host.plug(CAMERA)
            await heard_all(heard, change * 2)
            again = await client.call_tool("capture_image", {}, raise_on_error=False)

        assert sorted(tools) == ["capture_image", "move_rail", "read_temperature"]
        assert tools["capture_image"].description == "[device absent: C270 HD Webcam] Take one picture."
        assert tools["capture_image"].meta["octoform/absent"] == ["C270 HD Webcam"]
        assert tools["read_temperature"].description == "Read the temperature in degrees Celsius."
        assert refused.is_error
        assert "C270 HD Webcam" in refused.content[0].text
        assert not again.is_error

    asyncio.run(asyncio.wait_for(watch(), 60))


@pytest.mark.parametrize("transport", TRANSPORTS)
@pytest.mark.parametrize("era", ERAS)
def test_a_picture_that_one_client_took_can_be_read_by_another(room: Room, transport: str, era: str) -> None:
    async def watch() -> None:
        async with hearing(room.client(transport), era, FRAME) as (client, heard):
            async with room.endpoint.client() as other:
                taken = await other.call_tool("capture_image", {})
            while ("updated", FRAME) not in heard:
                await asyncio.sleep(0.01)
            shown = [str(each.uri) for each in await client.list_resources()]
            read = (await client.read_resource(FRAME))[0]

        assert shown == ["octoform://devices", FRAME]
        assert (read.blob, read.mime_type) == (taken.content[0].data, "image/png")
        assert taken.structured_content == {"width": 2}

    asyncio.run(asyncio.wait_for(watch(), 60))


@pytest.mark.parametrize("era", ERAS)
def test_a_token_sees_what_its_effect_classes_allow(room: Room, era: str) -> None:
    async def look(effects: list[str]) -> tuple[list[str], list[str]]:
        made, problems = create(room.endpoint.layout, f"{era}-{'-'.join(effects)}", effects, None)
        assert made is not None, problems
        async with room.endpoint.http_client(era, token=made.value) as client:
            return sorted(await tools_of(client)), [str(each.uri) for each in await client.list_resources()]

    reading = asyncio.run(look(["read"]))
    acting = asyncio.run(look(["actuate"]))

    assert reading[0] == ["capture_image", "read_temperature"]
    assert "octoform://devices" in reading[1]
    assert acting == (["move_rail"], [])
