"""The door of scopes intranet and internet: MCP over streamable HTTP, for anyone who brings a token.

The order at the door: is this host meant (Host, Origin), who is it (bearer token), is the body bearable, and only then
the server behind. `/health` alone needs no token, and returns one word and no names: 200 for `healthy`, else 503.
Everything else that the generated server may have put on its own web application is omitted. There is no TLS here: in
scope internet the tunnel brings it, and in scope intranet the token crosses the network in the clear.
"""

import asyncio
import contextlib
import itertools
import logging
import re
import secrets
import socket
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, cast
from urllib.parse import parse_qsl, urlsplit

import anyio
import anyio.lowlevel
import h11
import uvicorn
from fastmcp.server.http import HostOriginGuardMiddleware, create_streamable_http_app
from mcp.server.streamable_http import EventCallback, EventId, EventMessage, EventStore, StreamId
from mcp_types import JSONRPCMessage
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from octoform.base.health_status import Status
from octoform.server.execution.result_size import at_least
from octoform.server.process.descriptor import Descriptor
from octoform.server.process.stderr_log import Throttle
from octoform.server.tunnel_termination import INSTANCE_HEADER

from .addresses import Listening, listen
from .authentication import Open, Tokens, Verifier
from .unix_socket import is_request

# Connections that cannot be held open for nothing: what uvicorn leaves out of HTTP/1.1.
#
# A request line and its headers have to come within seconds, a body within a minute, and what is still sent after the
# answer is not listened to for long. So many connections are taken; when one more comes, the oldest that waits for
# nothing but its client makes room. A flood of half-open connections therefore costs a client that really speaks
# nothing.

HEAD_SECONDS = 10.0
BODY_SECONDS = 60.0
LINGER_SECONDS = 2.0
KEEP_ALIVE_SECONDS = 15
MAX_CONNECTIONS = 512
BACKLOG = 256

PROTOCOL_LOGGER = logging.getLogger("octoform.connections")
PROTOCOL_LOGGER.addFilter(Throttle())

_births = itertools.count()
_LATE = "octoform.late"
"""Of a request's scope: this side closed the connection, and has logged it."""


