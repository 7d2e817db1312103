"""`clients` and `connect -print` as a person and a program use them, without any client installed."""

import json
import os
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from launched import LOOPBACK, launched, tool
from ruamel.yaml import YAML

from octoform.cli.main import main
from octoform.endpoint.access.tunnel import no_tunnel, tunnel_opened
from octoform.endpoint.mcp_clients.known_clients import CLIENTS, of
from octoform.endpoint.publication import client_command, snippets
from octoform.engine.clients import left_behind
from octoform.state.layout import Layout

DOCUMENT = Path(__file__).parents[3] / "docs" / "clients.md"
TUNNEL = Path(__file__).parents[2] / "support" / "local_tunnel.py"
MANIFEST = "version: 1\nhost: bench\nharness: builtin\n"
URL = "http://127.0.0.1:7777/mcp"


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project whose host has an endpoint, and a home folder of its own."""
    for name in ("XDG_CONFIG_HOME", "CODEX_HOME", "CLAUDE_CONFIG_DIR", "GEMINI_CLI_HOME", "VSCODE_PORTABLE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "home").mkdir()
    folder = tmp_path / "rig"
    folder.mkdir()
    (folder / "octopus.yaml").write_text(MANIFEST)
    Layout(folder, "bench").endpoint.mkdir(parents=True)
    return folder


def parsed(file: str, text: str) -> Any:
    if file.endswith(".toml"):
        return tomllib.loads(text)
    return YAML(typ="safe").load(text) if file.endswith(".yaml") else json.loads(text)


@pytest.mark.parametrize("client", CLIENTS.values(), ids=list(CLIENTS))
def test_what_is_printed_is_what_is_installed(client: Any, project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([f"-chdir={project}", "connect", "-print", client.key]) == 0
    printed = capsys.readouterr()
    assert main([f"-chdir={project}", "clients", "install", client.key, "-json"]) == 0
    done = json.loads(capsys.readouterr().out)
    assert (done["state"], done["transport"], done["backup"], done["diagnostics"]) == ("added", "stdio", None, [])
    assert Path(done["file"]).read_text() == printed.out
    assert f"for {done['file']}\n" == printed.err
    content = parsed(client.file, printed.out)
    for key in client.table:
        content = content[key]
    found = json.dumps(content["octoform-bench"])
    assert all(json.dumps(word) in found for word in client_command(Layout(project, "bench")))
    assert printed.out == snippets("octoform-bench", client_command(Layout(project, "bench")))[client.file]
    assert main([f"-chdir={project}", "clients", "list", "-json"]) == 0
    listed = {item["client"]: item["state"] for item in json.loads(capsys.readouterr().out)["clients"]}
    assert listed == {key: "installed" if key == client.key else "absent" for key in CLIENTS}
    assert main([f"-chdir={project}", "clients", "remove", client.key]) == 0
    assert "removed from" in capsys.readouterr().out
    assert not Path(done["file"]).exists()


@pytest.mark.parametrize("cache", ["home/.cache/uv/archive-v0/x1", "own/environments-v2/x", "home/.cache/pipx/3f"])
def test_no_clients_file_names_a_cache_that_is_cleaned(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, cache: str
) -> None:
    passing = tmp_path / cache / "bin"
    passing.mkdir(parents=True)
    monkeypatch.setattr(sys, "prefix", str(passing.parent))
    for folder in (passing, tmp_path / "shims"):
        folder.mkdir(exist_ok=True)
    (passing / "octoform").write_text("#!/bin/sh\n")
    (passing / "octoform").chmod(0o755)
    (tmp_path / "shims" / "octoform").symlink_to(passing / "octoform")
    monkeypatch.setenv("PATH", f"{passing}:{tmp_path / 'shims'}")
    for words in (["clients", "install", "claude-code"], ["connect", "-print", "claude-code"]):
        assert main([f"-chdir={project}", *words]) == 1
        found = capsys.readouterr()
        assert "error[CLIENT-COMMAND-TEMPORARY]" in found.err and "uv tool install octoform" in found.err
        assert found.out == "" and not (tmp_path / "home" / ".claude.json").exists()
    stays = tmp_path / "bin" / "octoform"
    stays.parent.mkdir()
    stays.write_text("#!/bin/sh\n")
    stays.chmod(0o755)
    monkeypatch.setenv("PATH", f"{passing}:{stays.parent}")
    assert main([f"-chdir={project}", "clients", "install", "claude-code"]) == 0
    written = (tmp_path / "home" / ".claude.json").read_text()
    assert str(stays) in written and str(passing.parent) not in written


@pytest.mark.parametrize(
    "word, hint",
    [("gemni", "gemini-cli"), ("Claud Code", "claude-code"), ("vscodium", "vscode"), ("nothing", "known clients: ")],
)
def test_a_slip_in_a_name_is_understood(
    project: Path, capsys: pytest.CaptureFixture[str], word: str, hint: str
) -> None:
    assert main([f"-chdir={project}", "clients", "install", word]) == 1
    found = capsys.readouterr().err
    assert "CLIENT-UNKNOWN" in found and hint in found


@pytest.mark.parametrize("word", ["Claude Code", "claude_code", "CLAUDE", "claude-code"])
def test_a_name_may_be_spelt_as_it_is_spoken(project: Path, capsys: pytest.CaptureFixture[str], word: str) -> None:
    assert main([f"-chdir={project}", "connect", "-print", word]) == 0
    assert "mcpServers" in capsys.readouterr().out


def test_http_is_refused_where_there_is_no_address(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for client in ("cursor", "claude-desktop"):
        assert main([f"-chdir={project}", "clients", "install", client, "-transport", "http"]) == 1
        assert "CLIENT-NO-HTTP" in capsys.readouterr().err
    assert main([f"-chdir={project}", "clients", "install", "cursor", "-transport", "smoke"]) == 1
    assert "neither stdio nor http" in capsys.readouterr().err
    assert list((project.parent / "home").iterdir()) == []


def test_without_an_endpoint_nothing_is_written(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Layout(project, "bench").endpoint.rmdir()
    for words in (["clients", "install", "cursor"], ["connect", "-print", "cursor"], ["clients", "list"]):
        assert main([f"-chdir={project}", *words]) == 1
        assert "ENDPOINT-NOT-APPLIED" in capsys.readouterr().err
    assert list((project.parent / "home").iterdir()) == []


def test_a_broken_file_is_shown_with_its_line(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = project.parent / "home" / ".cursor" / "mcp.json"
    path.parent.mkdir()
    path.write_text('{\n  "mcpServers" {}\n}\n')
    assert main([f"-chdir={project}", "clients", "install", "cursor"]) == 1
    found = capsys.readouterr().err
    assert "CLIENT-FILE-SYNTAX" in found and "mcp.json:2:16" in found and "a colon is expected here" in found
    assert main([f"-chdir={project}", "clients", "list"]) == 0
    assert "cannot be read" in capsys.readouterr().out


def test_the_document_tells_every_client_and_its_file(
    project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = re.findall(r"^\| ([\w ]+) \| `([\w-]+)` \| `(~[^`]+)` \| `([\w.]+)` \|$", DOCUMENT.read_text(), re.MULTILINE)
    assert main([f"-chdir={project}", "clients", "list", "-json"]) == 0
    listed = json.loads(capsys.readouterr().out)["clients"]
    home = str(project.parent / "home")
    lines = [(row["title"], row["client"], row["file"].replace(home, "~")) for row in listed]
    assert [(title, key, file) for title, key, file, _ in rows] == lines
    assert {key: table for _, key, _, table in rows} == {key: ".".join(item.table) for key, item in CLIENTS.items()}


def test_the_examples_of_the_document_are_what_is_written() -> None:
    text = DOCUMENT.read_text()
    blocks = re.findall(r"^```(json|toml)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    command = ["/opt/octoform/bin/python", "-I", "-m", "octoform.cli", "-chdir=/home/me/rig", "connect", "bench"]
    stdio, http = snippets("octoform-bench", command), snippets("octoform-bench", command, URL)
    written = [stdio["claude-code.json"], http["claude-code.json"], http["codex.toml"]]
    assert [parsed(f"x.{kind}", block) for kind, block in blocks] == [
        parsed(f"x.{kind}", made) for (kind, _), made in zip(blocks, written, strict=True)
    ]
    for client in CLIENTS.values():
        if client.reference and client.prompt is None and client.key != "codex":
            assert f"`{of(client, 'octoform-bench').reference}`" in text


def test_two_hosts_in_one_client_have_each_their_own_token() -> None:
    command = ["/python", "-m", "octoform.cli"]
    bench, rig = snippets("octoform-bench", command, URL), snippets("octoform-rig-2", command, URL)
    for client in CLIENTS.values():
        if client.reference is None:
            continue
        texts = bench[client.file], rig[client.file]
        names = ("octoform-token-bench", "octoform-token-rig-2") if client.prompt else ("TOKEN_BENCH", "TOKEN_RIG_2")
        for text, mine, other in zip(texts, names, reversed(names), strict=True):
            assert mine in text and other not in text, text
            assert re.findall(r"OCTOFORM_TOKEN\b", text) == []


def test_a_running_endpoint_with_an_address_is_given_over_http(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = 'from fastmcp import FastMCP\n\nmcp = FastMCP("bench")\n'
    source += '\n\n@mcp.tool\ndef read_clock() -> str:\n    return "x"\n'
    with launched(project, source, [tool("read_clock")], network={**LOOPBACK, "port": 7950}) as endpoint:
        for client in ("vscode", "openclaw", "goose"):
            assert main([f"-chdir={project}", "clients", "install", client, "-json"]) == 0
            done = json.loads(capsys.readouterr().out)
            assert (done["transport"], len(done["notes"])) == ("http", 2)
            assert endpoint.url in Path(done["file"]).read_text()
            assert endpoint.token() not in Path(done["file"]).read_text()
        assert main([f"-chdir={project}", "connect", "-print", "lm-studio", "-transport", "http"]) == 0
        printed = capsys.readouterr()
        assert "${OCTOFORM_TOKEN_BENCH}" in printed.out and "put the token itself" in printed.err
        assert main([f"-chdir={project}", "clients", "install", "lm-studio"]) == 0
        assert "(stdio)" in capsys.readouterr().out, "a value is only written when that is asked for"
        assert main([f"-chdir={project}", "clients", "install", "lm-studio", "-transport", "http"]) == 0
        found = capsys.readouterr()
        assert "CLIENT-TOKEN-WRITTEN" in found.err and endpoint.token() not in found.out + found.err
        file = project.parent / "home" / ".lmstudio" / "mcp.json"
        headers = json.loads(file.read_text())["mcpServers"]["octoform-bench"]["headers"]
        assert headers == {"Authorization": f"Bearer {endpoint.token()}"}
        assert file.stat().st_mode & 0o777 == 0o600
        for path in (endpoint.layout.run / "tokens").iterdir():
            path.unlink()
        assert main([f"-chdir={project}", "clients", "install", "lm-studio", "-transport", "http"]) == 1
        assert "CLIENT-NO-TOKEN" in capsys.readouterr().err
    assert main([f"-chdir={project}", "clients", "remove", "lm-studio"]) == 0
    assert not file.exists()


def test_the_list_tells_entries_that_lead_nowhere(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def listed() -> dict[str, Any]:
        assert main([f"-chdir={project}", "clients", "list", "-json"]) == 0
        return {item["client"]: item for item in json.loads(capsys.readouterr().out)["clients"]}

    source = 'from fastmcp import FastMCP\n\nmcp = FastMCP("bench")\n'
    source += '\n\n@mcp.tool\ndef read_clock() -> str:\n    return "x"\n'
    with launched(project, source, [tool("read_clock")], network={**LOOPBACK, "port": 7960}):
        for client in ("cursor", "codex"):
            assert main([f"-chdir={project}", "clients", "install", client]) == 0
        capsys.readouterr()
        assert (listed()["cursor"]["state"], listed()["cursor"]["current"]) == ("installed", True)
    assert listed()["codex"]["current"] is True, "it does not run, but will answer there"
    with launched(project, source, [tool("read_clock")]):
        assert listed()["cursor"]["current"] is False
        assert listed()["vscode"]["current"] is None
        assert main([f"-chdir={project}", "clients", "list"]) == 0
        found = capsys.readouterr().out
        assert "installed (http), out of date: octoform clients install cursor renews it" in found
        assert main([f"-chdir={project}", "clients", "install", "cursor"]) == 0
        capsys.readouterr()
        assert (listed()["cursor"]["transport"], listed()["cursor"]["current"]) == ("stdio", True)


def test_an_entry_can_be_taken_out_when_the_endpoint_is_gone(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([f"-chdir={project}", "clients", "install", "cursor"]) == 0
    layout = Layout(project, "bench")
    layout.endpoint.rmdir()
    (found,) = left_behind(layout, os.environ)
    assert (found.severity, found.code) == ("warning", "CLIENT-ENTRY-LEFT")
    assert found.path == str(project.parent / "home" / ".cursor" / "mcp.json")
    assert found.hint == "octoform clients remove cursor takes it out"
    capsys.readouterr()
    assert main([f"-chdir={project}", "clients", "remove", "cursor"]) == 0
    assert "removed from" in capsys.readouterr().out
    assert left_behind(layout, os.environ) == []


def test_what_is_printed_in_scope_internet_leads_through_the_tunnel(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = 'from fastmcp import FastMCP\n\nmcp = FastMCP("bench")\n'
    source += '\n\n@mcp.tool\ndef read_clock() -> str:\n    return "x"\n'
    network = {**LOOPBACK, "port": 7970}
    for program, state in ((str(TUNNEL), "running"), ("/nowhere/tunnel", "not running")):
        command = [sys.executable, program, "{url}"] if state == "running" else [program, "{url}"]
        with launched(project, source, [tool("read_clock")], network=network, tunnel={"command": command}) as endpoint:
            found = tunnel_opened(endpoint.layout)
            assert found is not None and found.state == state
            assert main([f"-chdir={project}", "connect", "-print", "cursor", "-transport", "http"]) == 0
            printed = capsys.readouterr()
            given = json.loads(printed.out)["mcpServers"]["octoform-bench"]["url"]
            if state == "running":
                assert given == f"{found.url}/mcp" and no_tunnel(found) is None
                assert "it is another one after each start" in printed.err
            else:
                problem = no_tunnel(found)
                assert given == endpoint.url
                assert problem is not None and problem.code == "TUNNEL-NOT-RUNNING"
                assert problem.detail is not None and "there is no program '/nowhere/tunnel'" in problem.detail
                assert "the tunnel does not run (there is no program" in printed.err
            assert main([f"-chdir={project}", "connect", "-print", "cursor", "-transport", "stdio"]) == 0
            assert "url" not in capsys.readouterr().out
    assert tunnel_opened(Layout(project, "nobody")) is None
