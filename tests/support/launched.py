"""A running endpoint around any server source: octoform's own publishing, launcher and supervision, no apply.

The development environment's Python stands for the serving environment, so no packages are installed.
"""

import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from fastmcp import Client
from fastmcp.client.transports import StdioTransport, StreamableHttpTransport
from warm import Loaded

from octoform.diagnostics import Diagnostic
from octoform.endpoint.environment.model import Environment
from octoform.endpoint.process import record, start_stop
from octoform.endpoint.process.record import Running, running
from octoform.endpoint.publication import Service, client_command, write_endpoint
from octoform.state.layout import Layout

RUNTIME = Path(__file__).parents[2] / "octoform" / "runtime"
LOOPBACK = {"interface": "127.0.0.1", "port": 7777, "hosts": [], "origins": []}
READ = {"readOnlyHint": True, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}
ACT = {"readOnlyHint": False, "destructiveHint": True, "idempotentHint": False, "openWorldHint": False}


def tool(name: str, effect: str = "read", *devices: str, **more: Any) -> dict[str, Any]:
    """A tool as the INTERFACE artifact has it, as far as the endpoint needs it."""
    hints = READ if effect == "read" else ACT
    return {"name": name, "effect": effect, "devices": list(devices) or ["usb-1"], "annotations": hints, **more}


def policy_of(tools: Sequence[Mapping[str, Any]], changes: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The policy that allows everything; ``changes`` are laid over it: ``mode``, ``stop``, and tools by name."""
    given = dict(changes or {})
    own = given.pop("tools", {})
    allowed = {
        item["name"]: {
            "effect": item["effect"],
            "decision": "allow",
            "source": "default",
            "timeout": 30.0,
            "result_bytes": 10_000_000,
            "buses": item["devices"],
            "limits": [],
            **own.get(item["name"], {}),
        }
        for item in tools
    }
    return {"format": 1, "mode": "enforce", "stop": [], "tools": allowed, **given}


@dataclass(frozen=True)
class Launched:
    """An endpoint that runs."""

    layout: Layout

    @property
    def process(self) -> Running:
        """The process that serves it."""
        found = running(self.layout)
        assert found is not None, self.printed()
        return found

    @property
    def url(self) -> str:
        """Where it answers over HTTP."""
        url = self.process.url
        assert url is not None
        return url

    @property
    def command(self) -> list[str]:
        """What a client of this machine starts."""
        return client_command(self.layout)

    def token(self, name: str = "default") -> str:
        """The value of a token."""
        return (self.layout.run / "tokens" / name).read_text().strip()

    def ask(self, op: str, **question: Any) -> dict[str, Any]:
        """A question to the control thread."""
        answer = record.ask(self.layout, {"op": op, **question})
        assert answer is not None
        return answer

    def client(self, mode: str = "auto", **options: Any) -> Client[Any]:
        """A real client over the pipe; ``async with`` it."""
        program, *arguments = self.command
        return Client(StdioTransport(program, arguments, keep_alive=False), mode=mode, **options)

    def http_client(self, mode: str = "auto", token: str | None = None, **options: Any) -> Client[Any]:
        """A real client over HTTP, with the default token unless another is given."""
        headers = {"Authorization": f"Bearer {self.token() if token is None else token}"}
        return Client(StreamableHttpTransport(self.url, headers=headers), mode=mode, **options)

    def printed(self) -> str:
        """What the process printed so far."""
        return self.layout.server_log.read_text(errors="replace") if self.layout.server_log.exists() else ""

    def stop(self) -> None:
        """End the process; it can be started again."""
        start_stop.stop(self.layout)

    def start(self) -> None:
        """Start it (again)."""
        process, problem = start(self.layout)
        assert process is not None, problem


def start(layout: Layout, seconds: float = start_stop.START_SECONDS) -> tuple[Running | None, Diagnostic | None]:
    """`start_stop.start`, whose process is a fork of one that has loaded what it imports."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(start_stop, "_Detached", Loaded)
        return start_stop.start(layout, seconds)


def write(folder: Path, source: str, service: Service, environ: Mapping[str, str] | None = None) -> Layout:
    """The files of an endpoint in a project folder, not started."""
    layout = Layout(folder, "bench")
    served = layout.output("serve").parent
    served.mkdir(parents=True, exist_ok=True)
    (served / "server.py").write_text(source, encoding="utf-8")
    shutil.copytree(RUNTIME, served / "runtime", ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True)
    environment = Environment(Path(sys.executable), "sha256:0", Path(sys.prefix), "sha256:0")
    problems = write_endpoint(layout, environment, service, environ or {})
    assert not problems, problems
    return layout


@contextmanager
def launched(
    folder: Path,
    source: str,
    tools: Sequence[Mapping[str, Any]],
    *,
    policy: Mapping[str, Any] | None = None,
    network: Mapping[str, Any] | None = None,
    tunnel: Mapping[str, Any] | None = None,
    devices: Sequence[Mapping[str, Any]] = (),
    environ: Mapping[str, str] | None = None,
    loaded: bool = True,
) -> Iterator[Launched]:
    """An endpoint of ``source`` that runs until the block ends; ``network`` makes it answer over HTTP as well.

    Unless ``loaded`` it is started by its launcher, as a person has it, and not a fork of what has loaded its imports.
    """
    scope = "internet" if tunnel else "intranet" if network else "local"
    service = Service(tools, policy_of(tools, policy), devices, scope, network, tunnel)
    endpoint = Launched(write(folder, source, service, environ))
    if network is not None:
        from octoform.endpoint.access.tokens import ensure_default

        ensure_default(endpoint.layout)
    process, problem = (start if loaded else start_stop.start)(endpoint.layout)
    assert process is not None, problem
    try:
        yield endpoint
    finally:
        endpoint.stop()
