"""An emergency stop and calls that come, wait, are approved or tidy up at that very moment."""

import asyncio
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fastmcp.client.elicitation import ElicitResult
from gated import Gated, gated, tool_policy
from launched import launched, tool
from raw_mcp import RawClient, call
from unit.server.server_lines import Line

from octoform.policy.published import StopAction
from octoform.server import emergency_stop as stopping
from octoform.server.audit.audit_log import Audit
from octoform.server.emergency_stop import Emergency
from octoform.server.execution.watchdog import Interrupted, Job, Workers
from octoform.server.latch import Latch

STOP = b"STOP"
RATE = {"kind": "rate", "calls": 1000, "seconds": 60.0, "source": "bench"}
begun, may_end = threading.Event(), threading.Event()
moved: list[str] = []
line: list[str] = []


@pytest.fixture(autouse=True)
def _still() -> None:
    begun.clear()
    may_end.clear()
    moved.clear()
    line.clear()


def move() -> str:
    """Move the arm."""
    moved.append("move")
    return "moved"


def tidy() -> None:
    """Goes home whenever it ends."""
    begun.set()
    try:
        while True:
            time.sleep(0.002)
    finally:
        write(b"HOME")


def deaf() -> str:
    """Takes every exception for its own until it may end, and then goes home."""
    begun.set()
    while not may_end.is_set():
        try:
            time.sleep(0.002)
        except BaseException:  # noqa: BLE001 - that is what it is here for
            moved.append("interrupted")
    write(b"HOME")
    return "late"


def hold() -> str:
    """Keeps the bus until it may end; a reading, which no emergency stop interrupts."""
    begun.set()
    may_end.wait(20)
    return "held"


def write(data: bytes) -> None:
    descriptor = os.open(line[0], os.O_WRONLY | os.O_NOCTTY)
    os.write(descriptor, data)
    os.close(descriptor)


def emergency(gate: Gated, *actions: StopAction) -> Emergency:
    return Emergency(gate.latch, Audit.open(gate.folder / "log"), actions)


def in_a_thread(work: Callable[[], Any]) -> Any:
    """What ``work`` gives back, done in a thread of its own while this one waits, as the control thread does it."""
    found: list[Any] = []
    thread = threading.Thread(target=lambda: found.append(work()))
    thread.start()
    thread.join(20)
    return found[0]


class Moment:
    """A clock that does something once, in the middle of a call: the limits ask it just before the tool begins."""

    def __init__(self) -> None:
        self.work: Callable[[], Any] | None = None
        self.answer: Any = None

    def __call__(self) -> float:
        work, self.work = self.work, None
        if work is not None:
            self.answer = in_a_thread(work)
        return time.monotonic()


async def until(condition: Callable[[], Any], seconds: float = 10) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not come to pass"
        await asyncio.sleep(0.01)


async def text_of(client: Any, name: str) -> str:
    result = await client.call_tool(name, {}, raise_on_error=False)
    assert result.is_error, result
    return str(result.content[0].text)


async def amove() -> str:
    return move()


@pytest.mark.parametrize("which", [move, amove], ids=["blocking", "async"])
@pytest.mark.parametrize("whose", ["its own", "of another process"])
def test_a_call_that_was_judged_before_a_stop_does_not_begin_after_it(
    tmp_path: Path, which: Callable[[], Any], whose: str
) -> None:
    async def scenario() -> None:
        moment = Moment()
        async with gated(tmp_path, {which: tool_policy(limits=[RATE])}, clock=moment) as gate, gate.client() as client:
            stop = emergency(gate)
            interrupt = gate.gate.halt if whose == "its own" else None
            moment.work = lambda: stop.stop("ada", "smoke", interrupt=interrupt)
            assert "was not begun, because an emergency stop came" in await text_of(client, which.__name__)
            assert (moment.answer["ok"], moment.answer["problems"]) == (True, [])
            assert ("estop",) in gate.counted() and gate.gate.status()["running"] == 0
            stop.clear("eve")
            assert (await client.call_tool(which.__name__, {})).data == "moved"

    asyncio.run(scenario())
    assert moved == ["move"]


@pytest.mark.parametrize("which", [move, amove], ids=["blocking", "async"])
def test_a_halt_alone_keeps_a_call_from_beginning(tmp_path: Path, which: Callable[[], Any]) -> None:
    async def scenario() -> None:
        moment = Moment()
        policy = tool_policy("read", limits=[RATE])
        async with gated(tmp_path, {which: policy}, clock=moment) as gate, gate.client() as client:
            moment.work = lambda: gate.gate.halt("shutdown", everything=True)
            assert "was not begun, because the endpoint ends" in await text_of(client, which.__name__)
            assert [each.over for each in moment.answer] == [True]

    asyncio.run(scenario())
    assert moved == []


def test_work_that_was_halted_on_its_way_to_its_thread_does_not_begin() -> None:
    async def scenario() -> None:
        workers = Workers()
        found: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        job = Job(move, lambda value, problem: found.set_result(problem))
        job.interrupt()
        workers.start(job)
        assert isinstance(await found, Interrupted) and job.over
        workers.close()

    asyncio.run(scenario())
    assert moved == []


