"""Who may call what, in which order it is judged, and what is written about it: real clients of both eras."""

import asyncio
from pathlib import Path
from typing import Any

import pytest
from fastmcp.exceptions import ToolError
from gated import MODES, Gated, gated, tool_policy

from octoform.server.audit.audit_log import verify
from octoform.server.process import principal
from octoform.server.process.principal import Principal

READER = Principal("reader", frozenset({"read"}), "http")
RANGE = {"kind": "range", "parameter": "steps", "minimum": -100, "maximum": 100, "unit": "steps", "source": "profile"}
RATE = {"kind": "rate", "calls": 1, "seconds": 60.0, "source": "policy.limits[0]"}
moved: list[Any] = []


@pytest.fixture(autouse=True)
def _still() -> None:
    moved.clear()


def move(steps: int, slow: bool = False) -> int:
    """Move the rail."""
    moved.append(steps)
    return steps


def look() -> int:
    """Read the rail."""
    moved.append("look")
    return 7


async def text_of(gate: Gated, mode: str, name: str, arguments: dict[str, Any] | None = None, **more: Any) -> str:
    async with gate.client(mode) as client:
        result = await client.call_tool(name, arguments or {}, raise_on_error=False, **more)
    assert result.is_error, result
    return str(result.content[0].text)


@pytest.mark.parametrize("mode", MODES)
def test_a_call_that_runs_leaves_its_decision_and_its_outcome(tmp_path: Path, mode: str) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {move: tool_policy(), look: tool_policy("read")}) as gate:
            async with gate.client(mode) as client:
                assert (await client.call_tool("move", {"steps": "10"})).data == 10
                assert (await client.call_tool("look", {})).data == 7
            gate.gate.disarm()
            assert gate.counted() == [("allow",), ("ok",), ("allow",), ("ok",)]
            first, second = gate.records()[:2]
            assert first["call"] == second["call"] and first["arguments"] == {"steps": 10, "slow": False}
            assert first["caller"] == "local" and second["ms"] > 0

    asyncio.run(scenario())
    assert moved == [10, "look"] and verify(tmp_path / "log").ok


@pytest.mark.parametrize("mode", MODES)
def test_a_token_without_the_effect_cannot_tell_the_tool_from_one_that_is_not_there(
    tmp_path: Path, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {move: tool_policy(), look: tool_policy("read")}) as gate:
            monkeypatch.setattr(principal, "current", lambda: READER)
            assert await text_of(gate, mode, "move", {"steps": 1}) == "Unknown tool: 'move'"
            assert await text_of(gate, mode, "nowhere") == "Unknown tool: 'nowhere'"
            assert gate.counted() == [("refuse", "hidden_tool"), ("refuse", "unknown_tool")]

    asyncio.run(scenario())
    assert moved == []


@pytest.mark.parametrize("mode", MODES)
def test_the_emergency_stop_refuses_what_moves_and_says_who_and_why(tmp_path: Path, mode: str) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {move: tool_policy(), look: tool_policy("read")}, mode="shadow") as gate:
            gate.latch.engage("alice", "smoke")
            text = await text_of(gate, mode, "move", {"steps": "no number"})
            assert "alice" in text and "smoke" in text and "estop -clear" in text
            async with gate.client(mode) as client:
                assert (await client.call_tool("look", {})).data == 7
                gate.latch.clear("alice")
                assert (await client.call_tool("move", {"steps": 1})).data == 1

    asyncio.run(scenario())


def test_denied_absent_invalid_and_limited_are_told_apart_in_this_order(tmp_path: Path) -> None:
    async def scenario() -> None:
        denied = tool_policy(decision="deny", source="policy.rules[2]", limits=[RATE])
        async with gated(tmp_path, {move: tool_policy(limits=[RANGE, RATE]), look: denied}) as gate:
            gate.there.gone = {"move": ["Camera rail"], "look": ["Camera rail"]}
            assert "Camera rail" in await text_of(gate, "auto", "move", {"steps": "x"})
            gate.there.gone = {}
            assert "policy.rules[2]" in await text_of(gate, "auto", "look")
            assert "steps of move does not fit" in await text_of(gate, "auto", "move", {"steps": "x"})
            assert "no argument" in await text_of(gate, "auto", "move", {"steps": 1, "force": True})
            assert "100" in await text_of(gate, "auto", "move", {"steps": "500"})
            async with gate.client() as client:  # none of these used up the one call of a minute
                assert (await client.call_tool("move", {"steps": 5})).data == 5
            assert "60" in await text_of(gate, "auto", "move", {"steps": 5})
            codes = [each["code"] for each in gate.records("decision") if "code" in each]
            assert codes == ["absent", "denied", "invalid", "invalid", "range", "rate"]

    asyncio.run(scenario())
    assert moved == [5]


