"""Calls that hang, are cancelled or stopped: real threads, real clients, and what the others notice of it."""

import asyncio
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from gated import MODES, Gated, gated, tool_policy

from octoform.server.execution.watchdog import Interrupted, Job, Worker, Workers
from octoform.server.execution.work import Patience

HASTE: dict[str, Any] = {"timeout": 0.2, "buses": ["rail"]}
ended = threading.Event()
begun = threading.Event()
gate_open = threading.Event()
log: list[str] = []


@pytest.fixture(autouse=True)
def _fresh() -> None:
    for event in (ended, begun, gate_open):
        event.clear()
    log.clear()


def spin() -> None:
    """Never returns by itself, and tidies up when it has to stop."""
    begun.set()
    try:
        while True:
            time.sleep(0.005)
    finally:
        ended.set()


def deaf() -> str:
    """Waits in a call that no exception reaches."""
    begun.set()
    gate_open.wait(20)
    ended.set()
    return "late"


def stubborn() -> str:
    """Takes every exception for its own, until it may go."""
    while not gate_open.is_set():
        try:
            while not gate_open.is_set():
                time.sleep(0.005)
        except BaseException:  # noqa: BLE001 - that is what it is here for
            log.append("interrupted")
    return "late"


async def sleepy() -> None:
    begun.set()
    try:
        await asyncio.sleep(60)
    finally:
        ended.set()


async def obstinate() -> str:
    while not gate_open.is_set():
        try:
            await asyncio.sleep(0.01)
        except asyncio.CancelledError:
            log.append("interrupted")
    return "late"


def quick(value: int = 1) -> int:
    log.append(f"quick {value}")
    return value


def free() -> int:
    """Needs no bus."""
    return 2


async def until(condition: Callable[[], Any], seconds: float = 10) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not come to pass"
        await asyncio.sleep(0.01)


async def error(client: Any, name: str) -> str:
    result = await client.call_tool(name, {}, raise_on_error=False)
    assert result.is_error, result
    return str(result.content[0].text)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("tool", [spin, sleepy], ids=["blocking", "async"])
def test_a_call_that_does_not_return_is_stopped_and_its_bus_is_free_again(
    tmp_path: Path, mode: str, tool: Callable[[], Any]
) -> None:
    async def scenario() -> None:
        tools = {tool: tool_policy(**HASTE), quick: tool_policy(buses=["rail"])}
        async with gated(tmp_path, tools) as gate, gate.client(mode) as client:
            before = time.monotonic()
            assert "did not return within its 0.2 s and was stopped" in await error(client, tool.__name__)
            assert time.monotonic() - before < 5 and ended.is_set()
            assert (await client.call_tool("quick", {})).data == 1
            assert gate.gate.stuck() == [] and gate.gate.status()["running"] == 0
            assert gate.counted()[:2] == [("allow",), ("timeout",)]

    asyncio.run(scenario())


@pytest.mark.parametrize("tool", [deaf, stubborn, obstinate], ids=["deaf", "stubborn", "obstinate-async"])
def test_a_call_that_cannot_be_stopped_holds_its_bus_and_nothing_else(tmp_path: Path, tool: Callable[[], Any]) -> None:
    async def scenario() -> None:
        tools = {tool: tool_policy(**HASTE), quick: tool_policy(buses=["rail"]), free: tool_policy()}
        async with gated(tmp_path, tools) as gate, gate.client() as client, gate.client("legacy") as other:
            assert "has not ended yet" in await error(client, tool.__name__)
            waiting = asyncio.create_task(error(other, "quick"))
            await until(gate.gate.stuck)
            assert gate.gate.stuck()[0]["tool"] == tool.__name__ and gate.gate.stuck()[0]["buses"] == ["rail"]
            # Who waited already hears it as soon as a new caller, long before the 10 s of the waiting call.
            before = time.monotonic()
            for text in (await waiting, await error(other, "quick"), await error(client, tool.__name__)):
                assert f"rail is held by a call of {tool.__name__} that did not return" in text
            assert time.monotonic() - before < 5
            assert {each["code"] for each in gate.records("decision") if "code" in each} == {"stuck"}
            assert (await other.call_tool("free", {})).data == 2
            gate_open.set()
            await until(lambda: not gate.gate.stuck())
            assert (await other.call_tool("quick", {})).data == 1
            assert {"stuck", "ended"} <= {each["event"] for each in gate.records()}

    asyncio.run(scenario())
    assert tool is deaf or log.count("interrupted") >= 2


