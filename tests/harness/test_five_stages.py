"""`octoform apply` with each program, from an empty folder to a live endpoint whose tool is called."""

import asyncio
import json
import os
import shlex
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from agent_runs import KEY, SECRET, environment, nothing_left
from bench_host import bench_host
from fastmcp import Client
from fastmcp.client.transports import StdioTransport
from harness.matrix import PROGRAMS, Subject
from model_server import ModelServer, serve
from projects import AGENT, Project

STAGES = ("probe", "identify", "interface", "serve", "deploy")
COSTS = {"input": 1000, "cached": 400, "output": 50}


def project_with(subject: Subject, server: ModelServer, folder: Path) -> Project:
    """A project whose only agent is the program, its model on loopback."""
    # The program's commands keep a diary outside of the project, which a sandbox would not let them.
    settings: dict[str, Any] = {"name": subject.name, "key": KEY, "base_url": server.url, "sandbox": False}
    if subject.api is not None:
        settings["api"] = subject.api
    return Project(
        folder / "project",
        folder / "outside",
        harness=json.dumps(settings),
        manifest={
            "model": subject.model,
            # PROBE too: left alone it would be the embedded agent's.
            "stages": f"{{probe: {{harness: {json.dumps(settings)}}}}}",
            "budget": "{attempts: 1, attempt_timeout: 110s, stage_timeout: 120s, idle_timeout: 90s}",
        },
        environ={**environment(), "OCTOFORM_SYSROOT": str(bench_host(folder / "host"))},
        seconds=600.0,
    )


async def call(endpoint: Path) -> tuple[list[str], object]:
    """The tools of the endpoint, and what its tool answers, by the command that every client is given."""
    program, *arguments = json.loads((endpoint / "connection.json").read_bytes())["command"]
    async with Client(StdioTransport(program, arguments)) as client:
        tools = [tool.name for tool in await client.list_tools()]
        return tools, (await client.call_tool("read_temperature", {"digits": 1})).structured_content


def holding(folder: Path) -> Iterator[Path]:
    """The files in which the key stands. Other tests share the environments, so bytecode comes and goes meanwhile."""
    for root, _, names in os.walk(folder):
        for path in (Path(root, name) for name in names):
            with suppress(FileNotFoundError):
                if path.is_file() and SECRET.encode() in path.read_bytes():
                    yield path


@pytest.mark.parametrize("subject", PROGRAMS)
def test_from_an_empty_folder_to_a_live_endpoint(subject: Subject, tmp_path: Path, environments: Path) -> None:
    # What a capable model would work out, the scripted agent knows: it is the command that the model asks for.
    work = shlex.join([sys.executable, str(AGENT), str(tmp_path / "outside" / "script.json")])
    with serve({"turns": [{"shell": work}, {"text": "done"}], "usage": COSTS}) as server:
        project = project_with(subject, server, tmp_path)
        project.own_specs()
        project.share_environments(environments)
        done = project.apply(status=0)
        assert {request["key"] for request in server.replies} == {SECRET}
        assert {request["turn"] for request in server.replies} == {0, 1}
    assert project.stages_run() == list(STAGES)
    nodes = project.nodes()
    for stage in STAGES:
        assert (nodes[stage]["status"], nodes[stage]["harness"]) == ("accepted", subject.name), nodes[stage]
        # Some ask their model once more after its last word.
        assert nodes[stage]["usage"]["input_tokens"] >= 2000
        assert nodes[stage]["usage"]["output_tokens"] >= 100
        (attempt,) = project.attempts(stage)
        nothing_left(attempt)
        kinds = [json.loads(line)["event"] for line in (attempt / "transcript.jsonl").read_text().splitlines()]
        assert {"turn", "tool_called", "tool_returned"} <= set(kinds)
    assert SECRET not in done.text
    assert [path for folder in (project.folder, environments) for path in holding(folder)] == []
    assert asyncio.run(call(project.local / "endpoint")) == (["read_temperature"], {"celsius": 21.5})
    assert project.run("plan", "-detailed-exitcode").status == 0, "there is nothing left to do"
