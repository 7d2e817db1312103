"""What comes back: bounded, by the schema, without internals, and with signs of life on the way."""

import asyncio
import json
import logging
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mcp_types
import pytest
from fastmcp import Context
from fastmcp.exceptions import ToolError
from fastmcp.tools.base import ToolResult
from gated import MODES, gated, tool_policy
from hypothesis import given
from hypothesis import strategies as some
from jsonschema import Draft202012Validator
from mcp.shared.exceptions import MCPError
from pydantic import BaseModel

from octoform.server.execution.result_size import at_least, exceeds
from octoform.server.gate import gate as beating
from octoform.server.gate.argument_validation import check, coercion

SMALL = tool_policy("read", result_bytes=2000)


def text(size: int) -> str:
    return "x" * size


def numbers(size: int) -> list[int]:
    return list(range(size))


def endless() -> Iterator[str]:
    while True:
        yield "x" * 100


async def later(size: int) -> dict[str, str]:
    return {"text": "x" * size}


@pytest.mark.parametrize("mode", MODES)
def test_a_result_has_a_bound(tmp_path: Path, mode: str) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, dict.fromkeys((text, numbers, later, endless), SMALL)) as gate:
            async with gate.client(mode) as client:
                for name in ("text", "numbers", "later"):
                    assert not (await client.call_tool(name, {"size": 100})).is_error
                    result = await client.call_tool(name, {"size": 5000}, raise_on_error=False)
                    assert result.is_error and "of at most 2000" in result.content[0].text
                assert (await client.call_tool("endless", {}, raise_on_error=False)).is_error
            gate.gate.disarm()
            assert [each["outcome"] for each in gate.records("outcome")].count("too_large") == 4

    asyncio.run(scenario())


def test_fifty_megabytes_hold_nobody_up(tmp_path: Path) -> None:
    async def scenario() -> None:
        bounded = tool_policy("read", result_bytes=10_000_000)
        tools = dict.fromkeys((text, numbers, later), bounded)
        async with gated(tmp_path, tools) as gate, gate.client() as client, gate.client("legacy") as other:
            for name, size in (("text", 50_000_000), ("numbers", 3_000_000), ("later", 50_000_000)):
                large = asyncio.create_task(client.call_tool(name, {"size": size}, raise_on_error=False))
                slowest = 0.0
                while not large.done():
                    before = time.monotonic()
                    await other.call_tool("text", {"size": 1})
                    slowest = max(slowest, time.monotonic() - before)
                assert (await large).is_error and slowest < 1.0, (name, slowest)

    asyncio.run(scenario())


PLAIN = some.none() | some.booleans() | some.integers(-(2**63), 2**63) | some.text(some.characters(codec="utf-8"))


@given(
    some.recursive(
        PLAIN, lambda inner: some.lists(inner) | some.dictionaries(some.text(max_size=3), inner), max_leaves=20
    )
)
def test_the_estimate_is_never_above_the_size(value: Any) -> None:
    size = len(json.dumps(value, ensure_ascii=False, separators=(",", ":")).encode())
    assert at_least(value, 10**9) <= size
    assert exceeds(value, size) is None and (size < 2 or exceeds(value, size - 1) == size)


class Inside(BaseModel):
    value: int


def broken(kind: str) -> str:
    if kind == "exit":
        raise SystemExit(3)
    if kind == "model":
        Inside.model_validate({"value": "x"})
    if kind == "protocol":
        raise MCPError(code=-32000, message="secret /dev/ttyUSB7")
    if kind == "cancelled":
        raise asyncio.CancelledError("secret")
    if kind == "told":
        raise ToolError("the arm is folded") from ValueError("secret")
    raise ValueError("secret /dev/ttyUSB7")


def unspeakable() -> dict[str, Any]:
    return {"port": Secretive()}


class Secretive:
    def __repr__(self) -> str:
        return "secret /dev/ttyUSB7"


async def broken_async(kind: str) -> str:
    return broken(kind)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("tool", ["broken", "broken_async"])
def test_what_a_tool_did_not_mean_to_say_is_a_reference(
    tmp_path: Path, mode: str, tool: str, caplog: pytest.LogCaptureFixture
) -> None:
    async def scenario() -> None:
        tools = {broken: tool_policy("read"), broken_async: tool_policy("read")}
        async with gated(tmp_path, tools) as gate, gate.client(mode) as client:
            for kind in ("exit", "model", "protocol", "cancelled", "value"):
                caplog.clear()
                result = await client.call_tool(tool, {"kind": kind}, raise_on_error=False)
                found = result.content[0].text
                assert result.is_error and found.startswith("the tool failed inside (reference "), (kind, found)
                reference = found.removeprefix("the tool failed inside (reference ").rstrip(")")
                assert any(reference in each.getMessage() and each.exc_info for each in caplog.records)
                assert gate.records("outcome")[-1]["reference"] == reference
            result = await client.call_tool(tool, {"kind": "told"}, raise_on_error=False)
            assert result.is_error and result.content[0].text == "the arm is folded"

    with caplog.at_level(logging.ERROR, logger="octoform.server"):
        asyncio.run(scenario())


def test_a_result_that_cannot_be_said_is_a_reference_too(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {unspeakable: tool_policy("read")}) as gate, gate.client() as client:
            result = await client.call_tool("unspeakable", {}, raise_on_error=False)
            assert result.is_error and "(reference " in result.content[0].text, result

    asyncio.run(scenario())