def test_a_default_counts_for_a_limit_as_a_value_does(tmp_path: Path) -> None:
    def turn(steps: int = 500) -> int:
        moved.append(steps)
        return steps

    async def scenario() -> None:
        async with gated(tmp_path, {turn: tool_policy(limits=[RANGE])}) as gate:
            assert "100" in await text_of(gate, "auto", "turn")

    asyncio.run(scenario())
    assert moved == []


@pytest.mark.parametrize("mode", MODES)
def test_shadow_mode_lets_pass_and_notes_what_would_be_refused(tmp_path: Path, mode: str) -> None:
    async def scenario() -> None:
        what = tool_policy("irreversible", decision="confirm", limits=[RANGE])
        async with gated(tmp_path, {move: what, look: tool_policy("read", decision="deny")}, mode="shadow") as gate:
            async with gate.client(mode) as client:
                assert (await client.call_tool("move", {"steps": 500})).data == 500
                assert (await client.call_tool("look", {})).data == 7
            gate.gate.disarm()
            noted = [each["shadow"] for each in gate.records("decision")]
            assert [[text.partition(":")[0] for text in each] for each in noted] == [["range", "confirm"], ["denied"]]

    asyncio.run(scenario())


def empty() -> None:
    moved.append("empty")


@pytest.mark.parametrize("mode", MODES)
def test_a_dry_run_touches_nothing_and_counts_nothing(tmp_path: Path, mode: str) -> None:
    async def scenario() -> None:
        tools = {move: tool_policy(limits=[RATE]), empty: tool_policy(), look: tool_policy("read")}
        async with gated(tmp_path, tools) as gate, gate.client(mode) as client:
            asked = {"octoform/dry_run": True}
            for _ in range(2):
                result = await client.call_tool("move", {"steps": "5"}, meta=asked, raise_on_error=False)
                # Its schema promises a number, and a client refuses a result without one that is no error.
                assert result.is_error and '{"steps": 5, "slow": false}' in result.content[0].text
                assert result.meta is not None and result.meta["octoform/dry_run"] is True
            result = await client.call_tool("empty", {}, meta=asked)
            assert not result.is_error and "nothing was done" in result.content[0].text
            result = await client.call_tool("look", {}, meta=asked, raise_on_error=False)
            assert "look would be called" in result.content[0].text
            assert [each["decision"] for each in gate.records("decision")] == ["dry_run"] * 4
            assert moved == [], "a reading neither: it may be a picture"
            assert (await client.call_tool("move", {"steps": 5})).data == 5

    asyncio.run(scenario())


def test_in_dry_run_mode_actuators_answer_what_would_be_done(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {move: tool_policy(), look: tool_policy("read")}, mode="dry_run") as gate:
            assert "dry run" in await text_of(gate, "auto", "move", {"steps": 5})
            async with gate.client() as client:
                assert (await client.call_tool("look", {})).data == 7

    asyncio.run(scenario())
    assert moved == ["look"]


def test_without_an_audit_log_nothing_moves_and_readings_say_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {move: tool_policy(), look: tool_policy("read")}) as gate:
            gate.gate._records._audit.close()
            assert "audit log cannot be written" in await text_of(gate, "auto", "move", {"steps": 5})
            async with gate.client() as client:
                result = await client.call_tool("look", {})
            assert result.data == 7 and result.meta is not None and "not written" in result.meta["octoform/audit"]
            assert gate.gate.status()["audit"]

    asyncio.run(scenario())
    assert moved == ["look"]


def test_a_tool_that_the_policy_does_not_know_is_not_there(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {look: tool_policy("read")}) as gate:
            gate.server.tool(move)
            assert await text_of(gate, "auto", "move", {"steps": 1}) == "Unknown tool: 'move'"

    asyncio.run(scenario())
    assert moved == []


def test_the_server_is_asked_when_it_shows_and_hides_tools_itself(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {look: tool_policy("read")}) as gate, gate.client() as client:
            assert (await client.call_tool("look", {})).data == 7
            tool = await gate.server.get_tool("look")
            assert tool is not None
            gate.server.local_provider.remove_tool("look")
            with pytest.raises(ToolError, match="Unknown tool"):
                await client.call_tool("look", {})
            gate.server.add_tool(tool)
            assert (await client.call_tool("look", {})).data == 7
            gate.server.disable(names={"look"})
            with pytest.raises(ToolError, match="Unknown tool"):
                await client.call_tool("look", {})

    asyncio.run(scenario())
