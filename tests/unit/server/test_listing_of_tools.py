"""The content of tools/list: order, hints, effect classes, absent devices, and what it leaves out."""

from typing import Any

import pytest
from fastmcp import Client
from offered import ERAS, TOOLS, offered, policy_of

from octoform.server import catalog
from octoform.server.process.principal import Principal

NAMES = sorted(tool["name"] for tool in TOOLS)


def reader() -> Principal:
    return Principal("monitor", frozenset({"read"}), "http")


async def listed(server: Any, era: str) -> list[Any]:
    async with Client(server, mode=era) as client:
        return list(await client.list_tools())


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_tools_come_by_name_and_say_all_there_is_to_say(era: str) -> None:
    server, _ = offered()

    tools = await listed(server, era)

    assert [tool.name for tool in tools] == NAMES
    by_name = {tool.name: tool for tool in tools}
    assert {name: tool.meta["octoform/effect"] for name, tool in by_name.items()} == {
        tool["name"]: tool["effect"] for tool in TOOLS
    }
    assert [tool.title for tool in tools] == ["Snap", "Format Disk", "Move Rail", "Read Temperature"]
    move = by_name["move_rail"].annotations
    assert (move.read_only_hint, move.destructive_hint, move.idempotent_hint, move.open_world_hint) == (
        False,
        False,
        True,
        False,
    )
    found = by_name["read_temperature"].annotations
    assert (found.read_only_hint, found.destructive_hint, found.idempotent_hint, found.open_world_hint) == (
        True,
        True,
        False,
        True,
    )
    assert by_name["read_temperature"].description == "Read all temperatures."
    assert "octoform/absent" not in by_name["read_temperature"].meta


@pytest.mark.anyio
async def test_schemas_stay_those_of_the_server() -> None:
    from offered import server_of_tools

    server, _ = offered()

    wrapped = {tool.name: tool for tool in await listed(server, "auto")}
    bare = {tool.name: tool for tool in await listed(server_of_tools(), "auto")}

    for name, tool in wrapped.items():
        assert tool.input_schema == bare[name].input_schema
        assert tool.output_schema == bare[name].output_schema


@pytest.mark.anyio
async def test_a_denied_tool_is_not_shown_but_in_shadow_mode_it_is() -> None:
    denied, _ = offered(policy_of(deny=["move_rail"]))
    shadow, _ = offered(policy_of("shadow", deny=["move_rail"]))

    assert [tool.name for tool in await listed(denied, "auto")] == [name for name in NAMES if name != "move_rail"]
    assert [tool.name for tool in await listed(shadow, "auto")] == NAMES


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_a_token_sees_the_tools_of_its_effect_classes_alone(era: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalog, "current", reader)
    server, _ = offered()

    assert [tool.name for tool in await listed(server, era)] == ["capture_image", "read_temperature"]


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_a_tool_whose_device_is_absent_names_it(era: str) -> None:
    server, offer = offered()
    offer.presence._there.update({"usb-046d-0825": False, "hwmon-nct6775": True})

    tools = {tool.name: tool for tool in await listed(server, era)}

    assert tools["move_rail"].description == "[device absent: C270 HD Webcam]"
    assert tools["move_rail"].meta["octoform/absent"] == ["C270 HD Webcam"]
    assert tools["read_temperature"].description == "Read all temperatures."
