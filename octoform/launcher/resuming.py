"""What was sent to clients over HTTP lately, so that one whose connection broke gets the answer that it missed.

An actuator must not be moved twice because the answer to the first call was lost on the way. Kept in memory, within a
bound for all clients together; what is dropped cannot be sent again, and the client learns that from silence.
"""

import secrets
from collections import OrderedDict
from dataclasses import dataclass

from mcp.server.streamable_http import EventCallback, EventId, EventMessage, EventStore, StreamId
from mcp_types import JSONRPCMessage

from .sizes import at_least

MOST_BYTES = 16_000_000
MOST_EVENTS = 2000
RETRY_MS = 1000
"""When a client whose stream was closed may come again."""


@dataclass(frozen=True, slots=True)
class _Event:
    stream: StreamId
    message: JSONRPCMessage | None
    size: int


class Recent(EventStore):
    """The latest messages of all streams, the oldest dropped first; FastMCP keeps the sessions apart."""

    def __init__(self) -> None:
        self._events: OrderedDict[EventId, _Event] = OrderedDict()
        self._bytes = 0
        self._start = secrets.token_hex(4)
        self._count = 0

    async def store_event(self, stream_id: StreamId, message: JSONRPCMessage | None) -> EventId:
        """Keep a message (None: only a place in the stream to resume from); its id."""
        self._count += 1
        identity = f"{self._start}-{self._count}"
        size = 0 if message is None else at_least(message, MOST_BYTES)
        self._events[identity] = _Event(stream_id, message, size)
        self._bytes += size
        while self._bytes > MOST_BYTES or len(self._events) > MOST_EVENTS:
            _, oldest = self._events.popitem(last=False)
            self._bytes -= oldest.size
        return identity

    async def replay_events_after(self, last_event_id: EventId, send_callback: EventCallback) -> StreamId | None:
        """Send what came in its stream after an event; the stream, None when the event is not known (any more)."""
        last = self._events.get(last_event_id)
        if last is None:
            return None
        identities = list(self._events)
        for identity in identities[identities.index(last_event_id) + 1 :]:
            event = self._events.get(identity)
            if event is not None and event.stream == last.stream and event.message is not None:
                await send_callback(EventMessage(event.message, identity))
        return last.stream
