"""One process per host: started once, proved to be it, ended first gently, and no other process ever touched."""

import asyncio
import contextlib
import json
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from endings import record_running
from launched import Launched, launched, start, tool, write
from launched import policy_of as policy
from raw_mcp import request

from octoform.endpoint.process import start_stop
from octoform.endpoint.process.record import running
from octoform.endpoint.publication import Service
from octoform.server.process.descriptor import read
from octoform.server.process.instance_lock import Owner
from octoform.server.wiring import Endpoint
from octoform.state.layout import Layout

SOURCE = '''
import subprocess
from fastmcp import FastMCP
mcp = FastMCP("bench")

@mcp.tool
def spawn(bare: bool = False) -> dict[str, int]:
    """Leaves a process of its own behind, in a session of its own; a bare one without any variable."""
    more = {"env": {}} if bare else {}
    return {"pid": subprocess.Popen(["/bin/sleep", "600"], start_new_session=True, **more).pid}
'''
TOOLS = [tool("spawn")]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    with launched(tmp_path_factory.mktemp("supervised"), SOURCE, TOOLS) as endpoint:
        yield endpoint


def alive(pid: int) -> bool:
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


def gone(pid: int) -> bool:
    """True once it is; what was killed goes a moment later."""
    end = time.monotonic() + 10
    while alive(pid):
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def network_sockets(pid: int) -> list[str]:
    """The lines of /proc/net of a process's sockets that have an address of a network."""
    links = [str(entry.readlink()) for entry in Path(f"/proc/{pid}/fd").iterdir() if entry.is_symlink()]
    inodes = {link[8:-1] for link in links if link.startswith("socket:[")}
    lines = []
    for table in ("tcp", "tcp6", "udp", "udp6", "raw", "raw6"):
        lines += Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]
    return [line for line in lines if line.split()[9] in inodes]


def test_starts_at_once_make_one_process(bench: Launched) -> None:
    bench.stop()
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: start_stop.start(bench.layout), range(4)))
    assert all(problem is None for _, problem in found)
    assert len({process.pid for process, _ in found if process is not None}) == 1


