"""A tool that stops a movement does not wait behind it; everything else that holds for tools holds for it too."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from gated import Gated, gated

from octoform.policy import Limit, published
from octoform.policy.resolve import Policy, Rule, resolve

begun, may_end = threading.Event(), threading.Event()
log: list[str] = []


@pytest.fixture(autouse=True)
def _still() -> None:
    begun.clear()
    may_end.clear()
    log.clear()


def arm_move() -> str:
    """Moves until it is stopped."""
    begun.set()
    may_end.wait(20)
    log.append("moved")
    return "moved"


def arm_stop() -> str:
    """Ends the movement."""
    log.append("stopped")
    may_end.set()
    return "stopped"


def arm_read() -> str:
    """Waits for its turn."""
    log.append("read")
    return "read"


def tool(function: Callable[..., Any], effect: str = "actuate", **more: Any) -> dict[str, Any]:
    """Its entry in INTERFACE."""
    name = function.__name__
    return {"name": name, "capability": name, "effect": effect, "devices": ["arm"], "input_schema": {}, **more}


FREE = Policy(actuate="allow")
TOOLS = {arm_move: tool(arm_move), arm_stop: tool(arm_stop, stops=True), arm_read: tool(arm_read, "read")}


@asynccontextmanager
async def arm(folder: Path, given: Policy) -> AsyncIterator[Gated]:
    """The three tools behind the gate, with the policy that the core makes of ``given``."""
    resolved = resolve(given, TOOLS.values(), ())["tools"]
    async with gated(folder, {function: resolved[function.__name__] for function in TOOLS}) as gate:
        yield gate


async def until(event: threading.Event) -> None:
    assert await asyncio.to_thread(event.wait, 20)


def test_it_runs_while_a_long_call_holds_the_bus(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with arm(tmp_path, FREE) as gate, gate.client() as one, gate.client() as two:
            moving = asyncio.create_task(one.call_tool("arm_move", {}))
            await until(begun)
            reading = asyncio.create_task(two.call_tool("arm_read", {}))
            assert (await two.call_tool("arm_stop", {})).data == "stopped"
            assert ((await moving).data, (await reading).data) == ("moved", "read")
            assert log == ["stopped", "moved", "read"]
            assert [entry["tool"] for entry in gate.records("decision")] == ["arm_move", "arm_stop", "arm_read"]
            assert ("ok", "arm_stop") in [(entry["outcome"], entry["tool"]) for entry in gate.records("outcome")]

    asyncio.run(scenario())


def test_what_waited_behind_the_movement_does_not_move_after_the_stop(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with arm(tmp_path, FREE) as gate, gate.client() as one, gate.client() as two:
            moving = asyncio.create_task(one.call_tool("arm_move", {}))
            await until(begun)
            queued = asyncio.create_task(two.call_tool("arm_move", {}, raise_on_error=False))
            reading = asyncio.create_task(two.call_tool("arm_read", {}))
            async with asyncio.timeout(20):
                while len(gate.gate._entries._buses["arm"]._waiting) < 2:
                    await asyncio.sleep(0.01)
            await two.call_tool("arm_stop", {})
            refused = await queued
            assert refused.is_error and refused.meta["octoform/refused"] == "stopped"
            assert (await moving).data == "moved" and (await reading).data == "read"
            assert log == ["stopped", "moved", "read"]
            assert (await one.call_tool("arm_move", {})).data == "moved"  # what comes after the stop moves

    asyncio.run(scenario())


@pytest.mark.parametrize(
    ("given", "code"),
    [
        (Policy(rules=(Rule(("arm_stop",), "deny"),)), "denied"),
        (Policy(limits=(Limit("arm_stop", cooldown=3600),)), "cooldown"),
        (Policy(), "estop"),
    ],
)
def test_policy_limits_and_the_latch_hold_for_it(tmp_path: Path, given: Policy, code: str) -> None:
    async def scenario() -> None:
        async with arm(tmp_path, given) as gate, gate.client() as client:
            if code == "cooldown":
                await client.call_tool("arm_stop", {})
            elif code == "estop":
                gate.latch.engage("ada", "smoke")
            before = list(log)
            refused = await client.call_tool("arm_stop", {}, raise_on_error=False)
            assert refused.is_error and refused.meta["octoform/refused"] == code
            assert log == before and gate.records("decision")[-1]["code"] == code

    asyncio.run(scenario())


def test_other_tools_of_the_device_wait_for_it_as_ever() -> None:
    found = published.parse(resolve(Policy(), TOOLS.values(), ()))
    assert {name: item.buses for name, item in found.tools.items()} == {
        "arm_move": ("arm",),
        "arm_stop": (),
        "arm_read": ("arm",),
    }


@pytest.mark.parametrize("odd", [1, "yes", None, []])
def test_a_policy_file_with_a_strange_word_on_stopping_is_refused(odd: object) -> None:
    document = resolve(Policy(), TOOLS.values(), ())
    document["tools"]["arm_stop"]["stops"] = odd
    with pytest.raises(published.PolicyInvalid, match="stops"):
        published.parse(document)
