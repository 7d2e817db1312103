"""What a client finds: descriptor, snippets, launcher, in this order, on any path."""

import json
import shlex
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from importlib.machinery import SourceFileLoader
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML
from unit.endpoint.endpoint_servers import CLOCK, VOLTAGE, publish, service_of
from waiting import until

from octoform.endpoint.bounded_program import ForkServer, base_environment, run
from octoform.endpoint.environment.model import Environment
from octoform.endpoint.process.start_stop import accepts, stop
from octoform.endpoint.publication import launcher_text, write_endpoint
from octoform.state.layout import Layout

INITIALIZE = {
    "jsonrpc": "2.0",
    "id": 1,
    "method": "initialize",
    "params": {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "test", "version": "1"}},
}


Done = subprocess.CompletedProcess[str]


def launched(layout: Layout) -> Done:
    """What the launcher runs, by hand and to its end, as a fork of what has loaded the packages."""
    *words, given = shlex.split((layout.endpoint / "launch").read_text().partition("exec ")[2])
    assert given == "$@"
    server = ForkServer.at(Path(words[0]))
    done = run(words, cwd=layout.project, environment=base_environment(), timeout=60, fork_server=server)
    assert done.status is not None, "it goes on"
    return Done(words, done.status, done.stdout, done.stderr)


def served(layout: Layout) -> Done:
    """The same of an endpoint that is asked to stop as soon as it takes clients."""
    with ThreadPoolExecutor(1) as pool:
        done = pool.submit(launched, layout)
        until(lambda: done.done() or accepts(layout))
        stop(layout)
        return done.result()


