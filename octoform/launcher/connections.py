"""Connections that cannot be held open for nothing: what uvicorn leaves out of HTTP/1.1.

A request line and its headers have to come within seconds, a body within a minute, and what is still sent after the
answer is not listened to for long. So many connections are taken; when one more comes, the oldest that waits for
nothing but its client makes room. A flood of half-open connections therefore costs a client that really speaks nothing.
"""

import asyncio
import itertools
import logging
from collections.abc import Mapping
from typing import Any, ClassVar

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from .quiet import Throttle

HEAD_SECONDS = 10.0
BODY_SECONDS = 60.0
LINGER_SECONDS = 2.0
KEEP_ALIVE_SECONDS = 15
MOST_CONNECTIONS = 512
BACKLOG = 256

LOGGER = logging.getLogger("octoform.connections")
LOGGER.addFilter(Throttle())

_births = itertools.count()


class Connection(H11Protocol):
    """One connection of a client."""

    seconds: ClassVar[Mapping[str, float]] = {
        "head": HEAD_SECONDS,
        "body": BODY_SECONDS,
        "linger": LINGER_SECONDS,
    }

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.logger = LOGGER
        self.access_log = False
        self._born = next(_births)
        self._phase: tuple[str, object] | None = None
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Make room for it and start its first deadline."""
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            self._make_room()
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget its deadline."""
        self._cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take bytes of a request."""
        super().data_received(data)
        self._watch()

    def on_response_complete(self) -> None:
        """An answer has gone out: the next request may come, the rest of this one need not."""
        super().on_response_complete()
        self._watch()

    @property
    def waits(self) -> bool:
        """True when the server has nothing to do for it: no request is whole enough to be worked on."""
        return self.cycle is None or self.cycle.response_complete

    def _make_room(self) -> None:
        others = [one for one in self.connections if isinstance(one, Connection) and one is not self and one.waits]
        victim = min(others, key=lambda one: one._born, default=self)
        LOGGER.warning("more than %d connections: one that waited was closed", MOST_CONNECTIONS)
        victim.transport.abort()
        self.connections.discard(victim)

    def _watch(self) -> None:
        phase = self._now()
        if phase == self._phase:
            return
        self._cancel()
        self._phase = phase
        if phase is not None and not self.transport.is_closing():
            self._deadline = self.loop.call_later(self.seconds[phase[0]], self._give_up, phase[0])

    def _now(self) -> tuple[str, object] | None:
        """What the client owes, and for which request; None while it owes nothing."""
        if self.conn.their_state is h11.IDLE:
            # Between two requests, uvicorn's own keep-alive timer runs until the first byte comes.
            return None if self.timeout_keep_alive_task is not None else ("head", self.cycle)
        if self.conn.their_state is h11.SEND_BODY:
            return ("linger" if self.cycle.response_complete else "body", self.cycle)
        return None

    def _cancel(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _give_up(self, phase: str) -> None:
        if phase != "linger":
            LOGGER.warning("a connection was closed: its %s did not come in time", phase)
        self.transport.abort()
