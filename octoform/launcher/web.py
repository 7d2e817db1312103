"""The door of scopes intranet and internet: MCP over streamable HTTP, for whoever brings a token.

The order at the door: is this host meant (Host, Origin), who is it (bearer token), is the body bearable, and only then
the server behind. `/health` alone needs no token, and tells one word and no names: 200 for `healthy`, else 503.
Everything else that the generated server may have put on its own web application is left out. There is no TLS here: in
scope internet the tunnel brings it, and in scope intranet the token crosses the network in the clear.
"""

import asyncio
import contextlib
import logging
import socket
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import uvicorn
from fastmcp.server.http import HostOriginGuardMiddleware, create_streamable_http_app
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .addresses import Listening, listen
from .admission import Open, Verifier
from .connections import BACKLOG, KEEP_ALIVE_SECONDS, Connection
from .descriptor import Descriptor
from .quiet import Throttle
from .resuming import RETRY_MS, Recent
from .revoking import INSTANCE_HEADER
from .tokens import Tokens
from .verdict import HEALTHY, UNKNOWN

PATH = "/mcp"
HEALTH = "/health"
MOST_SESSIONS = 512
STOP_SECONDS = 2
"""What streams have for their end when the endpoint stops."""
LOGGER = logging.getLogger("octoform.web")
LOGGER.addFilter(Throttle())
# They tell of every stranger at the door, without a bound; what matters of it is in this module's own lines.
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
        self.verdict: Callable[[], str] = lambda: UNKNOWN
        """How the deployment is, in one word of `octoform.launcher.verdict`; whoever assembles the endpoint sets it."""
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
        serving = asyncio.ensure_future(self._uvicorn._serve(list(self._listening.sockets)))
        watching = asyncio.ensure_future(self._watch())
        try:
            # Neither goes on without the other: a door that nobody watches would keep streams of ended tokens open.
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
                sessions.max_sessions = MOST_SESSIONS
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
        return JSONResponse(facts, 200 if word == HEALTHY else 503, headers={"Cache-Control": "no-store"})


def _session_manager(app: Starlette) -> Any:
    """The SDK's session manager behind the one MCP route; it comes to be when the application starts."""
    route = next(route for route in app.router.routes if isinstance(route, Route) and route.path == PATH)
    guarded: Any = route.endpoint
    return guarded.app.session_manager


class _Uvicorn(uvicorn.Server):
    """uvicorn that leaves the process's signals to whoever runs it, and ends open streams before it waits for them."""

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
    """Outermost: keeps tokens out of addresses, and writes one line for each request that was refused.

    What was let in stands in the call log. The line has no query and no header.
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

        async def noted(message: Message) -> None:
            nonlocal replaced
            verdict = scope["path"] == HEALTH and message.get("status") == 503  # an answer, and no refusal
            if message["type"] == "http.response.start" and message["status"] >= 400 and not verdict:
                _tell(scope, message["status"])
                replaced = message["status"] == 421
                if replaced:
                    await self._misdirected(scope, receive, send)
            if not replaced:
                await send(message)

        if _has_token(scope.get("query_string", b"")):
            text = "a token belongs into the Authorization header, never into the address"
            await JSONResponse({"error": "invalid_request", "error_description": text}, 400)(scope, receive, noted)
            return
        await self._app(scope, receive, noted)


def _has_token(query: bytes) -> bool:
    if not query:
        return False
    names = {name.lower() for name, _ in parse_qsl(query.decode("latin-1"), keep_blank_values=True)}
    return not names.isdisjoint({"token", "access_token", "authorization", "bearer"})


def _tell(scope: Scope, status: int) -> None:
    client = scope.get("client") or ("?", 0)
    LOGGER.warning("refused: %s %s from %s: %d", scope["method"], ascii(scope["path"][:80]), client[0], status)
