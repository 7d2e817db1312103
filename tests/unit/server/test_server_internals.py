"""Each private name of FastMCP, the SDK and anyio that the server uses does what it is used for.

A release that changes one fails here, and not first on a host.
"""

import asyncio
import inspect
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import anyio.from_thread
import pytest
from fastmcp import Client, FastMCP
from fastmcp.exceptions import ToolError
from fastmcp.server.extensions import ServerExtension
from mcp.server.context import CallNext, HandlerResult, ServerRequestContext
from mcp.server.lowlevel import Server
from mcp.server.streamable_http_manager import StreamableHTTPSessionManager

from octoform.server import internals

COMPLETE = "completion/complete"


class Extension(ServerExtension):
    """Any extension."""

    identifier = "org.example/any"


def made(**given: Any) -> FastMCP[Any]:
    server: FastMCP[Any] = FastMCP("made", **given)

    @server.tool
    def fail() -> int:
        """Fails."""
        raise ValueError("a secret")

    return server


def test_the_low_level_server_is_that_of_the_sdk() -> None:
    found = internals.low_level(made())
    assert isinstance(found, Server)
    assert isinstance(found.middleware, list)
    assert found.name == "made"


@pytest.mark.anyio
async def test_the_lifespan_is_that_of_the_server() -> None:
    seen: list[str] = []

    @asynccontextmanager
    async def lifespan(_: FastMCP[Any]) -> AsyncIterator[None]:
        seen.append("begun")
        yield
        seen.append("ended")

    async with internals.lifespan(made(lifespan=lifespan)):
        assert seen == ["begun"]
    assert seen == ["begun", "ended"]


@pytest.mark.parametrize(("masked", "shown"), [(True, False), (False, True)])
@pytest.mark.anyio
async def test_errors_are_masked_whatever_the_server_chose(masked: bool, shown: bool) -> None:
    server = made(mask_error_details=False)
    if masked:
        internals.mask_errors(server)
    async with Client(server) as client:
        with pytest.raises(ToolError) as failed:
            await client.call_tool("fail")
    assert ("a secret" in str(failed.value)) is shown


def test_a_stripped_server_has_no_extension_and_no_handler_beyond_a_plain_one() -> None:
    server = made()
    server.add_extension(Extension())

    @server.completion
    def words(ref: Any, argument: Any, context: Any) -> list[str]:
        return ["word"]

    low_level = internals.low_level(server)
    assert low_level.get_request_handler(COMPLETE) is not None
    assert internals.is_extended(server)
    internals.strip(server, FastMCP("plain"))
    assert low_level.get_request_handler(COMPLETE) is None
    assert low_level.get_capabilities().completions is None
    assert low_level.get_request_handler("tools/call") is not None
    assert not internals.is_extended(server)


@pytest.mark.anyio
async def test_a_server_holds_a_tool_until_it_is_removed_or_replaced() -> None:
    server = made()
    tool = await server.get_tool("fail")
    assert tool is not None
    assert internals.holds(server, tool)
    server.local_provider.remove_tool("fail")
    assert not internals.holds(server, tool)


@pytest.mark.anyio
async def test_requests_of_one_client_are_of_one_connection() -> None:
    server, found = made(), []

    async def note(context: ServerRequestContext[Any, Any], call_next: CallNext) -> HandlerResult:
        found.append(internals.connection_of(context.session))
        return await call_next(context)

    internals.low_level(server).middleware.insert(0, note)
    for _ in range(2):
        async with Client(server, mode="legacy") as client:
            await client.list_tools()
            await client.list_tools()
    assert len(found) >= 4
    assert len(set(found)) == 2
    assert all(callable(each.notify) for each in found)


def test_sessions_are_kept_by_their_id_with_their_owner_and_can_be_ended() -> None:
    manager = StreamableHTTPSessionManager(internals.low_level(made()))
    assert (internals.transports(manager), internals.owners(manager)) == ({}, {})
    ending = inspect.signature(manager._discard_session)
    assert inspect.iscoroutinefunction(manager._discard_session)
    assert list(ending.parameters) == ["session_id", "transport"]


def in_thread(function: Callable[[], Any]) -> Any:
    found: list[Any] = []

    def run() -> None:
        try:
            found.append(function())
        except RuntimeError as problem:
            found.append(problem)

    thread = threading.Thread(target=run)
    thread.start()
    return thread, found


@pytest.mark.anyio
async def test_code_in_a_tool_thread_reaches_its_event_loop() -> None:
    loop = asyncio.get_running_loop()

    async def where() -> bool:
        return asyncio.get_running_loop() is loop

    def claimed() -> bool:
        with internals.tool_thread(loop):
            return anyio.from_thread.run(where)

    for function, expected in ((claimed, True), (lambda: anyio.from_thread.run(where), None)):
        thread, found = in_thread(function)
        await asyncio.to_thread(thread.join)
        assert found[0] is expected or (expected is None and isinstance(found[0], RuntimeError))
