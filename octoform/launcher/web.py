"""The door of scopes intranet and internet: MCP over streamable HTTP, for whoever brings a token.

The order at the door: is this host meant (Host, Origin), who is it (bearer token), is the body bearable, and only then
the server behind. `/health` alone needs no token and tells no names. Everything else that the generated server may
have put on its own web application is left out. There is no TLS here: in scope internet the tunnel brings it, and in
scope intranet the token crosses the network in the clear.
"""

import asyncio
import contextlib
import logging
import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any
from urllib.parse import parse_qsl

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
from .tokens import Tokens

PATH = "/mcp"
HEALTH = "/health"
MOST_SESSIONS = 256
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
        self._trusted: frozenset[str] = frozenset()
        self.state: Callable[[], str] = lambda: "ok"
        """What `/health` says of the endpoint; whoever assembles it may put a better answer here."""
        self._instance = instance
        self._app = self._made(server, tokens)
        self._guard = HostOriginGuardMiddleware(
            self._app, self._hosts(), tuple(self._network.get("origins") or ()), mode="strict"
        )
        self._uvicorn = _Uvicorn(
            uvicorn.Config(
                _Refusals(self._guard),
                http=Connection,
                ws="none",
                lifespan="on",
                log_config=None,
                access_log=False,
                proxy_headers=False,
                server_header=False,
                timeout_keep_alive=KEEP_ALIVE_SECONDS,
                timeout_graceful_shutdown=STOP_SECONDS,
                backlog=BACKLOG,
            )
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

    def trust(self, hosts: Sequence[str]) -> None:
        """Answer under these host names too, and no more under those that were given before; from any thread."""
        self._trusted = frozenset(hosts)
        self._guard.allowed_hosts = self._hosts()

    async def serve(self) -> None:
        """Answer until `stop`; when cancelled, the door is closed in order first."""
        if self._listening is None:
            raise RuntimeError("the door was not opened")
        serving = asyncio.ensure_future(self._uvicorn._serve(list(self._listening.sockets)))
        watching = asyncio.ensure_future(self._watch())
        try:
            await asyncio.shield(serving)
        finally:
            self.stop()
            watching.cancel()
            await asyncio.gather(serving, watching, return_exceptions=True)
            self._listening.close()

    def stop(self) -> None:
        """Let `serve` return soon; from any thread."""
        self._uvicorn.should_exit = True

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
        return app

    def _is_ours(self, route: Route) -> bool:
        return route.path == PATH or (route.path == HEALTH and route.endpoint == self._health)

    def _keeping(self, app: ASGIApp, tokens: Tokens) -> ASGIApp:
        self._open = Open(app, tokens)
        return self._open

    async def _watch(self) -> None:
        while not self._uvicorn.started:
            await asyncio.sleep(0.02)
        if self._open is None:
            raise RuntimeError("the application was not built")
        self._open.sessions = _session_manager(self._app)
        self._open.sessions.max_sessions = MOST_SESSIONS
        await self._open.watch()

    def _hosts(self) -> tuple[str, ...]:
        name = socket.gethostname().lower()
        own = (name, f"{name.partition('.')[0]}.local") if name else ()
        return (*own, *(str(host) for host in self._network.get("hosts") or ()), *sorted(self._trusted))

    async def _health(self, _: Request) -> JSONResponse:
        facts = {"status": self.state(), "tools": len(self._descriptor.tools), "instance": self._instance}
        return JSONResponse(facts, headers={"Cache-Control": "no-store"})


def _session_manager(app: Starlette) -> Any:
    """The SDK's session manager behind the one MCP route; it comes to be when the application starts."""
    route = next(route for route in app.router.routes if isinstance(route, Route) and route.path == PATH)
    guarded: Any = route.endpoint
    return guarded.app.session_manager


class _Uvicorn(uvicorn.Server):
    """uvicorn that leaves the process's signals to whoever runs it."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield


class _Refusals:
    """Outermost: keeps tokens out of addresses, and writes one line for each request that was refused.

    What was let in stands in the call log. The line has no query and no header.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def noted(message: Message) -> None:
            if message["type"] == "http.response.start" and message["status"] >= 400:
                _tell(scope, message["status"])
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
