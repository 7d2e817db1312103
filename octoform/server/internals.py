"""What the server uses of FastMCP, of the SDK and of anyio under their private names; it is used nowhere else.

A release may change any of it without notice, so the ranges of these packages end before the next release of FastMCP,
and `tests/unit/server/test_server_internals.py` holds each name. Decision 0009 has what was done with public names
instead.
"""

import asyncio
from collections.abc import Mapping
from contextlib import AbstractAsyncContextManager, AbstractContextManager
from typing import Any

from anyio._backends._asyncio import AsyncIOBackend
from anyio._core._eventloop import claim_worker_thread


def low_level(server: Any) -> Any:
    """The SDK's server within a FastMCP server. FastMCP gives no access to its middleware, its handlers and
    its server info, and lets it serve no connection that FastMCP did not open."""
    return server._mcp_server


def lifespan(server: Any) -> AbstractAsyncContextManager[None]:
    """What a FastMCP server sets up before its first client and takes down after the last. FastMCP enters it for its
    own transports alone, and the clients of a Unix socket come and go without ending it."""
    found: AbstractAsyncContextManager[None] = server._lifespan_manager()
    return found


def mask_errors(server: Any) -> None:
    """Keep the text of exceptions from clients. It can be chosen when a server is made, which generated code does."""
    server._mask_error_details = True


def strip(server: Any, plain: Any) -> None:
    """Take from a FastMCP server all extensions, and the handlers that a ``plain`` one does not have. Handlers can be
    added and replaced in public, and one that is there is announced to clients as a capability."""
    server._extensions.clear()
    own, known = low_level(server), low_level(plain)
    for handlers, plain_ones in (
        (own._request_handlers, known._request_handlers),
        (own._notification_handlers, known._notification_handlers),
    ):
        for method in handlers.keys() - plain_ones.keys():
            del handlers[method]


def is_extended(server: Any) -> bool:
    """Whether an extension may stand between a call and its tool: FastMCP names those alone that register others."""
    return bool(server._extensions)


def holds(server: Any, tool: Any) -> bool:
    """Whether a FastMCP server still has this very tool. The public way is a coroutine through all that may change it,
    for every call."""
    return server.local_provider._components.get(tool.key) is tool


def connection_of(session: Any) -> Any:
    """The connection of a request's session. A session is made for each request and can notify, but what a client
    subscribed to belongs to its connection."""
    return session._connection


def transports(sessions: Any) -> Mapping[str, Any]:
    """The open HTTP sessions by their ids; the manager counts them against its bound and shows them to no one."""
    found: Mapping[str, Any] = sessions._server_instances
    return found


def owners(sessions: Any) -> dict[str, Any]:
    """By whom each HTTP session was opened, to end those of a token that has ended."""
    return dict(sessions._session_owners)


async def end_session(sessions: Any, identity: str, transport: Any) -> None:
    """End an HTTP session as a client's own DELETE does, which only its owner can send."""
    await sessions._discard_session(identity, transport)


def tool_thread(loop: asyncio.AbstractEventLoop) -> AbstractContextManager[Any]:
    """While it is entered, code of this thread may call `anyio.from_thread`. anyio does so for threads of its own pool,
    and no one may raise an exception in a thread that others use after."""
    return claim_worker_thread(AsyncIOBackend, loop)