async def cancel(gate: Gated, mode: str, tool: str) -> None:
    """Call, wait until the device works, and take the call back as a client does."""
    async with gate.client(mode) as client:
        call = asyncio.create_task(client.call_tool(tool, {}))
        await until(begun.is_set)
        call.cancel()
        await asyncio.gather(call, return_exceptions=True)
        await until(ended.is_set)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("tool", [spin, sleepy], ids=["blocking", "async"])
def test_a_call_that_is_taken_back_stops_the_device(tmp_path: Path, mode: str, tool: Callable[[], Any]) -> None:
    async def scenario() -> None:
        tools = {tool: tool_policy(buses=["rail"]), quick: tool_policy(buses=["rail"])}
        async with gated(tmp_path, tools) as gate:
            await cancel(gate, mode, tool.__name__)
            async with gate.client(mode) as client:
                assert (await client.call_tool("quick", {})).data == 1
            assert gate.counted()[:2] == [("allow",), ("cancelled",)]

    asyncio.run(scenario())


def waits(bus: Any, calls: int) -> bool:
    return len(bus._waiting) == calls


def test_calls_of_a_bus_come_one_by_one_in_their_order(tmp_path: Path) -> None:
    async def scenario() -> None:
        tools = {deaf: tool_policy(buses=["rail", "arm"]), quick: tool_policy(buses=["arm"])}
        async with gated(tmp_path, tools) as gate, gate.client() as one, gate.client("legacy") as two:
            first = asyncio.create_task(one.call_tool("deaf", {}))
            await until(begun.is_set)
            calls = []
            for number in range(6):
                client = (one, two)[number % 2]
                calls.append(asyncio.create_task(client.call_tool("quick", {"value": number})))
                arm = gate.gate._entries._buses["arm"]
                await until(partial(waits, arm, number + 1))
            assert log == []
            gate_open.set()
            assert (await first).data == "late"
            await asyncio.gather(*calls)

    asyncio.run(scenario())
    assert log == [f"quick {number}" for number in range(6)]


def test_waiting_counts_and_the_answer_names_who_holds_the_bus(tmp_path: Path) -> None:
    async def scenario() -> None:
        tools = {deaf: tool_policy(buses=["rail"]), quick: tool_policy(**HASTE)}
        async with gated(tmp_path, tools) as gate, gate.client() as client:
            holding = asyncio.create_task(client.call_tool("deaf", {}))
            await until(begun.is_set)
            text = await error(client, "quick")
            assert "rail is busy: deaf (called by local) has held it for" in text
            gate_open.set()
            await holding
            assert ("refuse", "busy") in gate.counted()

    asyncio.run(scenario())
    assert log == []


def test_a_stop_while_a_call_waits_for_its_bus_is_seen(tmp_path: Path) -> None:
    async def scenario() -> None:
        tools = {deaf: tool_policy("read", buses=["rail"]), quick: tool_policy(buses=["rail"])}
        async with gated(tmp_path, tools) as gate, gate.client() as client:
            holding = asyncio.create_task(client.call_tool("deaf", {}))
            await until(begun.is_set)
            waiting = asyncio.create_task(error(client, "quick"))
            await until(lambda: gate.gate._entries._buses["rail"]._waiting)
            gate.latch.engage("alice", "")
            gate_open.set()
            await holding
            assert "emergency stop" in await waiting

    asyncio.run(scenario())
    assert log == []


