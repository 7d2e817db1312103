"""After `clients install` with a home of its own, the real program lists the endpoint, and what was there still is."""

import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from agent_runs import program
from launched import LOOPBACK, Launched, launched, tool
from projects import OCTOFORM

from octoform.endpoint.mcp_clients.json_edit import read

SOURCE = '''
from fastmcp import FastMCP

mcp = FastMCP("bench")


@mcp.tool
def read_clock() -> str:
    """Tell the time."""
    return "noon"
'''
MANIFEST = "version: 1\nhost: bench\nharness: builtin\n"
CLAUDE = """{
  "numStartups": 7,
  "mcpServers": {
    "other": {
      "type": "stdio",
      "command": "/bin/false",
      "args": []
    }
  },
  "projects": {
    "/somewhere": {
      "allowedTools": ["mine"]
    }
  }
}
"""
GEMINI = '{\n  // mine\n  "ui": {"theme": "GitHub"},\n  "mcpServers": {"other": {"command": "/bin/false"}}\n}\n'
CODEX = '# mine\nmodel = "x" # why\n\n[mcp_servers.other]\ncommand = "/bin/false"\n\n[tui]\nnotifications = true\n'
OTHER = '"other": {"type": "local", "command": ["/bin/false"], "enabled": false}'
OPENCODE = '{\n  // mine\n  "$schema": "https://opencode.ai/config.json",\n  "mcp": {%s},\n}\n'


@dataclass(frozen=True)
class Rig:
    """A running endpoint, a home folder, and octoform's command line between them."""

    endpoint: Launched
    home: Path

    @property
    def environ(self) -> dict[str, str]:
        """Nothing of the person who runs the tests, but where programs are."""
        kept = {name: os.environ[name] for name in ("PATH", "OCTOFORM_AGENTS", "LANG") if name in os.environ}
        agents = os.environ.get("OCTOFORM_AGENTS") or str(Path.home() / ".cache" / "octoform" / "agents")
        quiet = {"CI": "1", "NO_COLOR": "1", "DISABLE_AUTOUPDATER": "1", "OPENCODE_DISABLE_AUTOUPDATE": "1"}
        trusting = {"GEMINI_CLI_TRUST_WORKSPACE": "true"}
        return {**kept, **quiet, **trusting, "HOME": str(self.home), "OCTOFORM_AGENTS": agents}

    def octoform(self, *words: str) -> str:
        """Run a command, which has to succeed."""
        command = [str(OCTOFORM), f"-chdir={self.endpoint.layout.project}", *words]
        done = subprocess.run(command, env=self.environ, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def lists(self, name: str) -> str:
        """The program's list of its servers."""
        found = program(name).locate(self.environ)
        assert found is not None
        path = os.pathsep.join([*found.path, self.environ["PATH"]])
        token = {"OCTOFORM_TOKEN_BENCH": self.endpoint.token()} if self.endpoint.process.url else {}
        done = subprocess.run(
            [*found.argv, "mcp", "list"],
            env={**self.environ, **token, "PATH": path},
            cwd=self.home,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr

    def own(self, path: str, text: str) -> Path:
        """A file that the person had before."""
        file = self.home / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        return file


@pytest.fixture(params=["stdio", "http"])
def rig(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Rig]:
    """An endpoint of scope local, and one with a network."""
    home = tmp_path / "home"
    home.mkdir()
    (tmp_path / "octopus.yaml").write_text(MANIFEST)
    network = {**LOOPBACK, "port": 7900} if request.param == "http" else None
    with launched(tmp_path, SOURCE, [tool("read_clock")], network=network) as endpoint:
        yield Rig(endpoint, home)


def line_of(text: str, name: str) -> str:
    """The line, and the one below, on which a program lists a server."""
    lines = text.splitlines()
    found = [number for number, line in enumerate(lines) if name in line]
    assert found, text
    return "\n".join(lines[found[0] : found[0] + 2])


@pytest.mark.harness
@pytest.mark.client
@pytest.mark.harness_claude_code
def test_claude_code_connects(rig: Rig) -> None:
    file = rig.own(".claude.json", CLAUDE)
    rig.octoform("clients", "install", "claude-code")
    listed = rig.lists("claude-code")
    assert "Connected" in line_of(listed, "octoform-bench")
    assert "other" in listed
    content = read(file.read_text())
    assert isinstance(content, dict)
    assert content["mcpServers"]["other"] == {"type": "stdio", "command": "/bin/false", "args": []}
    assert content["projects"]["/somewhere"]["allowedTools"] == ["mine"]
    rig.octoform("clients", "remove", "claude-code")
    left = read(file.read_text())
    del content["mcpServers"]["octoform-bench"]
    assert left == content, "what the program wrote meanwhile stays"


@pytest.mark.harness
@pytest.mark.client
@pytest.mark.harness_codex
def test_codex_lists_it(rig: Rig) -> None:
    file = rig.own(".codex/config.toml", CODEX)
    rig.octoform("clients", "install", "codex")
    listed = rig.lists("codex")
    assert "enabled" in line_of(listed, "octoform-bench") and "other" in listed
    if rig.endpoint.process.url:
        assert "Bearer token" in line_of(listed, "octoform-bench")
    assert file.read_text().startswith(CODEX)
    rig.octoform("clients", "remove", "codex")
    assert file.read_text() == CODEX


@pytest.mark.harness
@pytest.mark.client
@pytest.mark.harness_gemini_cli
def test_gemini_cli_connects(rig: Rig) -> None:
    file = rig.own(".gemini/settings.json", GEMINI)
    rig.octoform("clients", "install", "gemini")
    listed = rig.lists("gemini-cli")
    assert "Connected" in line_of(listed, "octoform-bench")
    assert "other" in listed
    rig.octoform("clients", "remove", "gemini")
    assert file.read_text() == GEMINI


@pytest.mark.harness
@pytest.mark.client
@pytest.mark.harness_opencode
@pytest.mark.parametrize("servers", [f'"servers": {{{OTHER}}}', OTHER], ids=["newer", "older"])
def test_opencode_connects_in_either_notation(rig: Rig, servers: str) -> None:
    text = OPENCODE.replace("%s", servers)
    file = rig.own(".config/opencode/opencode.json", text)
    rig.octoform("clients", "install", "opencode")
    listed = rig.lists("opencode")
    assert "connected" in line_of(listed, "octoform-bench")
    assert "other" in listed
    rig.octoform("clients", "remove", "opencode")
    assert file.read_text() == text
