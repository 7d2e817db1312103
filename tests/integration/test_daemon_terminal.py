"""`octoform watch` in front of a person, with the real process, the real endpoint and the commands beside it."""

import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import warm
from launched import Launched, launched, tool
from projects import OCTOFORM
from terminals import Terminal
from waiting import until

from octoform.daemon.store import instance_lock

SOURCE = '''
"""A bench with a meter."""

from fastmcp import FastMCP

import runtime

mcp = FastMCP("bench")


@mcp.tool
@runtime.logged
def read_voltage() -> dict[str, float]:
    """A voltage, in volts."""
    return {"volts": 1.5}
'''
ENVIRON = {name: os.environ[name] for name in ("PATH", "HOME", "LANG") if name in os.environ}


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Launched]:
    """A project folder whose endpoint runs, and a system in which nothing is plugged in."""
    (tmp_path / "octopus.yaml").write_text(
        "version: 1\nhost: bench\ndaemon: {interval: 5s, notify: {command: [./tell]}, metrics: octoform.prom}\n"
    )
    teller = tmp_path / "tell"
    teller.write_text("#!/bin/sh\ncat >> told\n")
    teller.chmod(0o755)
    tools = [tool("read_voltage")]
    with launched(tmp_path, SOURCE, tools) as endpoint:
        output = endpoint.layout.output("interface")
        output.parent.mkdir(parents=True)
        output.write_text(json.dumps({"tools": tools}))
        yield endpoint


def octoform(endpoint: Launched, *arguments: str) -> "subprocess.CompletedProcess[str]":
    return warm.completed(OCTOFORM, arguments, endpoint.layout.project, ENVIRON)


@pytest.mark.slow
def test_a_person_watches_pauses_asks_and_ends_it(bench: Launched) -> None:
    layout = bench.layout
    terminal = Terminal(layout.project, ENVIRON, "watch")
    try:
        terminal.wait_for("(Ctrl-C ends)")
        terminal.wait_for("1 signal")
        found = octoform(bench, "health", "-json")
        document = json.loads(found.stdout)
        assert (document["looked"], document["watched"]["pid"]) == (False, terminal.process.pid)
        assert document["covered"] == 1

        second = octoform(bench, "watch", "-once")
        assert second.returncode == 1
        assert "DAEMON-RUNNING" in second.stderr

        assert octoform(bench, "pause").returncode == 0
        terminal.wait_for("repairs are paused")
        terminal.wait_for("repairs paused, last check")
        assert octoform(bench, "resume").returncode == 0
        terminal.wait_for("repairs go on")

        bench.stop()
        terminal.wait_for("bench: down")
        seen = octoform(bench, "health")
        assert seen.returncode == 5
        assert seen.stdout.startswith("bench: DOWN")
        until(lambda: (layout.project / "told").exists())
        assert 'octoform_health{host="bench",status="down"}' in (layout.project / "octoform.prom").read_text()
    finally:
        terminal.type("\x03")
        status, screen = terminal.end()
    assert status == 130
    assert not any("Ctrl-C" in line for line in screen)
    assert instance_lock.alive(layout) is None
    alert = json.JSONDecoder().raw_decode((layout.project / "told").read_text())[0]
    assert (alert["octoform"], alert["event"], alert["host"]) == ("alert", "opened", "bench")
