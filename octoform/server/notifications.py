"""Notifies connected clients of changes: tools, resources, one resource's content.

The two protocol eras want it in two ways, and FastMCP serves neither by itself. Clients of the handshake era are
remembered, weakly, and written to; clients of the later one open a `subscriptions/listen` stream and get what they
asked for. A client that does not read is given up, so that it holds up no one else.
"""

import asyncio
from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary, WeakSet

import anyio
from mcp.server.connection import Connection
from mcp.server.context import CallNext, HandlerResult, ServerRequestContext
from mcp.server.subscriptions import (
    InMemorySubscriptionBus,
    ListenHandler,
    ResourcesListChanged,
    ResourceUpdated,
    ServerEvent,
    ToolsListChanged,
)
from mcp.shared.exceptions import MCPError
from mcp_types import (
    INVALID_PARAMS,
    EmptyResult,
    ServerCapabilities,
    SubscribeRequestParams,
    SubscriptionsListenRequestParams,
    SubscriptionsListenResult,
    UnsubscribeRequestParams,
)
from mcp_types.version import MODERN_PROTOCOL_VERSIONS

from octoform.base.escaping import display
from octoform.server.internals import connection_of, low_level
from octoform.server.process.principal import current

MAX_URIS = 100
"""Resources that one client may subscribe to."""
MAX_URI = 2048
SECONDS = 5.0
"""How long a client may take to accept one notification."""

Context = ServerRequestContext[Any, Any]
Message = tuple[str, str | None]
"""A notification's method and the URI it is about, if it is about one."""