def test_a_second_owner_is_refused(bench: Launched) -> None:
    done = subprocess.run([bench.layout.endpoint / "launch"], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 75
    assert done.stderr.partition(" ")[2] == "octoform: another process serves this endpoint already\n"


def test_a_log_that_grew_large_is_set_aside(bench: Launched, monkeypatch: pytest.MonkeyPatch) -> None:
    log = bench.layout.server_log
    bench.stop()
    log.write_text("what was printed\n")
    bench.start()
    assert log.read_text().startswith("what was printed\n")
    bench.stop()
    monkeypatch.setattr(start_stop, "LARGE_LOG", 16)
    bench.start()
    assert (bench.layout.logs / "server.log.1").read_text().startswith("what was printed\n")
    assert "what was printed" not in log.read_text()
    assert log.stat().st_mode & 0o777 == 0o600


def test_scope_local_has_no_socket_of_a_network(bench: Launched) -> None:
    assert network_sockets(bench.process.pid) == []


async def spawned(bench: Launched, bare: bool) -> int:
    async with bench.client() as client:
        return int((await client.call_tool("spawn", {"bare": bare})).data["pid"])


@pytest.mark.parametrize("bare", [False, True])
def test_what_tools_left_running_ends_with_the_endpoint(bench: Launched, bare: bool) -> None:
    left = asyncio.run(spawned(bench, bare))
    assert alive(left)
    stopped = start_stop.stop(bench.layout)
    assert stopped.process is not None and not stopped.firmly
    assert gone(left) and gone(stopped.process.pid)
    assert running(bench.layout) is None and not bench.layout.socket.exists()
    bench.start()


@pytest.mark.parametrize("bare", [False, True])
def test_what_tools_of_an_endpoint_left_that_was_killed_ends_with_the_next_stop(bench: Launched, bare: bool) -> None:
    left = asyncio.run(spawned(bench, bare))
    served = bench.process.pid
    os.kill(served, signal.SIGKILL)
    assert gone(served) and alive(left)
    assert start_stop.stop(bench.layout).process is None
    assert gone(left)
    bench.start()


def test_what_does_not_end_by_itself_is_ended_firmly(bench: Launched) -> None:
    process = bench.process
    os.kill(process.pid, signal.SIGSTOP)
    began = time.monotonic()
    stopped = start_stop.stop(bench.layout, seconds=0.5)
    assert stopped.firmly and gone(process.pid)
    assert time.monotonic() - began < 5.0
    bench.start()


def connects(pid: int) -> bool:
    """Whether a process has a connected Unix socket (the tables of proc(5): state 03)."""
    with contextlib.suppress(OSError):
        links = {str(entry.readlink()) for entry in Path(f"/proc/{pid}/fd").iterdir()}
        rows = [line.split() for line in Path(f"/proc/{pid}/net/unix").read_text().splitlines()[1:]]
        return any(row[5] == "03" and f"socket:[{row[6]}]" in links for row in rows)
    return False


def test_one_that_stands_still_is_ended_at_once(bench: Launched) -> None:
    bench.stop()
    bench.start()
    found = bench.process
    os.kill(found.pid, signal.SIGSTOP)
    end = time.monotonic() + 5
    while not start_stop.is_stopped(found.pid) and time.monotonic() < end:
        time.sleep(0.01)
    began = time.monotonic()
    done = start_stop.stop(bench.layout)
    assert (done.firmly, gone(found.pid)) == (True, True)
    assert time.monotonic() - began < start_stop.STOP_SECONDS / 2
    assert not start_stop.is_stopped(os.getpid())
    bench.start()


def test_who_came_to_a_process_that_dies_is_served_by_its_successor(bench: Launched) -> None:
    """The kernel connects a client also to a process that will never take it."""
    before = bench.process.pid
    os.kill(before, signal.SIGSTOP)
    with subprocess.Popen(bench.command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as client:
        assert client.stdin is not None and client.stdout is not None
        end = time.monotonic() + 20
        while not connects(client.pid):
            assert time.monotonic() < end
            time.sleep(0.01)
        os.kill(before, signal.SIGKILL)
        client.stdin.write(json.dumps(request("tools/list")).encode() + b"\n")
        client.stdin.flush()
        assert [tool["name"] for tool in json.loads(client.stdout.readline())["result"]["tools"]] == ["spawn"]
        client.stdin.close()
    assert bench.process.pid != before


def test_a_start_waits_for_an_owner_that_is_ending(bench: Launched) -> None:
    """The lock of a killed process is free only once the last of its threads is gone, later than its record is."""
    bench.stop()
    bench.layout.server_log.write_text("")
    owner = Owner.take(bench.layout.run)
    assert owner is not None
    with ThreadPoolExecutor(1) as pool:
        starting = pool.submit(start, bench.layout)
        end = time.monotonic() + 20
        while "another process serves" not in bench.printed():
            assert time.monotonic() < end
            time.sleep(0.01)
        owner.release()
        process, problem = starting.result()
    assert process is not None, problem


def test_an_innocent_process_is_never_signalled(tmp_path: Path) -> None:
    layout = write(tmp_path, SOURCE, Service(TOOLS, policy(TOOLS)))
    record_running(layout.run)
    record = json.loads((layout.run / "process.json").read_text())
    sleeping = record["pid"]
    for change in ({"start": record["start"] - 1}, {"argv": ["sleep", "1"]}, {"boot": "another"}):
        (layout.run / "process.json").write_text(json.dumps({**record, **change}))
        assert start_stop.stop(layout).process is None
        assert alive(sleeping)
    for damage in ("", "[]", "{}", '{"pid": "1"}', "\x00"):
        (layout.run / "process.json").write_text(damage)
        assert start_stop.stop(layout).process is None


def test_the_reason_of_a_failed_start_is_told(tmp_path: Path) -> None:
    layout = write(tmp_path, "raise SystemExit('the board is on fire')\n", Service(TOOLS, policy(TOOLS)))
    process, problem = start(layout, 20)
    assert process is None and problem is not None
    assert problem.code == "ENDPOINT-START-FAILED"
    assert "the board is on fire" in str(problem.detail)
    assert running(layout) is None


def test_without_an_endpoint_nothing_is_started(tmp_path: Path) -> None:
    process, problem = start_stop.start(Layout(tmp_path, "bench"))
    assert process is None and problem is not None
    assert problem.code == "ENDPOINT-NOT-APPLIED"
    assert list(tmp_path.iterdir()) == []


def test_a_process_that_nobody_could_find_any_more_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from fastmcp import FastMCP

    layout = write(tmp_path, SOURCE, Service(TOOLS, policy(TOOLS)))
    monkeypatch.setattr("octoform.server.wiring.LOOK_SECONDS", 0.01)
    owner = Owner.take(layout.run)
    assert owner is not None
    endpoint = Endpoint(read(layout.endpoint), owner, FastMCP("bench"))
    owner.record(scope="local", url=None)

    async def watched() -> None:
        async with asyncio.timeout(20):
            waiting = asyncio.create_task(endpoint._stop_requested(asyncio.Event(), []))
            await asyncio.sleep(0.05)
            assert not waiting.done()
            (layout.run / "process.json").unlink()
            await waiting

    asyncio.run(watched())
    owner.release()
