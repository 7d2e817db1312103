"""Which values a limit is about, how much a tool may give back, and how long it has."""

import asyncio
import threading
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Annotated, Any

import pytest
from gated import MODES, gated, tool_policy
from pydantic import AliasChoices, Field

from octoform.server.execution.work import current
from octoform.server.gate.argument_validation import coercion

RANGE = {"kind": "range", "parameter": "steps", "minimum": 0, "maximum": 100, "unit": "", "source": "bench"}
begun, may_end = threading.Event(), threading.Event()
drawn: list[int] = []
moved: list[int] = []


@pytest.fixture(autouse=True)
def _fresh() -> None:
    begun.clear()
    may_end.clear()
    drawn.clear()
    moved.clear()


def alias(n: Annotated[int, Field(alias="steps")]) -> int:
    """Called n in the code and steps in the schema."""
    moved.append(n)
    return n


def plain(steps: int) -> int:
    moved.append(steps)
    return steps


def other(distance: int) -> int:
    moved.append(distance)
    return distance


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("tool", [alias, plain], ids=["alias", "plain"])
def test_a_limit_holds_by_the_name_in_the_schema(tmp_path: Path, mode: str, tool: Callable[..., Any]) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {tool: tool_policy(limits=[RANGE])}) as gate, gate.client(mode) as client:
            refused = await client.call_tool(tool.__name__, {"steps": 500}, raise_on_error=False)
            assert refused.is_error and "above the most that is allowed, 100" in refused.content[0].text
            assert (await client.call_tool(tool.__name__, {"steps": "50"})).data == 50
            assert gate.records("decision")[-1]["arguments"] == {"steps": 50}

    asyncio.run(scenario())
    assert moved == [50]


def joints(pan: int, n: Annotated[int, Field(alias="lift")], free: int = 0) -> int:
    """Two joints with limits of their own, one under another name in the code."""
    moved.extend((pan, n))
    return free


@pytest.mark.parametrize("over", ["pan", "lift"])
@pytest.mark.parametrize("value", [101, -1, "500", float("nan"), "far", None, 1e300])
def test_each_of_several_parameters_is_held_by_its_own_limit(tmp_path: Path, over: str, value: object) -> None:
    async def scenario() -> None:
        limits = [{**RANGE, "parameter": name} for name in ("pan", "lift")]
        async with gated(tmp_path, {joints: tool_policy(limits=limits)}) as gate, gate.client() as client:
            good = {"pan": 1, "lift": 2, "free": 5000}
            for hostile in ({over: value}, {over: value, "n": 1}, {"n": 1}):
                refused = await client.call_tool("joints", {**good, **hostile}, raise_on_error=False)
                assert refused.is_error, hostile
            assert (await client.call_tool("joints", good)).data == 5000

    asyncio.run(scenario())
    assert moved == [1, 2]


def test_a_limit_that_is_about_no_argument_refuses(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {other: tool_policy(limits=[RANGE])}) as gate, gate.client() as client:
            refused = await client.call_tool("other", {"distance": 1}, raise_on_error=False)
            assert refused.is_error and refused.meta["octoform/refused"] == "limit_without_argument"
            assert "its limit on steps (bench) cannot be kept" in refused.content[0].text

    asyncio.run(scenario())
    assert moved == []


def test_arguments_are_shown_by_the_names_of_the_schema_and_passed_by_those_of_the_code() -> None:
    def tool(
        first: int,
        n: Annotated[int, Field(alias="steps")],
        either: Annotated[int, Field(validation_alias=AliasChoices("x", "y"))] = 3,
        *,
        last: Annotated[int, Field(alias="end", default_factory=lambda: 7)],
    ) -> tuple[int, ...]:
        return first, n, either, last

    found = coercion(tool, strict=False)({"first": "1", "steps": 2, "y": 5})
    assert found.shown == {"first": 1, "steps": 2, "either": 5, "end": 7}
    assert tool(*found.args, **found.kwargs) == (1, 2, 5, 7)


async def endless() -> AsyncIterator[str]:
    """Yields without end, for the bound to end it."""
    try:
        while len(drawn) < 10_000:
            drawn.append(1)
            yield "x" * 1000
    finally:
        drawn.append(-1)


@pytest.mark.parametrize("mode", MODES)
def test_an_async_generator_is_drawn_no_further_than_its_result_may_go(tmp_path: Path, mode: str) -> None:
    async def scenario() -> None:
        policy = tool_policy("read", result_bytes=20_000)
        async with gated(tmp_path, {endless: policy}) as gate, gate.client(mode) as client:
            result = await client.call_tool("endless", {}, raise_on_error=False)
            assert result.is_error and "the result is too large" in result.content[0].text

    asyncio.run(scenario())
    assert drawn.count(1) <= 21 and drawn[-1] == -1  # and it could tidy up


def hold() -> int:
    begun.set()
    may_end.wait(20)
    return 1


def left() -> float:
    """The seconds that this call still has."""
    work = current.get()
    assert work is not None
    return work.deadline - time.monotonic()


def test_what_moves_has_its_whole_time_however_long_it_waited(tmp_path: Path) -> None:
    async def scenario() -> None:
        bus: dict[str, Any] = {"timeout": 5.0, "buses": ["arm"]}
        async with gated(tmp_path, {hold: tool_policy("read", **bus), left: tool_policy(**bus)}) as gate:
            async with gate.client() as one, gate.client() as two:
                holding = asyncio.create_task(one.call_tool("hold", {}))
                waiting = asyncio.create_task(two.call_tool("left", {}))
                line = gate.gate._entries.queues()[0]
                while not line._waiting:
                    await asyncio.sleep(0.005)
                since = time.monotonic()
                while time.monotonic() - since < 0.5:  # what it waits at least
                    await asyncio.sleep(0.05)
                may_end.set()
                assert (await waiting).data > 4.75
                await holding
            assert gate.records("outcome")[-1]["ms"] < 500

    asyncio.run(scenario())
