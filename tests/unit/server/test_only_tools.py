"""What the gate does not stand before is not there: resources, prompts, completions, middleware of the server's own."""

from pathlib import Path
from typing import Any

import pytest
from fastmcp import Client, FastMCP
from fastmcp.server.middleware import Middleware, MiddlewareContext
from launched import launched, tool
from mcp.shared.exceptions import MCPError
from mcp_types import PromptReference
from offered import DEVICES, ERAS, TOOLS, policy_of, server_of_tools

from octoform.endpoint.process import estop
from octoform.server.catalog import offer

SOURCE = '''
from fastmcp import FastMCP

mcp = FastMCP("bench")


@mcp.tool
def look() -> int:
    """Looks."""
    return 1


@mcp.resource("x://move")
def move() -> str:
    print("moved by a resource", flush=True)
    return "moved"


@mcp.resource("x://move/{steps}")
def move_by(steps: str) -> str:
    print("moved by a template", flush=True)
    return "moved"


@mcp.prompt
def advice() -> str:
    print("moved by a prompt", flush=True)
    return "moved"


@mcp.completion
def words(ref, argument, context):
    print("moved by a completion", flush=True)
    return ["moved"]
'''


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_a_served_endpoint_has_tools_and_what_is_ours_alone(era: str, tmp_path: Path) -> None:
    with launched(tmp_path, SOURCE, [tool("look")]) as endpoint:
        estop.stop(endpoint.layout, "test", "nothing may move")
        async with endpoint.client(era) as client:
            assert [each.name for each in await client.list_tools()] == ["look"]
            assert [str(each.uri) for each in await client.list_resources()] == ["octoform://devices"]
            assert await client.list_resource_templates() == []
            assert await client.list_prompts() == []
            for uri in ("x://move", "x://move/9"):
                with pytest.raises(MCPError, match=f"there is no resource '{uri}'"):
                    await client.read_resource(uri)
            with pytest.raises(MCPError, match="there is no prompt 'advice'"):
                await client.get_prompt("advice")
            with pytest.raises(MCPError):
                await client.complete(PromptReference(name="advice"), {"name": "x", "value": "m"})
            assert (await client.call_tool("look")).data == 1
        assert "moved by" not in endpoint.printed()


class _First(Middleware):
    """Answers before the gate could be asked."""

    async def on_message(self, context: MiddlewareContext[Any], call_next: Any) -> Any:
        raise AssertionError("middleware of the generated server ran")


@pytest.mark.parametrize("era", ERAS)
@pytest.mark.anyio
async def test_middleware_of_the_server_does_not_run(era: str) -> None:
    server = server_of_tools()
    server.add_middleware(_First())
    offer(server, DEVICES, TOOLS, policy_of())

    async with Client(server, mode=era) as client:
        assert (await client.call_tool("move_rail", {"steps": 3})).data == 3


@pytest.mark.anyio
async def test_resources_of_a_mounted_server_are_not_there() -> None:
    server, other = server_of_tools(), FastMCP[Any]("other")

    @other.resource("other://own")
    def own() -> str:
        raise AssertionError("a resource of the generated server was read")

    server.mount(other)
    offer(server, DEVICES, TOOLS, policy_of())

    async with Client(server) as client:
        assert [str(each.uri) for each in await client.list_resources()] == ["octoform://devices"]
        with pytest.raises(MCPError, match="there is no resource 'other://own'"):
            await client.read_resource("other://own")
