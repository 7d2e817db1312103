"""What is not as apply left it is among the reasons, and nothing else is."""

import io
import json
import os
import signal
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from launched import LOOPBACK, Launched, launched, tool

from octoform.endpoint.client.terminal import list_tools
from octoform.engine import project_status as engine_status
from octoform.engine.apply import apply
from octoform.engine.plan import memo
from octoform.engine.plan.plan import Request, prepare
from octoform.engine.results import EndpointSummary, RunResult
from octoform.plan.model import Plan
from octoform.views.apply import RunHuman
from octoform.views.format.console import Console

TUNNEL = Path(__file__).parents[2] / "support" / "local_tunnel.py"

SOURCE = """
from fastmcp import FastMCP

mcp = FastMCP("bench")


@mcp.tool
def one() -> int:
    return 1


@mcp.tool
def two() -> int:
    return 2
"""
TOOLS = [tool("one"), tool("two", "irreversible")]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    """A running endpoint whose policy denies one of its two tools."""
    folder = tmp_path_factory.mktemp("health")
    (folder / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    with launched(folder, SOURCE, TOOLS, policy={"tools": {"two": {"decision": "deny"}}}) as endpoint:
        endpoint.layout.output("interface").parent.mkdir(parents=True)
        yield endpoint


def status(bench: Launched, tools: list[dict[str, Any]]) -> engine_status.Status:
    bench.layout.output("interface").write_text(json.dumps({"tools": tools}))
    return engine_status.status(bench.layout.project, {})


DIFFERENT = "the endpoint's tools are not those of INTERFACE"


def test_a_tool_that_the_policy_denies_is_not_missed(bench: Launched) -> None:
    found = status(bench, TOOLS)
    assert found.tools == ("one",)
    assert DIFFERENT not in found.reasons


@pytest.mark.parametrize("tools", [[tool("two")], [tool("one"), tool("three")]])
def test_another_set_of_tools_is_a_reason(bench: Launched, tools: list[dict[str, Any]]) -> None:
    found = status(bench, tools)
    assert DIFFERENT in found.reasons


def test_a_process_that_does_not_answer_octoform_is_told(bench: Launched, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("octoform.endpoint.process.record.CONTROL", "gone.sock")
    found = status(bench, TOOLS)
    assert found.process.running is not None and found.process.reported is None
    assert "the endpoint's process does not answer octoform's own questions" in found.reasons


def test_a_process_that_a_signal_has_stopped_is_not_waited_for(bench: Launched) -> None:
    pid = bench.process.pid
    os.kill(pid, signal.SIGSTOP)
    try:
        found = status(bench, TOOLS)
        _, [problem] = list_tools(bench.layout, start=True)
    finally:
        os.kill(pid, signal.SIGCONT)
    assert problem.code == "ENDPOINT-DOWN" and f"kill -CONT {pid}" in (problem.detail or "")
    assert any("its process is stopped" in reason for reason in found.reasons)
    assert not any("stopped" in reason for reason in status(bench, TOOLS).reasons)


def test_the_host_is_known_while_its_manifest_is_the_one_of_the_memo_whatever_else_moves(tmp_path: Path) -> None:
    manifest = tmp_path / "octopus.yaml"
    manifest.write_text("version: 1\nhost: bench\nharness: builtin\n")
    assert memo.host_of(tmp_path) is None
    ground: Mapping[str, Any] = memo.rests_on(tmp_path, "bench", [str(manifest)], [], {})
    memo.path_of(tmp_path).parent.mkdir()
    memo.path_of(tmp_path).write_bytes(memo.document(memo.Remembered(_plan(tmp_path)), ground))
    (tmp_path / "protocol").mkdir()
    (tmp_path / "protocol" / "probe.md").write_text("edited")
    assert memo.recall(tmp_path, {}) is None
    assert memo.host_of(tmp_path) == "bench"
    manifest.write_text(manifest.read_text() + "\n")
    assert memo.host_of(tmp_path) is None


def _plan(project: Path) -> Plan:
    outlook, found = prepare(Request(project, {}))
    assert outlook is not None, found
    return replace(outlook.plan, actions=())


def test_a_tunnel_that_does_not_run_is_a_reason_and_the_end_of_an_apply_tells_it(tmp_path: Path) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    end = RunResult("apply", "bench", endpoint=EndpointSummary("octoform connect bench", "internet", None, ()))
    for command in ([sys.executable, str(TUNNEL), "{url}"], ["/nowhere/tunnel", "{url}"]):
        network = {**LOOPBACK, "port": 7980}
        with launched(tmp_path, SOURCE, TOOLS, network=network, tunnel={"command": command}) as endpoint:
            endpoint.layout.output("interface").parent.mkdir(parents=True, exist_ok=True)
            assert end.endpoint is not None
            known = replace(end, endpoint=replace(end.endpoint, url=endpoint.url))
            result = apply.outside(endpoint.layout, known)
            found = status(endpoint, TOOLS)
            if command[0] == sys.executable:
                address = endpoint.ask("status")["tunnel"]["url"]
                assert result.endpoint is not None and result.endpoint.public == f"{address}/mcp"
                assert result.diagnostics == ()
                assert not any("tunnel" in reason for reason in found.reasons)
                assert shown(result).count(f"{address}/mcp from the internet") == 1
                endpoint.ask("revoke_tunnel")
                assert "revoked" in " ".join(status(endpoint, TOOLS).reasons)
                (problem,) = apply.outside(endpoint.layout, known).diagnostics
                assert problem.summary.startswith("the tunnel is revoked")
                (endpoint.layout.run / "tunnel-revoked.json").unlink()
            else:
                (problem,) = result.diagnostics
                assert (problem.severity, problem.code) == ("warning", "TUNNEL-NOT-RUNNING")
                assert result.endpoint is not None and result.endpoint.public is None
                assert any(reason.startswith("the tunnel does not run") for reason in found.reasons)


def shown(result: RunResult) -> str:
    out = io.StringIO()
    RunHuman(Console(out, io.StringIO(), colour=False, colour_err=False, interactive=False)).ended(result)
    return out.getvalue()


def test_tokens_that_cannot_be_read_are_told(bench: Launched) -> None:
    (bench.layout.run / "tokens.json").symlink_to("nowhere")
    assert "the tokens cannot be read: it is a symlink" in status(bench, TOOLS).reasons
    (bench.layout.run / "tokens.json").unlink()
