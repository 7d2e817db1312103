"""`octoform watch` as a process: it keeps the endpoint alive, there is one of it, and its end leaves nothing."""

import json
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from launched import Launched, launched, tool
from projects import OCTOFORM
from waiting import until

from octoform.daemon.store import instance_lock
from octoform.endpoint.process.record import running

SOURCE = """
from fastmcp import FastMCP

mcp = FastMCP("bench")


@mcp.tool
def one() -> int:
    return 1
"""
SECONDS = 30.0


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Launched]:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    with launched(tmp_path, SOURCE, [tool("one")]) as endpoint:
        yield endpoint


class Daemons:
    """Daemons of one project; none outlives the test. What they printed lies in ``said``."""

    def __init__(self, bench: Launched) -> None:
        self.said = bench.layout.project / "said"
        self._folder = bench.layout.project
        self._begun: list[subprocess.Popen[bytes]] = []

    def begin(self) -> "subprocess.Popen[bytes]":
        """Start one."""
        with self.said.open("ab") as found:
            made = subprocess.Popen([str(OCTOFORM), "watch"], cwd=self._folder, stdout=found, stderr=found)
        self._begun.append(made)
        return made

    def end(self) -> None:
        """End those that this test began, and no other."""
        for each in self._begun:
            if each.poll() is None:
                each.kill()
                each.wait()


@pytest.fixture
def daemons(bench: Launched) -> Iterator[Daemons]:
    found = Daemons(bench)
    yield found
    found.end()


def looks(bench: Launched, process: "subprocess.Popen[bytes]") -> bool:
    """Whether that daemon has posted health since it began."""
    record, health = instance_lock.alive(bench.layout), bench.layout.daemon / "health.json"
    if record is None or record.process.pid != process.pid or not health.exists():
        return False
    return bool(json.loads(health.read_bytes())["uptime"] >= record.uptime)


def test_there_is_one_daemon_and_its_end_leaves_the_endpoint_running(bench: Launched, daemons: Daemons) -> None:
    """Paused, since this endpoint stands on no apply; what a daemon repairs is shown by the campaign."""
    assert instance_lock.pause(bench.layout, "2026-11-22T12:00:00Z") is None
    served = bench.process
    first = daemons.begin()
    assert until(lambda: looks(bench, first)), daemons.said.read_text()
    command = [str(OCTOFORM), "watch", "-once"]
    second = subprocess.run(command, cwd=bench.layout.project, capture_output=True, text=True, timeout=SECONDS)
    assert second.returncode == 1 and "DAEMON-RUNNING" in second.stdout + second.stderr
    first.kill()
    first.wait()
    third = daemons.begin()
    assert until(lambda: looks(bench, third)), daemons.said.read_text()
    third.send_signal(signal.SIGTERM)
    assert third.wait(SECONDS) == 143
    assert instance_lock.alive(bench.layout) is None
    assert running(bench.layout) == served
