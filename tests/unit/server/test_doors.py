"""The doors of the process: a shortage closes none for good, silence fills nothing, and without one it ends."""

import asyncio
import contextlib
import json
import logging
import os
import resource
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastmcp import FastMCP
from launched import launched, policy_of, tool, write
from raw_mcp import RawClient, call, connected
from waiting import until

from octoform.endpoint.access.audit_log import latest
from octoform.endpoint.process.record import is_it
from octoform.endpoint.publication import Service
from octoform.server.process import control as module
from octoform.server.process.control import Control
from octoform.server.process.descriptor import read
from octoform.server.process.instance_lock import Owner
from octoform.server.process.local_socket import listen
from octoform.server.transport import unix_socket
from octoform.server.wiring import Endpoint

SOURCE = """
import os, resource, socket
from fastmcp import FastMCP
mcp = FastMCP("bench")
held = []

@mcp.tool
def take() -> int:
    resource.setrlimit(resource.RLIMIT_NOFILE, (len(os.listdir("/proc/self/fd")) + 5, 4096))
    while True:
        try:
            held.append(os.open("/dev/null", os.O_RDONLY))
        except OSError:
            return len(held)

@mcp.tool
def give() -> int:
    while held:
        os.close(held.pop())
    return 0

@mcp.tool
def shut(name: str) -> int:
    shut = 0
    for number in os.listdir("/proc/self/fd"):
        try:
            with socket.socket(fileno=os.dup(int(number))) as door:
                if str(door.getsockname()).endswith(name) and door.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
                    shut += 1
                    door.shutdown(socket.SHUT_RDWR)
        except OSError:
            continue
    return shut
"""
TOOLS = [tool("take"), tool("give"), tool("shut")]


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the doors log."""
    lines: list[str] = []

    class Kept(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            lines.append(record.getMessage())

    for logger in (module.LOGGER, unix_socket.LOGGER):
        monkeypatch.setattr(logger, "handlers", [Kept()])
        monkeypatch.setattr(logger, "filters", [])
    return lines


@pytest.fixture
def control(tmp_path: Path) -> Iterator[Control]:
    door = Control(tmp_path)
    door.on("status", lambda _: {"fine": True})
    yield door
    door.stop()
    until(lambda: all(thread.name != "control-answer" for thread in threading.enumerate()))  # late words are no other's


def asked(connection: socket.socket, **question: object) -> dict[str, object]:
    connection.settimeout(20)
    connection.sendall(json.dumps(question).encode() + b"\n")
    answer: dict[str, object] = json.loads(connection.makefile().readline())
    return answer


def test_a_control_door_outlives_a_lack_of_descriptors(control: Control, tmp_path: Path, said: list[str]) -> None:
    control.start()
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    with socket.socket(socket.AF_UNIX) as client:
        resource.setrlimit(resource.RLIMIT_NOFILE, (client.fileno() + 1, before[1]))
        held = []
        try:
            with contextlib.suppress(OSError):
                while True:
                    held.append(os.open(os.devnull, os.O_RDONLY))
            client.connect(str(tmp_path / "control.sock"))
            until(lambda: "no connection can be taken at the control door now" in "".join(said))
        finally:
            for number in held:
                os.close(number)
            resource.setrlimit(resource.RLIMIT_NOFILE, before)
        assert asked(client, op="status") == {"fine": True}


def test_a_control_door_answers_without_threads_too(
    control: Control, tmp_path: Path, said: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    control.start()
    begin = threading.Thread.start

    def start(thread: threading.Thread) -> None:
        if thread.name == "control-answer":
            raise RuntimeError("can't start new thread")
        begin(thread)

    monkeypatch.setattr(threading.Thread, "start", start)
    for _ in range(2):
        with connected(tmp_path / "control.sock") as client:
            assert asked(client, op="status") == {"fine": True}
    monkeypatch.setattr(threading.Thread, "start", begin)
    with connected(tmp_path / "control.sock") as client:
        assert asked(client, op="status") == {"fine": True}
    assert "can't start new thread" in "".join(said)


def test_connections_that_ask_nothing_make_room(control: Control, tmp_path: Path) -> None:
    control.start()
    silent = [connected(tmp_path / "control.sock") for _ in range(module.MAX_CLIENTS + 10)]
    try:
        with connected(tmp_path / "control.sock") as client:
            assert asked(client, op="status") == {"fine": True}
        for connection in silent[:10]:  # the oldest had to go, long before their own time was over
            connection.settimeout(module.SECONDS / 2)
            assert connection.recv(1) == b""
        # Threads of those that had to go end a moment after their connections.
        until(lambda: sum(thread.name == "control-answer" for thread in threading.enumerate()) <= module.MAX_CLIENTS)
    finally:
        for connection in silent:
            connection.close()


def test_many_questions_leave_room_for_an_emergency_stop(control: Control, tmp_path: Path) -> None:
    go = threading.Event()
    control.on("slow", lambda _: {"waited": go.wait(20)})
    control.on("estop", lambda _: {"stopped": True})
    control.start()
    slow = [connected(tmp_path / "control.sock") for _ in range(module.MAX_CLIENTS)]
    try:
        for connection in slow:
            connection.sendall(b'{"op": "slow"}\n')
        until(lambda: control._answering == module.MAX_CLIENTS)
        with connected(tmp_path / "control.sock") as other:
            assert "too many questions" in str(asked(other, op="status")["error"])
        with connected(tmp_path / "control.sock") as person:
            assert asked(person, op="estop") == {"stopped": True}
    finally:
        go.set()
        for connection in slow:
            connection.close()


@pytest.mark.parametrize("question", [b"[]\n", b"[" * 60_000 + b"\n", b"\xff\n"])
def test_what_is_no_question_hurts_nobody(control: Control, tmp_path: Path, said: list[str], question: bytes) -> None:
    control.start()
    with connected(tmp_path / "control.sock") as client:
        client.sendall(question)
        client.settimeout(20)
        client.makefile().readline()
    with connected(tmp_path / "control.sock") as client:
        assert asked(client, op="status") == {"fine": True}
    assert len(said) <= 1


def test_the_doors_of_a_process_outlive_a_shortage(tmp_path: Path) -> None:
    async def scenario() -> None:
        with launched(tmp_path, SOURCE, TOOLS) as endpoint:
            async with RawClient(endpoint.layout.socket) as first:
                await first.ask(call("give"))  # what the first call imports is imported now
                taken = await first.ask(call("take"))
                assert "result" in taken, taken
                with connected(endpoint.layout.run / "control.sock") as person:
                    async with RawClient(endpoint.layout.socket) as late:
                        asking = asyncio.create_task(late.ask(call("give"), 30))
                        await asyncio.to_thread(until, lambda: "no local client can be taken" in endpoint.printed())
                        await asyncio.to_thread(until, lambda: "taken at the control door" in endpoint.printed())
                        await first.ask(call("give"))
                        assert (await asking)["result"]["structuredContent"]["result"] == 0
                    assert (await asyncio.to_thread(asked, person, op="status"))["scope"] == "local"

    asyncio.run(scenario())


def test_a_door_that_ends_ends_the_process(tmp_path: Path) -> None:
    """Its successor can own the devices; an unreachable process would only keep them."""

    async def scenario() -> None:
        with launched(tmp_path, SOURCE, TOOLS) as endpoint:
            process = endpoint.process
            async with RawClient(endpoint.layout.socket) as client:
                asking = asyncio.create_task(client.ask(call("shut", {"name": "control.sock"}), 20))
                await asyncio.to_thread(until, lambda: not is_it(process))
                asking.cancel()
            assert "it ends: the door control ended" in endpoint.printed()
            assert latest(endpoint.layout, 1)[0][0]["event"] == "stopped"
            endpoint.start()
            assert endpoint.ask("status")["pid"] != process.pid

    asyncio.run(scenario())


def test_every_door_is_watched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("octoform.server.wiring.LOOK_SECONDS", 0.01)
    layout = write(tmp_path, SOURCE, Service(TOOLS, policy_of(TOOLS)))
    owner = Owner.take(layout.run)
    assert owner is not None
    endpoint = Endpoint(read(layout.endpoint), owner, FastMCP("bench"))
    owner.record(scope="local", url=None)

    async def scenario() -> None:
        async with asyncio.timeout(20):
            ended = asyncio.get_running_loop().create_future()
            ended.set_exception(OSError("it broke"))
            assert "it broke" in await endpoint._stop_requested(asyncio.Event(), [ended])
            listener = listen(layout.socket)
            door = asyncio.create_task(endpoint._clients.serve(listener))
            found = asyncio.create_task(endpoint._stop_requested(asyncio.Event(), [door]))
            async with RawClient(layout.socket) as client:
                assert "result" in await client.ask(call("anything"))
                assert not found.done()
            with (tmp_path / "device").open("w") as device:  # a tool closed the door's descriptor, a device got it
                os.dup2(device.fileno(), listener.fileno())
            assert "lost its socket" in await found
            door.cancel()
            await asyncio.gather(door, return_exceptions=True)

    asyncio.run(scenario())
    owner.release()
