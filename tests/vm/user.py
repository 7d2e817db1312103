"""octoform as a person in the guest uses it: the same commands, their output read."""

import io
import json
import shlex
import subprocess
import sys
import tarfile
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastmcp import Client
from fastmcp.client.transports import StdioTransport
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
policy: {timeout: 3m}
"""
APPLY_SECONDS = 1500.0
SLOW_SECONDS = 300.0
"""For what takes a real computer seconds."""


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
        """The JSON object that a command prints."""
        return json.loads(self.guest.run(self.line(*words, "-json"), SLOW_SECONDS))

    def call(self, tool: str, **arguments: Any) -> dict[str, Any]:
        """The whole answer of a tool, called through the live endpoint."""
        line = self.line("call", tool, "-timeout", "3m", "-json", json.dumps(arguments))
        text = self.guest.run(line, SLOW_SECONDS, check=False)
        answer: dict[str, Any] = json.loads(text) if text.startswith("{") else {"is_error": True, "said": text}
        assert "structured" in answer and not answer["is_error"], f"{tool} {arguments}: {text}\n{self.logs()}"
        return answer

    def client(self) -> "Client[StdioTransport]":
        """An MCP client of this machine, to be entered; the server speaks through ssh and `octoform connect`."""
        transport = StdioTransport("ssh", [*self.guest.ssh, self.line("connect", "bench")])
        return Client(transport, timeout=SLOW_SECONDS, init_timeout=SLOW_SECONDS)

    def artifact(self, stage: str) -> dict[str, Any]:
        """What a stage's agent was accepted with."""
        loaded: dict[str, Any] = json.loads(self.guest.read(f"{PROJECT}/state/bench/{stage}/output.json"))
        return loaded

    def attempts(self) -> int:
        """How often an agent was started so far."""
        return int(self.guest.run(f"ls {PROJECT}/.octoform/bench/attempts | grep -c '^[0-9]'", check=False) or 0)


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
