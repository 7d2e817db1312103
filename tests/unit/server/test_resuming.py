"""What can be sent again to a client that lost its connection, and that it stays within its bound."""

from typing import Any

import pytest
from mcp_types import JSONRPCResponse

from octoform.server.transport import http
from octoform.server.transport.http import Recent

pytestmark = pytest.mark.anyio


@pytest.fixture
def anyio_backend() -> str:
    return "asyncio"


def answer(number: int, text: str = "") -> JSONRPCResponse:
    return JSONRPCResponse(jsonrpc="2.0", id=number, result={"text": text})


async def replayed(store: Recent, after: str) -> tuple[str | None, list[Any]]:
    sent: list[Any] = []

    async def send(event: Any) -> None:
        sent.append((event.event_id, event.message.id))

    return await store.replay_events_after(after, send), sent


async def test_what_came_later_in_the_same_stream_is_sent_again() -> None:
    store = Recent()
    first = await store.store_event("one", None)
    await store.store_event("other", answer(7))
    second = await store.store_event("one", answer(1))
    await store.store_event("one", None)
    third = await store.store_event("one", answer(2))

    assert await replayed(store, first) == ("one", [(second, 1), (third, 2)])
    assert await replayed(store, second) == ("one", [(third, 2)])
    assert await replayed(store, "no-such-event") == (None, [])


async def test_the_oldest_is_dropped_when_there_is_too_much(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http, "MAX_BYTES", 10_000)
    monkeypatch.setattr(http, "MAX_EVENTS", 10)
    store = Recent()
    kept = [await store.store_event("one", answer(number, "x" * 4000)) for number in range(4)]
    assert await replayed(store, kept[1]) == (None, [])
    assert await replayed(store, kept[2]) == ("one", [(kept[3], 3)])

    huge = await store.store_event("one", answer(5, "x" * 20_000))
    assert await replayed(store, huge) == (None, [])
    assert store._bytes == 0

    small = [await store.store_event("one", None) for _ in range(30)]
    assert len(store._events) == 10
    assert (await replayed(store, small[-10]))[0] == "one"
    assert (await replayed(store, small[-11]))[0] is None