class Changes:
    """The notifications of one server (FastMCP). ``readable`` states which URIs the caller of a request may know of.

    ``tools``, ``resources`` and ``updated`` may be called from any thread. They return at once and send later.
    """

    def __init__(self, server: Any, readable: Callable[[str], bool] = lambda _: True) -> None:
        self._readable = readable
        self._loop: asyncio.AbstractEventLoop | None = None
        self._bus = InMemorySubscriptionBus()
        self._streams = ListenHandler(self._bus)
        self._clients: WeakSet[Connection] = WeakSet()
        self._wanted: WeakKeyDictionary[Connection, set[str]] = WeakKeyDictionary()
        self._unsent: WeakKeyDictionary[Connection, dict[Message, None]] = WeakKeyDictionary()
        self._tasks: set[asyncio.Task[None]] = set()
        inner = low_level(server)
        inner.middleware.insert(0, self._remember)
        inner.add_request_handler("subscriptions/listen", SubscriptionsListenRequestParams, self._listen)
        inner.add_request_handler("resources/subscribe", SubscribeRequestParams, self._subscribe)
        inner.add_request_handler("resources/unsubscribe", UnsubscribeRequestParams, self._unsubscribe)
        inner.get_capabilities = _without_prompts(inner.get_capabilities)

    def tools(self) -> None:
        """The list of tools changed, or its description of one of them."""
        self._announce(ToolsListChanged())

    def resources(self) -> None:
        """The list of resources changed."""
        self._announce(ResourcesListChanged())

    def updated(self, uri: str) -> None:
        """A resource has new content; only who subscribed to it is notified."""
        self._announce(ResourceUpdated(uri=uri))

    def close(self) -> None:
        """End all listening streams the graceful way; to be called on the event loop."""
        self._streams.close()

    def _announce(self, event: ServerEvent) -> None:
        if self._loop is None:  # there was no client yet
            return
        try:
            self._loop.call_soon_threadsafe(self._deliver, event)
        except RuntimeError:  # the loop is closed: the process ends, and the clients are gone
            return

    def _deliver(self, event: ServerEvent) -> None:
        self._task(self._bus.publish, event)
        method, uri = _message(event)
        for connection in list(self._clients):
            if uri is None or uri in self._wanted.get(connection, ()):
                self._queue(connection, (method, uri))

    def _queue(self, connection: Connection, message: Message) -> None:
        """Send it after what this client has not taken yet; the same news is not kept twice."""
        unsent = self._unsent.setdefault(connection, {})
        idle = not unsent
        unsent[message] = None
        if idle:
            self._task(self._send, connection)

    async def _send(self, connection: Connection) -> None:
        unsent = self._unsent[connection]
        while unsent:
            method, uri = next(iter(unsent))
            with anyio.move_on_after(SECONDS) as patience:
                await connection.notify(method, None if uri is None else {"uri": uri})
            unsent.pop((method, uri))
            if patience.cancelled_caught:
                self._clients.discard(connection)
                unsent.clear()

    def _task(self, function: Callable[..., Any], *arguments: Any) -> None:
        task = asyncio.ensure_future(function(*arguments))
        self._tasks.add(task)  # the loop itself keeps only a weak reference
        task.add_done_callback(self._tasks.discard)

    async def _remember(self, context: Context, call_next: CallNext) -> HandlerResult:
        """See every message, to know the event loop and which clients of the handshake era are connected."""
        self._loop = asyncio.get_running_loop()
        if context.method == "notifications/initialized" and context.protocol_version not in MODERN_PROTOCOL_VERSIONS:
            self._clients.add(connection_of(context.session))
        return await call_next(context)

    async def _listen(self, context: Context, params: SubscriptionsListenRequestParams) -> SubscriptionsListenResult:
        wanted = params.notifications
        uris = wanted.resource_subscriptions
        _check([str(uri) for uri in uris or ()])
        granted: dict[str, Any] = {"prompts_list_changed": None}
        if "read" not in current().effects:
            granted |= {"resources_list_changed": None, "resource_subscriptions": None}
        elif uris is not None:
            granted["resource_subscriptions"] = [uri for uri in uris if self._readable(str(uri))]
        given = params.model_copy(update={"notifications": wanted.model_copy(update=granted)})
        return await self._streams(context, given)

    async def _subscribe(self, context: Context, params: SubscribeRequestParams) -> EmptyResult:
        uris = self._wanted.setdefault(connection_of(context.session), set())
        _check([*uris, str(params.uri)])
        if "read" not in current().effects:
            raise MCPError(code=INVALID_PARAMS, message="this token may read no resource")
        if not self._readable(str(params.uri)):
            raise MCPError(code=INVALID_PARAMS, message=f"there is no resource {display(str(params.uri))}")
        uris.add(str(params.uri))
        return EmptyResult()

    async def _unsubscribe(self, context: Context, params: UnsubscribeRequestParams) -> EmptyResult:
        self._wanted.get(connection_of(context.session), set()).discard(str(params.uri))
        return EmptyResult()


def _without_prompts(capabilities: Callable[..., ServerCapabilities]) -> Callable[..., ServerCapabilities]:
    """The same, but it promises no news of prompts: what a server has of them never changes."""

    def told(*given: Any, **named: Any) -> ServerCapabilities:
        found = capabilities(*given, **named)
        if found.prompts is None:
            return found
        return found.model_copy(update={"prompts": found.prompts.model_copy(update={"list_changed": False})})

    return told


def _message(event: ServerEvent) -> Message:
    if isinstance(event, ResourceUpdated):
        return "notifications/resources/updated", event.uri
    if isinstance(event, ResourcesListChanged):
        return "notifications/resources/list_changed", None
    return "notifications/tools/list_changed", None


def _check(uris: list[str]) -> None:
    """Refuse what would make a client's subscriptions grow without bound."""
    if len(set(uris)) > MAX_URIS:
        raise MCPError(code=INVALID_PARAMS, message=f"a client may subscribe to at most {MAX_URIS} resources")
    if any(len(uri) > MAX_URI for uri in uris):
        raise MCPError(code=INVALID_PARAMS, message=f"the URI of a resource may have at most {MAX_URI} characters")