class Connection(H11Protocol):
    """One connection of a client."""

    seconds: ClassVar[Mapping[str, float]] = {
        "head": HEAD_SECONDS,
        "body": BODY_SECONDS,
        "linger": LINGER_SECONDS,
    }

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.logger = PROTOCOL_LOGGER
        self.access_log = False
        self._born = next(_births)
        self._phase: tuple[str, object] | None = None
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Make room for it and start its first deadline."""
        super().connection_made(transport)
        if len(self.connections) > MAX_CONNECTIONS:
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
        PROTOCOL_LOGGER.warning("more than %d connections: one that waited was closed", MAX_CONNECTIONS)
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
        """The part that the client has yet to send (head, body, linger) and its request; None when complete."""
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
        if phase == "body":
            scope = cast(Scope, self.scope)
            scope[_LATE] = True
            LOGGER.warning("%s: the connection was closed: its body did not come in time", _request(scope))
        elif phase != "linger":
            PROTOCOL_LOGGER.warning("a connection was closed: its %s did not come in time", phase)
        self.transport.abort()


# What was sent to clients over HTTP lately, so that one whose connection broke gets the answer that it missed.
#
# An actuator must not be moved twice because the answer to the first call was lost on the way. Kept in memory, within a
# bound for all clients together; what is dropped cannot be sent again, and the client learns that from silence.

MAX_BYTES = 16_000_000
MAX_EVENTS = 2000
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
        size = 0 if message is None else at_least(message, MAX_BYTES)
        self._events[identity] = _Event(stream_id, message, size)
        self._bytes += size
        while self._bytes > MAX_BYTES or len(self._events) > MAX_EVENTS:
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


PATH = "/mcp"
HEALTH = "/health"
MAX_SESSIONS = 512
STOP_SECONDS = 2
"""Seconds that streams have for their end when the endpoint stops."""
LOGGER = logging.getLogger("octoform.web")
LOGGER.addFilter(Throttle())
# They log every unauthenticated request, without a bound; what matters of it is in this module's own lines.
for _name in ("fastmcp.server.auth.middleware", "mcp.server.streamable_http_manager", "mcp.server.streamable_http"):
    logging.getLogger(_name).setLevel(logging.ERROR)


class Web:
    """The HTTP side of one start of the endpoint: made, opened, served until `stop`."""

    def __init__(self, server: Any, descriptor: Descriptor, tokens: Tokens, *, instance: str) -> None:
        self._descriptor = descriptor
        self._network: Mapping[str, Any] = descriptor.network or {}
        self._open: Open | None = None
        self._listening: Listening | None = None
        self._trusted: tuple[str, ...] = ()
        self.verdict: Callable[[], str] = lambda: Status.UNKNOWN
        """How the deployment is, in one word; set when the endpoint is assembled."""
        self._instance = instance
        self._app = self._made(server, tokens)
        self._guard = HostOriginGuardMiddleware(
            self._app, self._hosts(), tuple(self._network.get("origins") or ()), mode="strict"
        )
        self._uvicorn = _Uvicorn(
            uvicorn.Config(
                _Refusals(self._guard, instance),
                http=Connection,
                ws="none",
                lifespan="on",
                log_config=None,
                access_log=False,
                proxy_headers=False,
                server_header=False,
                headers=[(INSTANCE_HEADER, instance)],
                timeout_keep_alive=KEEP_ALIVE_SECONDS,
                timeout_graceful_shutdown=STOP_SECONDS,
                backlog=BACKLOG,
            ),
            self._close,
        )

    def open(self) -> Listening:
        """Take the port; NoAddressError when there is none. Nothing is answered before `serve`."""
        self._listening = listen(self._network, self._descriptor.run, BACKLOG)
        return self._listening

    @property
    def url(self) -> str:
        """Where clients of the network connect, once the door is open."""
        if self._listening is None:
            raise RuntimeError("the door was not opened")
        return self._listening.url + PATH

    def published(self, url: str | None) -> None:
        """Answer under the name of this public address too, and no more under the one before; from any thread."""
        host = None if url is None else urlsplit(url).hostname
        self._trusted = () if host is None else (host,)
        self._guard.allowed_hosts = self._hosts()

    async def serve(self) -> None:
        """Answer until `stop`; when cancelled, the door is closed in order first."""
        if self._listening is None:
            raise RuntimeError("the door was not opened")
        serving = asyncio.ensure_future(self._uvicorn.serve(list(self._listening.sockets)))
        watching = asyncio.ensure_future(self._watch())
        try:
            # Neither goes on without the other: an unsupervised listener would keep streams of ended tokens open.
            await asyncio.wait({serving, watching}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self.stop()
            watching.cancel()
            ends = await asyncio.gather(serving, watching, return_exceptions=True)
            self._listening.close()
        for end in ends:
            if isinstance(end, Exception):
                raise end

    def stop(self) -> None:
        """Let `serve` return soon; from any thread."""
        self._uvicorn.should_exit = True

    def _close(self) -> None:
        if self._open is not None:
            self._open.end_all()

    def _made(self, server: Any, tokens: Tokens) -> Starlette:
        app = create_streamable_http_app(
            server=server,
            streamable_http_path=PATH,
            event_store=Recent(),
            retry_interval=RETRY_MS,
            auth=Verifier(tokens),
            middleware=[Middleware(self._keeping, tokens=tokens)],
            routes=[Route(HEALTH, self._health, methods=["GET"])],
        )
        ours = [route for route in app.router.routes if isinstance(route, Route) and self._is_ours(route)]
        app.router.routes[:] = ours
        app.router.lifespan_context = self._bounded(app.router.lifespan_context)
        return app

    def _bounded(self, inner: Any) -> Any:
        """The application's lifespan, with a bound for its sessions before the first one opens."""

        @contextlib.asynccontextmanager
        async def lifespan(app: Starlette) -> AsyncIterator[Any]:
            async with inner(app) as state:
                sessions = _session_manager(app)
                sessions.max_sessions = MAX_SESSIONS
                if self._open is not None:
                    self._open.sessions = sessions
                yield state

        return lifespan

    def _is_ours(self, route: Route) -> bool:
        return route.path == PATH or (route.path == HEALTH and route.endpoint == self._health)

    def _keeping(self, app: ASGIApp, tokens: Tokens) -> ASGIApp:
        self._open = Open(app, tokens)
        return self._open

    async def _watch(self) -> None:
        while self._open is None:
            await asyncio.sleep(0.02)
        await self._open.watch()

    def _hosts(self) -> tuple[str, ...]:
        name = socket.gethostname().lower()
        own = (name, f"{name.partition('.')[0]}.local") if name else ()
        return (*own, *(str(host) for host in self._network.get("hosts") or ()), *self._trusted)

    async def _health(self, _: Request) -> JSONResponse:
        try:
            word = await asyncio.to_thread(self.verdict)  # a disk may take its time, and clients wait for none
        except RuntimeError:  # no thread is to be had
            word = self.verdict()
        facts = {"status": word, "tools": len(self._descriptor.tools), "instance": self._instance}
        return JSONResponse(facts, 200 if word == Status.HEALTHY else 503, headers={"Cache-Control": "no-store"})


def _session_manager(app: Starlette) -> Any:
    """The SDK's session manager behind the one MCP route; it comes to be when the application starts."""
    route = next(route for route in app.router.routes if isinstance(route, Route) and route.path == PATH)
    guarded: Any = route.endpoint
    return guarded.app.session_manager


