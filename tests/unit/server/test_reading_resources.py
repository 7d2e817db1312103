"""What can be read: the inventory, the latest pictures, who may, and what happens when there is none."""

import base64
import json
from typing import Any

import pytest
from fastmcp import Client
from mcp.shared.exceptions import MCPError
from offered import ERAS, PICTURE, offered, picture, policy_of

from octoform.server import catalog, resources
from octoform.server.process.principal import Principal


async def content(client: Any, uri: str) -> Any:
    return (await client.read_resource(uri))[0]


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_the_inventory_says_what_there_is_and_whether_it_is_there(era: str) -> None:
    server, offer = offered(policy_of(deny=["move_rail"]))
    offer.presence._there.update({"usb-046d-0825": False})

    async with Client(server, mode=era) as client:
        shown = [str(each.uri) for each in await client.list_resources()]
        read = await content(client, "octoform://devices")

    assert shown == ["octoform://devices"]
    assert read.mime_type == "application/json"
    assert json.loads(read.text) == {
        "devices": [
            {
                "id": "hwmon-nct6775",
                "name": "Nuvoton NCT6775",
                "category": "sensor",
                "present": "unknown",
                "tools": ["read_temperature"],
            },
            {
                "id": "usb-046d-0825",
                "name": "C270 HD Webcam",
                "category": "camera",
                "present": False,
                "tools": ["capture_image"],
            },
        ]
    }


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_the_latest_picture_of_a_tool_can_be_read_again(era: str) -> None:
    server, offer = offered()
    offer.frames.keep("capture_image", picture(b"older"))
    offer.frames.keep("capture_image", picture(words="two pictures, the last counts"))

    async with Client(server, mode=era) as client:
        shown = {str(each.uri): each for each in await client.list_resources()}
        read = await content(client, "octoform://frames/capture_image")

    assert shown["octoform://frames/capture_image"].mime_type == "image/png"
    assert base64.b64decode(read.blob) == PICTURE
    assert read.mime_type == "image/png"


@pytest.mark.parametrize("uri", ["octoform://frames/capture_image", "octoform://frames/no_such", "octoform://other"])
@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_what_is_not_there_is_refused_with_a_sentence(era: str, uri: str) -> None:
    server, offer = offered()
    offer.frames.keep("capture_image", picture(b"x" * (resources.FRAME_BYTES + 3)))

    async with Client(server, mode=era) as client:
        with pytest.raises(MCPError, match=uri) as refused:
            await client.read_resource(uri)

    assert refused.value.error.code == -32602


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_a_token_that_may_not_read_sees_nothing(era: str, monkeypatch: pytest.MonkeyPatch) -> None:
    actor = Principal("actor", frozenset({"actuate"}), "http")
    monkeypatch.setattr(resources, "current", lambda: actor)
    monkeypatch.setattr(catalog, "current", lambda: actor)
    server, offer = offered()
    offer.frames.keep("capture_image", picture())

    async with Client(server, mode=era) as client:
        assert await client.list_resources() == []
        assert await client.list_resource_templates() == []
        for uri in ("octoform://devices", "octoform://frames/capture_image", "sensor://own"):
            with pytest.raises(MCPError, match="for this token"):
                await client.read_resource(uri)


@pytest.mark.anyio
async def test_the_picture_of_a_hidden_tool_is_hidden_too() -> None:
    server, offer = offered(policy_of(deny=["capture_image"]))
    offer.frames.keep("capture_image", picture())

    async with Client(server) as client:
        assert "octoform://frames/capture_image" not in [str(each.uri) for each in await client.list_resources()]
        with pytest.raises(MCPError, match="there is no picture"):
            await client.read_resource("octoform://frames/capture_image")