@pytest.mark.parametrize("tool", [spin, sleepy], ids=["blocking", "async"])
def test_the_emergency_stop_interrupts_what_moves_and_no_reading(tmp_path: Path, tool: Callable[[], Any]) -> None:
    async def scenario() -> None:
        async with gated(tmp_path, {tool: tool_policy(), deaf: tool_policy("read")}) as gate, gate.client() as client:
            reading = asyncio.create_task(client.call_tool("deaf", {}))
            await until(begun.is_set)
            begun.clear()
            moving = asyncio.create_task(error(client, tool.__name__))
            await until(begun.is_set)
            found = threading.Thread(target=gate.gate.halt)  # as the control thread does
            found.start()
            assert "emergency stop" in await moving
            gate_open.set()
            assert (await reading).data == "late"
            found.join()

    asyncio.run(scenario())


def test_calls_that_hang_take_no_threads_from_the_others(tmp_path: Path) -> None:
    async def scenario() -> None:
        tools = {deaf: tool_policy("read", timeout=0.3), free: tool_policy("read")}
        patience = Patience(answer=0.01, stuck=0.05, again=0.5)
        async with gated(tmp_path, tools, patience=patience) as gate, gate.client() as client:
            calls = [asyncio.create_task(error(client, "deaf")) for _ in range(60)]
            await until(begun.is_set)
            assert (await client.call_tool("free", {})).data == 2
            answers = await asyncio.gather(*calls)
            assert sum("has not ended yet" in text for text in answers) == 8
            assert sum(text.startswith("the tool deaf is") for text in answers) == 52
            assert threading.active_count() < 40
            gate_open.set()
            await until(lambda: not gate.gate.status()["running"])

    asyncio.run(scenario())


def late_interrupts() -> int:
    """Ends in the very moment in which it gets the order to stop, again and again."""
    time.sleep(0.02)
    return 3


def test_what_is_raised_in_a_thread_hits_its_own_job_alone() -> None:
    async def scenario() -> None:
        workers = Workers()
        loop = asyncio.get_running_loop()

        def start(function: Callable[[], Any]) -> tuple[Job, asyncio.Future[Any]]:
            over: asyncio.Future[Any] = loop.create_future()
            job = Job(function, lambda value, problem: over.set_result((value, problem)))
            workers.start(job)
            return job, over

        def slowly() -> threading.Thread:
            time.sleep(0.05)
            return threading.current_thread()

        first, over = start(threading.current_thread)
        thread, _ = await over
        first.interrupt()
        second, over = start(slowly)
        first.interrupt()
        assert await over == (thread, None)  # the same thread, and nothing was raised in it

        third, over = start(spin)
        await until(begun.is_set)
        third.interrupt()
        _, problem = await over
        assert isinstance(problem, Interrupted)
        _, over = start(threading.current_thread)
        assert (await over)[0] is not thread  # a thread in which something was raised takes no other job
        second.interrupt()
        workers.close()

    asyncio.run(scenario())


@pytest.mark.filterwarnings("error")
def test_an_interrupt_never_hits_another_call(tmp_path: Path) -> None:
    async def scenario() -> None:
        tools = {late_interrupts: tool_policy("read", timeout=0.02), free: tool_policy("read")}
        async with gated(tmp_path, tools) as gate, gate.client() as client:

            async def pair() -> None:
                await client.call_tool("late_interrupts", {}, raise_on_error=False)
                assert (await client.call_tool("free", {})).data == 2

            for _ in range(15):
                await asyncio.gather(pair(), pair(), pair())

    asyncio.run(scenario())


@pytest.mark.parametrize("mode", MODES)
def test_a_tool_that_gets_no_thread_is_refused_in_a_sentence_and_called_later(
    tmp_path: Path, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    async def scenario() -> None:
        async with gated(tmp_path, {quick: tool_policy(buses=["rail"])}) as gate, gate.client(mode) as client:
            with monkeypatch.context() as patched:
                patched.setattr(Worker, "start", refuse)
                answer = await client.call_tool("quick", {}, raise_on_error=False)
            assert answer.is_error
            assert "no more processes or threads can be started" in answer.content[0].text
            assert (await client.call_tool("quick", {})).data == 1
            assert [each["event"] for each in gate.records()].count("ended") == 0

    asyncio.run(scenario())