class _Uvicorn(uvicorn.Server):
    """uvicorn that leaves the process's signals to its caller, and ends open streams before it waits for them."""

    def __init__(self, config: uvicorn.Config, closing: Callable[[], None]) -> None:
        super().__init__(config)
        self._closing = closing

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Take no more, end what is open, let what has an answer send it."""
        self._closing()
        await super().shutdown(sockets)

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield


class _Refusals:
    """Outermost: refuses tokens in addresses, malformed headers and requests whose id is not valid, and logs refusals.

    What was let in is in the call log. The one line of a refusal has no query and no header.
    """

    def __init__(self, app: ASGIApp, instance: str) -> None:
        self._app = app
        # A tunnel that passes on no header must still show whose refusal it is: that it is there is what it proves.
        self._misdirected = JSONResponse({"error": "misdirected_request", "instance": instance}, 421)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        replaced = False
        body: list[bytes] = []

        async def noted(message: Message) -> None:
            nonlocal replaced
            if message.get("status") == 202 and is_request(b"".join(body)):  # its id is not valid
                replaced = True
                _log_status(scope, 400)
                await _NO_ID(scope, receive, send)
            body.clear()  # an answer may stream for hours
            verdict = scope["path"] == HEALTH and message.get("status") == 503  # an answer, and no refusal
            if message["type"] == "http.response.start" and message["status"] >= 400 and not verdict:
                _log_status(scope, message["status"])
                replaced = message["status"] == 421
                if replaced:
                    await self._misdirected(scope, receive, send)
            if not replaced:
                await send(message)

        malformed = _malformed(scope["headers"])
        if malformed is not None:
            status, text = malformed
            document = {"error": "invalid_request", "error_description": text}
            await JSONResponse(document, status, {"Connection": "close"})(scope, receive, noted)
            return
        if _has_token(scope.get("query_string", b"")):
            text = "a token belongs in the Authorization header, never into the address"
            await JSONResponse({"error": "invalid_request", "error_description": text}, 400)(scope, receive, noted)
            return
        with anyio.CancelScope() as under_way:
            await self._app(scope, _heard(scope, receive, body, under_way), noted)


def _heard(scope: Scope, receive: Receive, body: list[bytes], under_way: anyio.CancelScope) -> Receive:
    """Hand on a request's body, and collect it; the request ends when its client hangs up before it is whole."""
    whole = False

    async def heard() -> Message:
        nonlocal whole
        message = await receive()
        if message["type"] == "http.disconnect" and not whole:
            if not scope.get(_LATE):
                LOGGER.warning("%s: the client hung up before its body was whole", _request(scope))
            # To what is behind it, this is a failure that it logs with its stack, and no one is left to answer.
            under_way.cancel()
            await anyio.lowlevel.checkpoint()
        whole = not message.get("more_body", False)
        body.append(message.get("body") or b"")
        return message

    return heard


_NO_ID = JSONResponse(
    {"jsonrpc": "2.0", "id": None, "error": {"code": -32600, "message": "this is no JSON-RPC message"}}, 400
)
_NAME = rb"(\[[0-9A-Za-z:.%_-]+\]|[0-9A-Za-z._-]+)(:[0-9]{1,5})?"
_HOST = re.compile(_NAME)
_ORIGIN = re.compile(rb"null|[A-Za-z][A-Za-z0-9+.-]*://" + _NAME)


def _malformed(headers: Sequence[tuple[bytes, bytes]]) -> tuple[int, str] | None:
    """(status, what is wrong) for headers that another reader may read otherwise; None for all others.

    A length beside chunks is how a request is hidden behind a proxy (RFC 9112, 6.1). The guard behind this takes what
    is before the first colon of a host for its name, whatever follows.
    """
    names = [name for name, _ in headers]
    if b"content-length" in names and b"transfer-encoding" in names:
        return 400, "a request has a Content-Length or a Transfer-Encoding, not both"
    if any(name == b"host" and value and not _HOST.fullmatch(value) for name, value in headers):
        return 421, "the Host header is no name with a port"
    origins = [value for name, value in headers if name == b"origin"]
    if len(origins) > 1 or any(not _ORIGIN.fullmatch(value) for value in origins):
        return 403, "the Origin header is not one origin"
    return None


def _has_token(query: bytes) -> bool:
    if not query:
        return False
    names = {name.lower() for name, _ in parse_qsl(query.decode("latin-1"), keep_blank_values=True)}
    return not names.isdisjoint({"token", "access_token", "authorization", "bearer"})


def _log_status(scope: Scope, status: int) -> None:
    LOGGER.warning("refused: %s: %d", _request(scope), status)


def _request(scope: Scope) -> str:
    client = scope.get("client") or ("?", 0)
    return f"{scope['method']} {scope['path'][:80]!a} from {client[0]}"
