"""What is on the log at which moment, and what happens while nothing can be written anywhere."""

import asyncio
import contextlib
import os
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import mcp_types
import pytest
from gated import MODES, Gated, gated, tool_policy
from mcp.shared.exceptions import MCPError

from octoform.server.gate.calls import HELD

place: list[Path] = []
moved: list[int] = []


@contextlib.asynccontextmanager
async def full(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[None]:
    """Inside this the process's own log stands on a disk without room."""
    with Path("/dev/full").open("w", encoding="utf-8") as stderr:
        monkeypatch.setattr(sys, "stderr", stderr)
        try:
            yield
        finally:
            monkeypatch.undo()
            somewhere = os.open(os.devnull, os.O_WRONLY)  # closing writes what is left
            os.dup2(somewhere, stderr.fileno())
            os.close(somewhere)


def peek() -> str:
    """The log while a reading runs."""
    return (place[-1] / "log" / "audit.jsonl").read_text()


def look() -> int:
    """Read."""
    return 7


def move(steps: int = 1) -> int:
    """Move."""
    moved.append(steps)
    return steps


def free(gate: Gated) -> bool:
    return not any(queue.holders for queue in gate.gate._entries.queues())


@pytest.mark.parametrize("mode", MODES)
def test_the_decision_about_a_reading_is_written_before_it_begins(tmp_path: Path, mode: str) -> None:
    place.append(tmp_path)

    async def scenario() -> None:
        async with gated(tmp_path, {peek: tool_policy("read")}) as gate, gate.client(mode) as client:
            assert '"event":"decision"' in (await client.call_tool("peek", {})).data

    asyncio.run(scenario())


def test_the_outcome_of_a_reading_comes_with_the_others_of_its_quarter_second(tmp_path: Path) -> None:
    place.append(tmp_path)

    async def scenario() -> None:
        async with gated(tmp_path, {look: tool_policy("read")}) as gate, gate.client() as client:
            for _ in range(3):
                await client.call_tool("look", {})
            loop = asyncio.get_running_loop()
            deadline = loop.time() + HELD * 20
            while peek().count('"event":"outcome"') < 3:
                assert loop.time() < deadline, "it did not come to pass"
                await asyncio.sleep(0.01)

    asyncio.run(scenario())


@pytest.mark.parametrize("mode", MODES)
def test_without_any_room_nothing_moves_readings_go_on_and_no_bus_is_kept(
    tmp_path: Path, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    moved.clear()

    async def scenario() -> None:
        tools = {look: tool_policy("read", buses=["arm"]), move: tool_policy(buses=["arm"])}
        async with gated(tmp_path, tools) as gate, gate.client(mode) as client, full(monkeypatch):
            gate.gate._records._audit.close()  # as any other reason why nothing can be written
            for _ in range(3):
                refused = await client.call_tool("move", {}, raise_on_error=False)
                assert refused.is_error and refused.meta["octoform/refused"] == "audit"
                read = await client.call_tool("look", {})
                assert read.data == 7 and "not written" in read.meta["octoform/audit"]
            assert free(gate)

    asyncio.run(scenario())
    assert moved == []


def test_a_fault_of_the_gate_itself_keeps_no_bus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any) -> None:
        raise MemoryError

    async def scenario() -> None:
        tools = {move: tool_policy(buses=["arm"], limits=[{"kind": "rate", "calls": 9, "seconds": 1.0, "source": "x"}])}
        async with gated(tmp_path, tools) as gate, gate.client() as client:
            monkeypatch.setattr(gate.ledger, "reserve", broken)
            with pytest.raises(MCPError):
                await client.call_tool("move", {})
            assert free(gate) and gate.gate.status()["running"] == 0
            monkeypatch.undo()
            assert (await client.call_tool("move", {})).data == 1

    asyncio.run(scenario())


def test_an_approval_that_is_used_for_another_call_is_on_the_log(tmp_path: Path) -> None:
    moved.clear()
    answer = mcp_types.ElicitResult(action="accept", content={"value": True})

    async def scenario() -> None:
        async def person(*_: Any) -> Any:
            raise AssertionError

        policy = tool_policy("irreversible", decision="confirm")
        async with gated(tmp_path, {move: policy}) as gate, gate.client(elicitation_handler=person) as client:
            params = mcp_types.CallToolRequestParams(name="move", arguments={"steps": 1})
            request = mcp_types.CallToolRequest(params=params)
            asked = await client.session.send_request(request, mcp_types.InputRequiredResult)
            state = asked.request_state
            other = mcp_types.CallToolRequestParams(
                name="move", arguments={"steps": 9}, request_state=state, input_responses={"approval": answer}
            )
            with pytest.raises(MCPError):
                await client.session.send_request(mcp_types.CallToolRequest(params=other), mcp_types.CallToolResult)
            last = gate.records()[-1]
            lines = (last["event"], last["tool"], last["caller"], last["decision"], last["code"])
            assert lines == ("decision", "move", "local", "refuse", "replayed")

    asyncio.run(scenario())
    assert moved == []
