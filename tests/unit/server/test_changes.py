"""That clients of both eras hear of changes: once, only what they asked for, and none of them holds up another."""

import gc
from functools import partial
from typing import Any

import anyio
import pytest
from fastmcp import Client
from mcp.client.subscriptions import listen
from mcp.shared.exceptions import MCPError
from mcp_types import (
    EmptyResult,
    SubscribeRequest,
    SubscribeRequestParams,
    UnsubscribeRequest,
    UnsubscribeRequestParams,
)
from offered import DEVICES, ERAS, heard_all, hearing, offered, picture

from octoform.server import catalog, notifications
from octoform.server.process.principal import Principal

FRAME = "octoform://frames/capture_image"


@pytest.fixture
def anyio_backend() -> str:
    return "asyncio"


async def subscribe(client: Any, uri: str) -> None:
    await client.session.send_request(SubscribeRequest(params=SubscribeRequestParams(uri=uri)), EmptyResult)


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_a_device_that_goes_is_told_to_who_listens(era: str) -> None:
    server, offer = offered()
    async with hearing(partial(Client, server), era, "octoform://devices") as (_, heard):
        await anyio.to_thread.run_sync(offer.presence._on_change, frozenset({DEVICES[0]["id"]}))

        await heard_all(heard, [("tools", ""), ("updated", "octoform://devices")])


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_a_new_picture_is_told_to_its_subscribers_and_the_first_one_to_all(era: str) -> None:
    server, offer = offered()
    async with (
        hearing(partial(Client, server), era, FRAME) as (_, subscriber),
        hearing(partial(Client, server), era) as (_, other),
    ):
        offer.frames.keep("capture_image", picture())
        await heard_all(subscriber, [("resources", ""), ("updated", FRAME)])

        offer.frames.keep("capture_image", picture(b"newer"))
        await heard_all(subscriber, [("resources", ""), ("updated", FRAME), ("updated", FRAME)])
        await heard_all(other, [("resources", "")])


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_the_capabilities_say_so(era: str) -> None:
    server, _ = offered()
    async with Client(server, mode=era) as client:
        found = client.session.server_capabilities

    assert found.tools.list_changed is True
    assert found.prompts.list_changed is False
    assert (found.resources.list_changed, found.resources.subscribe) == (True, True)


@pytest.mark.anyio
async def test_what_is_no_longer_wanted_is_no_longer_told() -> None:
    server, offer = offered()
    async with hearing(partial(Client, server), "legacy", FRAME, "octoform://devices") as (client, heard):
        gone = UnsubscribeRequest(params=UnsubscribeRequestParams(uri=FRAME))
        await client.session.send_request(gone, EmptyResult)
        offer.changes.updated(FRAME)
        offer.changes.updated("octoform://devices")

        await heard_all(heard, [("updated", "octoform://devices")])


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_a_token_that_may_not_read_hears_of_no_resource(era: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notifications, "current", lambda: Principal("actor", frozenset({"actuate"}), "http"))
    server, offer = offered()
    if era == "legacy":
        async with Client(server, mode=era) as client:
            with pytest.raises(MCPError, match="may read no resource"):
                await subscribe(client, FRAME)
        return
    async with hearing(partial(Client, server), era, FRAME) as (_, heard):
        offer.frames.keep("capture_image", picture())
        offer.changes.tools()

        await heard_all(heard, [("tools", "")])


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.parametrize("tool", ["move_rail", "no_such_tool"])
@pytest.mark.anyio
async def test_pictures_of_a_tool_that_a_token_may_not_know_of_are_not_told(
    era: str, tool: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    guest = Principal("guest", frozenset({"read"}), "http")
    for module in (notifications, catalog):
        monkeypatch.setattr(module, "current", lambda: guest)
    server, offer = offered()
    offer.frames.keep(tool, picture())
    uri = f"octoform://frames/{tool}"
    if era == "legacy":
        async with Client(server, mode=era) as client:
            with pytest.raises(MCPError, match=f"there is no resource '{uri}'"):
                await subscribe(client, uri)
        return
    async with hearing(partial(Client, server), era, uri, FRAME) as (_, heard):
        offer.frames.keep(tool, picture(b"newer"))
        offer.changes.updated(FRAME)

        await heard_all(heard, [("updated", FRAME)])


@pytest.mark.anyio
async def test_subscriptions_are_bounded() -> None:
    server, _ = offered()
    uris = [f"octoform://other/{number}" for number in range(notifications.MAX_URIS + 1)]
    async with Client(server, mode="legacy") as client:
        for uri in uris[:-1]:
            await subscribe(client, uri)
        for uri in (uris[-1], "octoform://" + "x" * notifications.MAX_URI):
            with pytest.raises(MCPError, match="at most"):
                await subscribe(client, uri)
    async with Client(server) as client:
        with pytest.raises(MCPError, match="at most"):
            async with listen(client.session, resource_subscriptions=uris):
                pass


class Deaf:
    """A client's connection that takes nothing."""

    def __init__(self) -> None:
        self.tried = 0

    async def notify(self, method: str, params: object) -> None:
        self.tried += 1
        await anyio.sleep_forever()


@pytest.mark.anyio
async def test_a_client_that_does_not_read_holds_up_nobody_and_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notifications, "SECONDS", 0.05)
    server, offer = offered()
    deaf: Any = Deaf()
    async with hearing(partial(Client, server), "legacy") as (_, heard):
        offer.changes._clients.add(deaf)
        for _ in range(100):
            offer.changes.tools()
        await heard_all(heard, [("tools", "")])
        with anyio.fail_after(10):
            while deaf in offer.changes._clients:
                await anyio.sleep(0.01)
        offer.changes.tools()
        await heard_all(heard, [("tools", ""), ("tools", "")])

    assert deaf.tried == 1


@pytest.mark.anyio
async def test_clients_that_are_gone_are_forgotten() -> None:
    server, offer = offered()
    for _ in range(3):
        async with hearing(partial(Client, server), "legacy", FRAME):
            assert len(offer.changes._clients) == 1
        await anyio.sleep(0)
        gc.collect()
        assert len(offer.changes._clients) == 0
    assert len(offer.changes._wanted) == 0
    offer.changes.tools()