def asked(layout: Layout, line: dict[str, Any], cwd: Path) -> Done:
    """A client's command with one message."""
    command = json.loads((layout.endpoint / "connection.json").read_bytes())["command"]
    process = subprocess.Popen(
        command, cwd=cwd, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write(json.dumps(line) + "\n")
    process.stdin.flush()
    answer = process.stdout.readline()
    rest, errors = process.communicate(timeout=60)
    return Done(command, process.returncode, answer + rest, errors)


def test_a_client_reaches_the_endpoint_from_any_folder(layout: Layout, serving: Environment, tmp_path: Path) -> None:
    publish(layout, serving)
    (tmp_path / ".env").write_text("FASTMCP_LOG_LEVEL=nonsense\n")
    done = asked(layout, INITIALIZE, tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    (answer,) = done.stdout.splitlines()
    assert json.loads(answer)["result"]["serverInfo"]["name"] == "octoform-bench"


def test_edited_code_is_refused_in_one_line(layout: Layout, serving: Environment) -> None:
    publish(layout, serving)
    server = layout.output("serve")
    server.write_text(server.read_text() + "\n# improved\n")
    done = launched(layout)
    assert (done.returncode, done.stdout) == (78, "")
    assert [line.partition(" ")[2] for line in done.stderr.splitlines()] == [
        f"octoform: refused: {server} is not the file that was accepted; run octoform plan to see what would be done"
    ]


@pytest.mark.parametrize("name", ["policy.json", "connection.json", "octoform/server/gate/gate.py", "serve.py"])
def test_what_guards_the_endpoint_is_not_edited_unseen(layout: Layout, serving: Environment, name: str) -> None:
    publish(layout, serving)
    path = layout.endpoint / name
    path.write_text(path.read_text() + "\n")
    done = launched(layout)
    assert done.returncode == 78
    assert done.stderr.rstrip().endswith(f"{path} is not the file that was published; run octoform apply")


@pytest.mark.parametrize(
    ("name", "damage"), [("calllog.py", "edited"), ("calllog.py", "gone"), ("base/clock.py", "edited")]
)
def test_an_edited_runtime_is_refused_too(layout: Layout, serving: Environment, name: str, damage: str) -> None:
    publish(layout, serving)
    module = layout.runtime / name
    module.unlink()
    if damage == "edited":
        module.write_text("def logged(tool):\n    return tool\n")
    done = launched(layout)
    assert done.returncode == 78
    assert str(module) in done.stderr


def test_serving_leaves_no_bytecode_beside_the_committed_server(layout: Layout, serving: Environment) -> None:
    publish(layout, serving)
    asked(layout, INITIALIZE, layout.project)
    assert list(layout.committed.rglob("__pycache__")) == []


def test_a_start_compiles_nothing_of_the_published_program(layout: Layout, serving: Environment) -> None:
    publish(layout, serving)
    program = layout.endpoint / "octoform"
    laid = {path: path.stat().st_ino for path in program.rglob("*.pyc")}
    assert len(laid) == len([*program.rglob("*.py")])
    assert served(layout).returncode == 0
    assert {path: path.stat().st_ino for path in program.rglob("*.pyc")} == laid
    edited = program / "server" / "main.py"
    edited.write_text(edited.read_text() + "raise SystemExit(7)\n")
    assert launched(layout).returncode == 7


def test_damaged_bytecode_of_the_installation_hinders_no_endpoint(
    layout: Layout, serving: Environment, monkeypatch: pytest.MonkeyPatch
) -> None:
    def damaged(self: SourceFileLoader, name: str) -> None:
        raise EOFError("marshal data too short")

    monkeypatch.setattr(SourceFileLoader, "get_code", damaged)
    publish(layout, serving)
    assert served(layout).returncode == 0


def test_the_descriptor_tells_what_is_served_and_how(layout: Layout, serving: Environment) -> None:
    publish(layout, serving)
    descriptor = json.loads((layout.endpoint / "connection.json").read_bytes())
    assert descriptor["host"] == "bench"
    assert (descriptor["scope"], descriptor["transport"]) == ("local", "stdio")
    own = [f"-chdir={layout.project}", "connect", "bench"]
    assert descriptor["command"] == [sys.executable, "-I", "-m", "octoform.cli", *own]
    assert [(item["name"], item["effect"]) for item in descriptor["tools"]] == [
        ("read_clock", "read"),
        ("read_voltage", "read"),
    ]
    assert descriptor["environment"]["OCTOFORM_CALL_LOG"] == str(layout.call_log)
    assert descriptor["environment"]["OCTOFORM_STOPS"] == str(layout.run)
    assert "OCTOFORM_SYSROOT" not in descriptor["environment"]


def test_a_system_root_in_use_at_apply_is_kept(layout: Layout, serving: Environment) -> None:
    publish(layout, serving)
    assert write_endpoint(layout, serving, service_of([CLOCK, VOLTAGE]), {"OCTOFORM_SYSROOT": "/srv/root"}) == []
    descriptor = json.loads((layout.endpoint / "connection.json").read_bytes())
    assert descriptor["environment"]["OCTOFORM_SYSROOT"] == "/srv/root"


def test_every_client_gets_its_own_format_with_absolute_paths(layout: Layout, serving: Environment) -> None:
    publish(layout, serving)
    program, *arguments = json.loads((layout.endpoint / "connection.json").read_bytes())["command"]
    name = "octoform-bench"
    seen = {path.name: path.read_text() for path in (layout.endpoint / "clients").iterdir()}
    own = {"command": program, "args": arguments}
    for client in ("claude-code", "claude-desktop", "gemini-cli", "cursor", "lm-studio"):
        assert json.loads(seen.pop(f"{client}.json"))["mcpServers"][name].items() >= own.items()
    assert json.loads(seen.pop("vscode.json"))["servers"][name].items() >= own.items()
    assert json.loads(seen.pop("openclaw.json"))["mcp"]["servers"][name].items() >= own.items()
    assert json.loads(seen.pop("opencode.json"))["mcp"]["servers"][name]["command"] == [program, *arguments]
    assert tomllib.loads(seen.pop("codex.toml"))["mcp_servers"][name].items() >= own.items()
    goose = YAML(typ="safe").load(seen.pop("goose.yaml"))["extensions"][name]
    assert (goose["cmd"], goose["args"]) == (program, arguments)
    assert seen == {}


def test_the_launcher_is_written_last_and_all_of_it_is_private(layout: Layout, serving: Environment) -> None:
    publish(layout, serving)
    written = {path.name: path.stat() for path in layout.endpoint.rglob("*") if path.is_file()}
    launcher = written["launch"]
    others = [facts for name, facts in written.items() if name not in ("launch", "manifest.json")]
    assert all(facts.st_ctime_ns <= launcher.st_ctime_ns for facts in others)
    assert written["connection.json"].st_ctime_ns <= min(facts.st_ctime_ns for facts in others)
    assert launcher.st_mode & 0o777 == 0o700
    assert {facts.st_mode & 0o777 for facts in others} == {0o600}
    assert layout.endpoint.stat().st_mode & 0o777 == 0o700


def test_a_new_endpoint_keeps_the_environment_before_it(layout: Layout, serving: Environment) -> None:
    for name in ("111111111111", "222222222222", "333333333333"):
        path = layout.environments / name
        path.mkdir(parents=True)
        (path / "octoform-complete.json").write_text("{}")
        publish(layout, Environment(path / "bin/python", serving.digest, path, serving.lock))
    assert sorted(path.name for path in layout.environments.glob("[0-9]*")) == ["222222222222", "333333333333"]


def test_what_an_earlier_octoform_published_beside_it_goes(layout: Layout, serving: Environment) -> None:
    program = layout.endpoint / "octoform"
    former = [program / "launcher" / "deep" / "main.py", program / "server" / "catalog" / "setup.py"]
    for path in former:
        path.parent.mkdir(parents=True)
        path.write_text("FORMER = True\n")
    publish(layout, serving)
    assert [path for path in former if path.exists()] == []
    assert {path.name for path in program.iterdir() if path.is_dir()} == {"base", "policy", "server", "__pycache__"}
    assert (program / "server" / "gate" / "gate.py").is_file()


def test_however_it_is_started_the_interpreter_keeps_the_memory_of_a_picture_for_the_next(tmp_path: Path) -> None:
    python = tmp_path / "python of a test"
    python.write_text('#!/bin/sh\necho "$MALLOC_TRIM_THRESHOLD_ $MALLOC_MMAP_THRESHOLD_" "$@"\n')
    python.chmod(0o700)
    launcher = tmp_path / "launch"
    launcher.write_text(launcher_text(Environment(python, "", tmp_path, ""), tmp_path / "serve.py"))
    launcher.chmod(0o700)
    done = subprocess.run([launcher, "a word"], env={}, capture_output=True, text=True, check=True)
    assert done.stdout == f"16777216 16777216 -I {tmp_path}/serve.py a word\n"