def liar() -> int:
    return "seven"  # type: ignore[return-value]


def half() -> ToolResult:
    return ToolResult(content="x", structured_content={"volt": "many"})


@pytest.mark.parametrize("mode", MODES)
def test_a_result_that_breaks_its_schema_is_an_error_and_not_a_crash_of_the_client(
    tmp_path: Path, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {liar: tool_policy("read")}) as gate:
            schema = {"type": "object", "properties": {"volt": {"type": "number"}}, "required": ["volt"]}
            gate.server.tool(half, output_schema=schema)
            gate.gate._policy.tools["half"] = gate.gate._policy.tools["liar"]  # type: ignore[index]
            async with gate.client(mode) as client:
                result = await client.call_tool("liar", {}, raise_on_error=False)
                assert result.is_error and "the result.result is no integer" in result.content[0].text
                result = await client.call_tool("half", {}, raise_on_error=False)
                assert result.is_error and "the result.volt is no number" in result.content[0].text

    asyncio.run(scenario())


SCHEMAS: list[dict[str, Any]] = [
    {"type": "object", "properties": {"a": {"type": "integer", "minimum": 0}}, "required": ["a"]},
    {"type": "object", "additionalProperties": {"type": "number"}},
    {"type": "object", "properties": {"a": {"type": ["string", "null"]}}, "additionalProperties": False},
    {"type": "object", "properties": {"a": {"enum": [1, "x", None]}, "b": {"const": True}}},
    {"type": "array", "items": {"$ref": "#/$defs/N"}, "maxItems": 3, "$defs": {"N": {"type": "number"}}},
    {"anyOf": [{"type": "string", "minLength": 2}, {"type": "array", "prefixItems": [{"type": "boolean"}]}]},
    {"allOf": [{"type": "object"}, {"required": ["b"]}], "properties": {"b": {"exclusiveMaximum": 5}}},
    {"type": "object", "properties": {"a": {"$ref": "#"}}, "additionalProperties": False},
    {"type": "string", "pattern": "^[ab]*$"},
]
VALUES = some.recursive(
    some.none() | some.booleans() | some.integers(-3, 9) | some.floats(-3, 9) | some.text("abx", max_size=3),
    lambda inner: some.lists(inner, max_size=4) | some.dictionaries(some.sampled_from("abc"), inner, max_size=3),
    max_leaves=6,
)


@given(some.sampled_from(SCHEMAS), VALUES)
def test_the_comparison_says_what_the_standard_says(schema: dict[str, Any], value: Any) -> None:
    assert (check(schema)(value) is None) == Draft202012Validator(schema).is_valid(value)


def test_arguments_are_coerced_as_the_tool_will_see_them() -> None:
    def tool(count: int, ratio: float = 1.5, *, context: Context, name: str = "x") -> None:
        raise AssertionError

    assert coercion(tool, strict=False)({"count": "10", "ratio": 2}).shown == {"count": 10, "ratio": 2.0, "name": "x"}
    with pytest.raises(ValueError, match="count"):
        coercion(tool, strict=True)({"count": "10"})


TWICE = threading.Event()


def patient() -> int:
    """Returns once its client has heard of it twice."""
    TWICE.wait(20)
    return 1


async def reporting(context: Context) -> int:
    await asyncio.sleep(0.12)
    await context.report_progress(5, 10, "mine")
    return 1


@pytest.mark.parametrize("mode", MODES)
def test_a_long_call_sends_signs_of_life_that_grow_and_end(
    tmp_path: Path, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(beating.Beat.__init__, "__defaults__", (0.02,))
    seen: list[tuple[float, str | None]] = []

    async def note(progress: float, total: float | None, message: str | None) -> None:
        seen.append((progress, message))
        if len(seen) == 2:
            TWICE.set()

    async def scenario() -> None:
        TWICE.clear()
        tools = {patient: tool_policy("read"), reporting: tool_policy("read")}
        async with gated(tmp_path, tools) as gate, gate.client(mode) as client:
            await client.call_tool("patient", {}, progress_handler=note)
            count = len(seen)
            times = [each for each, _ in seen]
            assert count >= 2 and times == sorted(set(times)) and seen[0][1] == "patient is running"
            await client.call_tool("patient", {})
            await client.call_tool("reporting", {}, progress_handler=note)
            assert seen[count:] == [(5, "mine")]

    asyncio.run(scenario())


def test_a_tool_may_ask_the_client_itself(tmp_path: Path) -> None:
    def asks() -> mcp_types.InputRequiredResult:
        params = mcp_types.ElicitRequestFormParams(message="?", requested_schema={"type": "object", "properties": {}})
        return mcp_types.InputRequiredResult(
            result_type="input_required", input_requests={"q": mcp_types.ElicitRequest(params=params)}
        )

    async def scenario() -> None:
        async with gated(tmp_path, {asks: tool_policy("read")}) as gate, gate.client() as client:
            params = mcp_types.CallToolRequestParams(name="asks", arguments={})
            request = mcp_types.CallToolRequest(params=params)
            answer = await client.session.send_request(request, mcp_types.InputRequiredResult)
            assert answer.result_type == "input_required"

    asyncio.run(scenario())
