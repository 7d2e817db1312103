"""`octoform revoke` from a terminal: with the endpoint running, with it dead, and when the proof fails."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
from launched import LOOPBACK, Launched, launched, tool
from web_doors import until

from octoform.base.clock import boot_id
from octoform.base.processes import start_of
from octoform.cli.main import main
from octoform.endpoint.access import tunnel
from octoform.engine.safety import person
from octoform.server import tunnel_termination

PROGRAM = str(Path(__file__).parents[2] / "support" / "local_tunnel.py")
SOURCE = '''
from fastmcp import FastMCP
mcp = FastMCP("bench")

@mcp.tool
def look() -> int:
    """Looks."""
    return 1
'''
MANIFEST = "version: 1\nhost: bench\nharness: builtin\nscope: internet\n"


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Launched]:
    (tmp_path / "octopus.yaml").write_text(MANIFEST)
    command = [sys.executable, PROGRAM, "{url}"]
    with launched(tmp_path, SOURCE, [tool("look")], network=LOOPBACK, tunnel={"command": command}) as endpoint:
        yield endpoint


def address(endpoint: Launched) -> str:
    until(lambda: endpoint.ask("status")["tunnel"]["state"] == "running")
    return str(endpoint.ask("status")["tunnel"]["url"])


def test_tunnel_is_ended_and_stays_so_until_a_person_starts_it(
    bench: Launched, capsys: pytest.CaptureFixture[str]
) -> None:
    url, instance = address(bench), bench.process.instance
    assert tunnel_termination.answers(url, instance)
    assert main([f"-chdir={bench.layout.project}", "revoke"]) == 0
    out = capsys.readouterr().out
    assert "The tunnel was ended: no process of it lives" in out
    assert f"{url} no longer answers as this endpoint." in out
    assert not tunnel_termination.answers(url, instance)
    assert bench.ask("status")["tunnel"]["state"] == "revoked"
    # The endpoint itself goes on, and a start by a client does not open it again.
    bench.stop()
    bench.start()
    assert bench.ask("status")["tunnel"]["state"] == "revoked"
    assert main([f"-chdir={bench.layout.project}", "start"]) == 0
    assert address(bench) != url


def test_tunnel_that_was_ended_before_is_looked_at_again(bench: Launched, capsys: pytest.CaptureFixture[str]) -> None:
    address(bench)
    for _ in range(2):
        assert main([f"-chdir={bench.layout.project}", "revoke", "-json"]) == 0
        document = json.loads(capsys.readouterr().out)
        assert document["proved"] is True
    assert document["was_running"] is False


def test_killed_endpoint_takes_its_tunnel_along(bench: Launched, capsys: pytest.CaptureFixture[str]) -> None:
    url, instance = address(bench), bench.process.instance
    until(lambda: bool((tunnel_termination.read(bench.layout.run) or {}).get("answered")))
    record = tunnel_termination.read(bench.layout.run)
    assert record is not None
    os.kill(bench.process.pid, signal.SIGKILL)
    until(lambda: not list(tunnel_termination.members(record)))
    assert not tunnel_termination.answers(url, instance)
    assert main([f"-chdir={bench.layout.project}", "revoke"]) == 0
    assert "was not running" in capsys.readouterr().out


def test_tunnel_that_outlived_its_endpoint_is_ended(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "octopus.yaml").write_text(MANIFEST)
    run = tmp_path / ".octoform" / "bench" / "run"
    run.mkdir(parents=True)
    left = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(100)"], start_new_session=True)
    record = {
        "pid": left.pid,
        "start": start_of(left.pid),
        "boot": boot_id(),
        "mark": "0" * 16,
        "instance": "i",
        "url": None,
    }
    try:
        (run / "tunnel.json").write_text(json.dumps(record))
        assert main([f"-chdir={tmp_path}", "revoke"]) == 0
        assert left.wait(10) == -signal.SIGTERM
        assert f"no process of it lives (pid {left.pid})" in capsys.readouterr().out
        [noted] = [json.loads(line) for line in (run.parent / "log" / "audit.jsonl").read_text().splitlines()]
        assert (noted["event"], noted["by"], noted["proved"]) == ("tunnel_revoked", person(), True)
    finally:
        left.kill()
        left.wait()


class _Edge(BaseHTTPRequestHandler):
    """A provider that keeps an address alive."""

    def do_GET(self) -> None:
        self.send_response(421)
        self.send_header("Octoform-Instance", "i")
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Nothing."""


@pytest.mark.slow
def test_address_that_still_answers_is_no_proof(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "octopus.yaml").write_text(MANIFEST)
    run = tmp_path / ".octoform" / "bench" / "run"
    run.mkdir(parents=True)
    with HTTPServer(("127.0.0.1", 0), _Edge) as edge:
        threading.Thread(target=edge.serve_forever, daemon=True).start()
        url = f"http://words.localhost:{edge.server_port}"
        record = {"pid": 1 << 22, "start": 1, "boot": boot_id(), "mark": "0" * 16, "instance": "i", "url": url}
        (run / "tunnel.json").write_text(json.dumps(record))
        assert main([f"-chdir={tmp_path}", "revoke"]) == 1
        edge.shutdown()
    err = capsys.readouterr().err
    assert "TUNNEL-NOT-REVOKED" in err
    assert f"{url} still answers as this endpoint" in err
    assert (run / tunnel.REVOKED).exists()


def test_address_that_was_never_heard_is_no_proof(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "octopus.yaml").write_text(MANIFEST)
    run = tmp_path / ".octoform" / "bench" / "run"
    run.mkdir(parents=True)
    url = "http://words.localhost:9"
    record = {"pid": 1 << 22, "start": 1, "boot": boot_id(), "mark": "0" * 16, "instance": "i", "url": url}
    (run / "tunnel.json").write_text(json.dumps(record))
    assert main([f"-chdir={tmp_path}", "revoke"]) == 1
    assert f"{url} never answered from here before" in capsys.readouterr().err


def test_no_tunnel_ever(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "octopus.yaml").write_text(MANIFEST)
    assert main([f"-chdir={tmp_path}", "revoke"]) == 0
    assert "No tunnel was open." in capsys.readouterr().out


def test_missing_program_leaves_the_intranet_as_it_is(tmp_path: Path) -> None:
    command = ["no-such-tunnel-program", "{url}"]
    with launched(tmp_path, SOURCE, [tool("look")], network=LOOPBACK, tunnel={"command": command}) as endpoint:
        found = endpoint.ask("status")["tunnel"]
        assert (found["state"], found["url"]) == ("not running", None)
        assert "there is no program 'no-such-tunnel-program'" in found["reason"]
        host, _, port = endpoint.url.removeprefix("http://").removesuffix("/mcp").partition(":")
        socket.create_connection((host, int(port)), timeout=5).close()