def test_stop_bytes_are_the_last_that_a_device_hears(tmp_path: Path) -> None:
    wire = Line()
    line.append(wire.node)

    async def scenario() -> None:
        async with gated(tmp_path, {tidy: tool_policy()}) as gate, gate.client() as client:
            stop = emergency(gate, StopAction("arm", "tty", None, STOP, "bench"))
            calling = asyncio.create_task(text_of(client, "tidy"))
            await until(begun.is_set)
            answer = await asyncio.to_thread(stop.stop, "ada", "smoke", lambda *_: wire.node, gate.gate.halt)
            assert (answer["ok"], answer["problems"]) == (True, [])
            assert "emergency stop: tidy was interrupted" in await calling

    asyncio.run(scenario())
    data = wire.received(len(STOP) * 2 + len(b"HOME"))
    wire.close()
    assert data.count(b"HOME") == 1 and data.endswith(STOP) and not data.startswith(b"HOMEHOME")


def test_what_runs_is_interrupted_before_anything_is_written(tmp_path: Path) -> None:
    order: list[str] = []

    def interrupt() -> list[stopping.Running]:
        order.append("interrupt")
        return []

    def find(device: str, kind: str) -> str:
        order.append("find")
        raise OSError("there is no such device")

    stop = Emergency(Latch(tmp_path / "run/estop.json"), None, (StopAction("arm", "tty", None, STOP, "bench"),))
    stop.stop("ada", "smoke", find, interrupt)
    assert order[0] == "interrupt" and "find" in order


def test_code_that_goes_on_is_a_problem_and_hears_the_stop_bytes_when_it_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stopping, "ENDING", 0.05)
    wire = Line()
    line.append(wire.node)

    async def scenario() -> None:
        async with gated(tmp_path, {deaf: tool_policy()}) as gate, gate.client() as client:
            stop = emergency(gate, StopAction("arm", "tty", None, STOP, "bench"))
            calling = asyncio.create_task(text_of(client, "deaf"))
            await until(begun.is_set)
            answer = await asyncio.to_thread(stop.stop, "ada", "smoke", lambda *_: wire.node, gate.gate.halt)
            assert (answer["ok"], answer["latched"]) == (False, True)
            assert answer["problems"] == ["deaf was interrupted, but its code has not ended yet"]
            await calling
            assert wire.received(len(STOP)) == STOP
            may_end.set()
            await until(lambda: len(gate.records("estop_actions")) == 2)
            assert await asyncio.to_thread(wire.received, len(b"HOME") + len(STOP)) == b"HOME" + STOP

    asyncio.run(scenario())
    wire.close()
    assert "interrupted" in moved


def test_a_call_that_waits_for_its_bus_does_not_outlast_a_stop(tmp_path: Path) -> None:
    async def scenario() -> None:
        tools = {hold: tool_policy("read", buses=["arm"]), move: tool_policy(buses=["arm"])}
        async with gated(tmp_path, tools) as gate, gate.client() as one, gate.client("legacy") as two:
            stop = emergency(gate)
            holding = asyncio.create_task(one.call_tool("hold", {}))
            await until(begun.is_set)
            waiting = asyncio.create_task(text_of(two, "move"))
            await until(lambda: gate.gate._entries.queues()[0]._waiting)
            stop.stop("ada", "smoke", interrupt=gate.gate.halt)
            stop.clear("eve")
            may_end.set()
            assert "it came after this call did" in await waiting
            assert (await holding).data == "held"
            assert (await two.call_tool("move", {})).data == "moved"

    asyncio.run(scenario())
    assert moved == ["move"]


@pytest.mark.parametrize("mode", ["auto", "legacy"])
def test_an_approval_does_not_outlast_a_stop(tmp_path: Path, mode: str) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {move: tool_policy(decision="confirm")}) as gate:
            stop = emergency(gate)

            async def person(*_: Any) -> Any:
                stop.stop("ada", "smoke", interrupt=gate.gate.halt)
                stop.clear("eve")
                return ElicitResult(action="accept", content={"value": True})

            async with gate.client(mode, elicitation_handler=person) as client:
                text = await text_of(client, "move")
            assert "emergency stop" in text
            assert gate.counted()[-1] in {("refuse", "replayed"), ("refuse", "estop")}

    asyncio.run(scenario())
    assert moved == []


SERVER = """
from fastmcp import FastMCP
mcp = FastMCP("bench")

@mcp.tool
def erase() -> str:
    return "erased"
"""


def test_clearing_voids_what_was_approved_before_another_process_latched(tmp_path: Path) -> None:
    able: dict[str, Any] = {"io.modelcontextprotocol/clientCapabilities": {"elicitation": {"form": {}}}}
    tools = [tool("erase", "irreversible", "usb-1")]

    async def scenario() -> None:
        policy = {"tools": {"erase": {"decision": "confirm"}}}
        with launched(tmp_path, SERVER, tools, policy=policy) as endpoint:
            async with RawClient(endpoint.layout.run / "endpoint.sock") as client:
                asked = await client.ask(call("erase", {}, **able))
                Latch(endpoint.layout.run / "estop.json").engage("ada", "the process did not answer")
                assert endpoint.ask("clear_estop", by="eve")["latched"] is False
                again = call("erase", {}, **able)
                again["params"]["requestState"] = asked["result"]["requestState"]
                word = {"action": "accept", "content": {"value": True}}
                again["params"]["inputResponses"] = {"approval": word}
                answer = (await client.ask(again))["result"]
                assert answer["isError"] and answer["_meta"]["octoform/refused"] == "replayed"

    asyncio.run(scenario())
