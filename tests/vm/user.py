"""octoform as a person in the guest uses it: the same commands, their output read."""

import base64
import contextlib
import io
import json
import shlex
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from anyio.from_thread import BlockingPortal, start_blocking_portal
from fastmcp import Client
from fastmcp.client.client import CallToolResult
from fastmcp.client.transports import StdioTransport
from mcp.types import ImageContent, TextContent
from vm.contents import Picture, picture
from vm.guest import Guest, GuestError
from vm.image.packages import OCTOFORM

ROOT = Path(__file__).parents[2]
PROJECT = "/root/bench"
_SHIPPED = ("octoform", "protocol", "profiles")
_SETTINGS = {
    "PATH": "/opt/guest/venv/bin:/usr/sbin:/usr/bin:/sbin:/bin",
    "LC_ALL": "C.UTF-8",
    "UV_OFFLINE": "1",
    "UV_FIND_LINKS": "/opt/guest/wheels",
    "NO_COLOR": "1",
}
# An emulated processor is slower than the smallest board.
_MANIFEST = """\
version: 1
host: bench
harness: builtin
budget: {attempt_timeout: 20m, stage_timeout: 40m}
policy: {actuate: allow, timeout: 3m}
"""
APPLY_SECONDS = 1500.0
SLOW_SECONDS = 300.0
"""For what takes a real computer seconds."""
SMALL = {"width": 320, "height": 240, "format": "png"}


@dataclass(frozen=True)
class Octoform:
    """octoform in a project of the guest."""

    guest: Guest

    def install(self, manifest: str) -> None:
        """Bring this checkout's octoform and a manifest: what all guests have, and these lines."""
        self.guest.run(f"mkdir -p {OCTOFORM} {PROJECT} && tar -xf - -C {OCTOFORM}", stdin=_checkout())
        self.guest.run(f"cp -r {OCTOFORM}/profiles {PROJECT}/profiles")
        self.guest.write(f"{PROJECT}/octopus.yaml", _MANIFEST + manifest)

    def line(self, *words: str) -> str:
        """The shell command that runs octoform with these words."""
        settings = " ".join(f"{name}={value}" for name, value in _SETTINGS.items())
        return f"cd {PROJECT} && {settings} octoform {shlex.join(words)}"

    def run(self, *words: str, seconds: float = SLOW_SECONDS) -> str:
        """What it prints; an error with what it and the guest said last when it fails."""
        try:
            return self.guest.run(self.line(*words) + " 2>&1", seconds)
        except GuestError as problem:
            raise AssertionError(f"octoform {' '.join(words)} failed\n{problem}\n{self.logs()}") from None

    def logs(self) -> str:
        """The end of what the endpoint's process and the last agent printed."""
        files = f"{PROJECT}/.octoform/bench/log/*.log {PROJECT}/.octoform/bench/attempts/*/agent.log"
        return self.guest.run(f"tail -n 15 {files} 2>/dev/null", check=False)

    def status(self, *words: str) -> int:
        """The exit status of a command that may leave with another than zero."""
        return int(self.guest.run(f"{self.line(*words)} >/dev/null 2>&1; echo $?", SLOW_SECONDS))

    def asked(self, *words: str) -> Any:
        """The JSON object that a command prints, whatever its exit status."""
        return json.loads(self.guest.run(self.line(*words, "-json"), SLOW_SECONDS, check=False))

    def call(self, tool: str, **arguments: Any) -> dict[str, Any]:
        """The whole answer of a tool, called through the live endpoint."""
        line = self.line("call", tool, "-timeout", "3m", "-json", json.dumps(arguments))
        text = self.guest.run(line, SLOW_SECONDS, check=False)
        answer: dict[str, Any] = json.loads(text) if text.startswith("{") else {"is_error": True, "said": text}
        assert "structured" in answer and not answer["is_error"], f"{tool} {arguments}: {text}\n{self.logs()}"
        return answer

    @contextlib.contextmanager
    def connected(self) -> "Iterator[McpClient]":
        """An MCP client on this machine, connected through ssh and `octoform connect` until the end."""
        transport = StdioTransport("ssh", [*self.guest.ssh, self.line("connect", "bench")])
        client = Client(transport, timeout=SLOW_SECONDS, init_timeout=SLOW_SECONDS)
        with start_blocking_portal() as portal, portal.wrap_async_context_manager(client):
            yield McpClient(client, portal)

    def artifact(self, stage: str) -> dict[str, Any]:
        """What a stage's agent was accepted with."""
        loaded: dict[str, Any] = json.loads(self.guest.read(f"{PROJECT}/state/bench/{stage}/output.json"))
        return loaded

    def attempts(self) -> int:
        """How often an agent was started so far."""
        return int(self.guest.run(f"ls {PROJECT}/.octoform/bench/attempts | grep -c '^[0-9]'", check=False) or 0)


@dataclass(frozen=True)
class McpClient:
    """A client whose calls wait for their answer."""

    client: "Client[StdioTransport]"
    portal: BlockingPortal

    def tools(self) -> list[str]:
        """The names of all tools."""
        return [tool.name for tool in self.portal.call(self.client.list_tools)]

    def call(self, tool: str, **arguments: Any) -> dict[str, Any]:
        """The structured answer of a tool that does what it should."""
        answer = self._answer(tool, arguments)
        assert not answer.is_error, f"{tool} {arguments}: {answer.content}"
        return answer.structured_content or {}

    def refused(self, tool: str, **arguments: Any) -> str:
        """The error of a tool that cannot do it."""
        answer = self._answer(tool, arguments)
        assert answer.is_error, f"{tool} {arguments} went well: {answer.content}"
        return " ".join(item.text for item in answer.content if isinstance(item, TextContent))

    def picture(self, device: str) -> Picture:
        """A small picture of a camera."""
        answer = self._answer("capture_image", {"device": device, **SMALL})
        assert not answer.is_error, answer.content
        image = next(item for item in answer.content if isinstance(item, ImageContent))
        return picture(base64.b64decode(image.data))

    def _answer(self, tool: str, arguments: dict[str, Any]) -> CallToolResult:
        return self.portal.call(partial(self.client.call_tool, tool, arguments, raise_on_error=False))


def _checkout() -> bytes:
    """octoform's files as they stand here, compiled: the guest would need a minute for that."""
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", *_SHIPPED]
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
    with tempfile.TemporaryDirectory(prefix="octoform-vm-") as name:
        for path in filter(None, names):
            if (ROOT / path).is_file():
                target = Path(name, path)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes((ROOT / path).read_bytes())
        if sys.version_info[:2] == (3, 11):
            command = [sys.executable, "-m", "compileall", "-q", "--invalidation-mode", "unchecked-hash"]
            subprocess.run([*command, str(Path(name, "octoform"))], stdout=subprocess.DEVNULL, check=False)
        data = io.BytesIO()
        with tarfile.open(fileobj=data, mode="w") as archive:
            archive.add(name, arcname=".")
        return data.getvalue()
