"""The running endpoint: what the pipe costs, what it lets through, what the process weighs, what it bears.

The same server is served by FastMCP's own stdio and, behind octoform's launcher and gate, through `octoform connect`;
the rounds alternate. (python bench/endpoint_process.py)
"""

import asyncio
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from measuring import PYTHON, SUPPORT, Command, Row, environment, imported, in_turns, report, scratch

sys.path.insert(0, str(SUPPORT))
from launched import Launched, launched, tool
from raw_mcp import RawClient, call

CONNECT_BOUND, IDLE_BOUND, LOSS_BOUND = 0.060, 95.0, 1.25
ROUNDS, SMALL, LARGE = 9, 150, 25
CALLS, AT_ONCE = 10_000, 32
SERVER = '''
from fastmcp import FastMCP
mcp = FastMCP("bench", version="1")

@mcp.tool
def add(a: int, b: int) -> dict[str, int]:
    """A sum."""
    return {"sum": a + b}

@mcp.tool
def text() -> str:
    """Half a megabyte."""
    return "x" * 500_000
'''
TOOLS = [tool("add", "read", "usb-1"), tool("text", "read", "usb-2")]


class Stdio:
    """A client of a stdio command, one call after the other, with as little of its own as possible."""

    def __init__(self, command: Sequence[str], folder: Path) -> None:
        self._process = subprocess.Popen(
            list(command), cwd=folder, env=environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        self.pid = self._process.pid

    def ask(self, message: dict[str, Any]) -> dict[str, Any]:
        """The answer to a request."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps(message).encode() + b"\n")
        self._process.stdin.flush()
        answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        return answer

    def end(self) -> None:
        """Close its input and wait for its end."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(20)


def seconds(client: Stdio, name: str, count: int) -> float:
    """Wall seconds of so many calls."""
    began = time.perf_counter()
    for number in range(count):
        answer = client.ask(call(name, {"a": number, "b": 1} if name == "add" else {}))
        assert not answer["result"].get("isError"), answer
    return (time.perf_counter() - began) / count


def throughput(endpoint: Launched, folder: Path) -> list[Row]:
    """What a call through the pipe takes as a ratio of FastMCP's own stdio, the rounds in turns: CPU and wall.

    The CPU is that of all processes that serve: the server, and the pipe before it. Client, pipe and server work on a
    large answer at the same time, so its wall time says something only where nothing else runs.
    """
    (folder / "stdio.py").write_text(SERVER + "\nmcp.run(transport='stdio', show_banner=False, log_level='ERROR')\n")
    clients = {"own": Stdio([PYTHON, str(folder / "stdio.py")], folder), "pipe": Stdio(endpoint.command, folder)}
    serving = {"own": [clients["own"].pid], "pipe": [clients["pipe"].pid, endpoint.process.pid]}
    rows = []
    for name, count in (("add", SMALL), ("text", LARGE)):
        wall: dict[str, list[float]] = {title: [] for title in clients}
        cpu: dict[str, list[float]] = {title: [] for title in clients}
        for _ in range(ROUNDS):
            for title, client in clients.items():
                before = sum(map(to_the_nanosecond, serving[title]))
                wall[title].append(seconds(client, name, count))
                cpu[title].append((sum(map(to_the_nanosecond, serving[title])) - before) / count)
        size = "small answers" if name == "add" else "answers of 500 kB"
        own, pipe = quietest(cpu["own"]), quietest(cpu["pipe"])
        note = f"{1000 * pipe:.2f} ms CPU, FastMCP's stdio {1000 * own:.2f}"
        rows.append(Row(f"CPU of a call through the pipe, {size}", pipe / own, "x", LOSS_BOUND, note))
        own, pipe = quietest(wall["own"]), quietest(wall["pipe"])
        note = f"{1 / pipe:,.0f} calls/s, FastMCP's stdio {1 / own:,.0f}"
        rows.append(Row(f"  wall time of one, {size}", pipe / own, "x", LOSS_BOUND, note))
    for client in clients.values():
        client.end()
    return rows


def quietest(values: Sequence[float]) -> float:
    """The mean of the three least: whatever else runs on the machine adds to a round and never takes from it."""
    return statistics.fmean(sorted(values[1:])[:3])


def to_the_nanosecond(pid: int) -> float:
    """CPU seconds of a process's threads so far; the ticks of `spent` are too coarse for a round."""
    return sum(int(task.read_text().split()[0]) for task in Path(f"/proc/{pid}/task").glob("*/schedstat")) / 1e9


def resident(pid: int) -> float:
    """MiB that a process has in memory."""
    status = Path(f"/proc/{pid}/status").read_text()
    return int(status.partition("VmRSS:")[2].split()[0]) / 1024


def spent(pid: int) -> float:
    """CPU seconds of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


async def flood(endpoint: Launched) -> int:
    """CALLS calls, AT_ONCE under way at a time over four connections; how many came out right."""
    right = 0
    numbers = iter(range(CALLS))

    async def work(client: RawClient) -> None:
        nonlocal right
        for number in numbers:
            answer = await client.ask(call("add", {"a": number, "b": 1}), 60.0)
            right += answer["result"]["structuredContent"] == {"sum": number + 1}

    async with (
        RawClient(endpoint.layout.socket) as one,
        RawClient(endpoint.layout.socket) as two,
        RawClient(endpoint.layout.socket) as three,
        RawClient(endpoint.layout.socket) as four,
    ):
        await asyncio.gather(*(work(client) for client in (one, two, three, four) * (AT_ONCE // 4)))
    return right


def abuse(endpoint: Launched, folder: Path) -> tuple[list[Row], list[str]]:
    """Many calls at once: none lost, the audit log whole."""
    before, began = spent(endpoint.process.pid), time.monotonic()
    right = asyncio.run(flood(endpoint))
    wall, cpu = time.monotonic() - began, spent(endpoint.process.pid) - before
    records = (endpoint.layout.logs / "audit.jsonl").read_bytes().splitlines()
    ended = {entry["call"] for entry in map(json.loads, records) if entry["event"] == "outcome"}
    audit = [
        PYTHON,
        "-I",
        str(endpoint.layout.endpoint / "octoform/server/audit/chain.py"),
        "verify",
        str(endpoint.layout.logs),
    ]
    verified = subprocess.run(audit, cwd=folder, env=environment(), capture_output=True, text=True, check=False)
    said = [
        f"{CALLS:,} calls, {AT_ONCE} at once: {CALLS / wall:,.0f} calls/s, {1000 * cpu / CALLS:.2f} ms CPU each",
        f"audit: {len(records):,} records, {len(ended):,} outcomes; verify: {verified.stdout.strip()[:200]}",
    ]
    missing = CALLS - min(right, len([call for call in ended]))
    broken = 0 if verified.returncode == 0 else 1
    return [Row("calls lost, or without a record", missing, "", 0), Row("audit not intact", broken, "", 0)], said


def main() -> int:
    """Measure and report."""
    with scratch() as folder, launched(folder / "bench", SERVER, TOOLS, loaded=False) as endpoint:
        idle = resident(endpoint.process.pid)
        connect = Command("octoform connect", endpoint.command, folder)
        python = Command("python -c pass", [PYTHON, "-c", "pass"], folder)
        costs = in_turns([connect, python], 11)
        loaded = imported(["-chdir", str(folder / "bench"), "connect", "bench"], folder)
        rows = [
            Row("a client's pipe, from start to end", costs["octoform connect"], bound=CONNECT_BOUND),
            Row("the idle process", idle, "MiB", IDLE_BOUND),
            *throughput(endpoint, folder),
        ]
        lost, said = abuse(endpoint, folder)
        said += [f"octoform connect imports {', '.join(loaded)}"] if loaded else []
        after = resident(endpoint.process.pid)
        rows += [Row("the process after all this", after, "MiB"), *lost]
        return report("endpoint_process", rows, Row("", costs["python -c pass"]), said) or int(bool(loaded))


if __name__ == "__main__":
    sys.exit(main())
