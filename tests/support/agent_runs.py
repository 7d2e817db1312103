"""What a test needs to run a real agent program on one task against the scripted model, and to see what came of it."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from model_server import ModelServer

from octoform.diagnostics import Diagnostic
from octoform.harness import adapters
from octoform.harness.adapters.program import ProgramHarness
from octoform.harness.containment import orphans
from octoform.harness.port import AgentEvent, Harness, Outcome, Task
from octoform.manifest.model import HarnessSpec

KEY = "LOOP_KEY"
SECRET = "loop-7f3c19d2a4"
PROMPT = "Do what the scripted model says. Grüße.\n"
WRITE = """printf '{"made": true}' > "$OCTOFORM_OUTPUT" """
"""The command by which the scripted model makes the output of `task_for`."""
NOWHERE = "http://127.0.0.1:9"
"""An address without a listener."""


@dataclass
class Ran:
    """A run that has ended: the task, its outcome, and the events in their order."""

    task: Task
    outcome: Outcome
    events: list[AgentEvent] = field(default_factory=list)

    def of(self, kind: type[Any]) -> list[Any]:
        """The events of one kind."""
        return [event for event in self.events if isinstance(event, kind)]


def spec_for(name: str, server: ModelServer | str, **settings: Any) -> HarnessSpec:
    """The harness of that name with its model at the server (or a URL)."""
    url = server if isinstance(server, str) else server.url
    return HarnessSpec(name, key=KEY, base_url=url, **settings)


def kept_secret(ran: Ran) -> bool:
    """True when no file of the attempt holds the key."""
    files = (path for path in ran.task.workdir.rglob("*") if path.is_file())
    return not any(SECRET.encode() in path.read_bytes() for path in files)


def program(name: str) -> ProgramHarness:
    """The installed program's harness, its model nowhere; a test never passes for want of a program."""
    found = harness(spec_for(name, NOWHERE))
    assert isinstance(found, ProgramHarness)
    return found


def harness(spec: HarnessSpec) -> Harness:
    """The harness of a spec, whose program is there."""
    found = adapters.resolve(spec, os.environ)
    assert not isinstance(found, Diagnostic), found
    if isinstance(found, ProgramHarness):
        assert found.locate(environment()) is not None, f"{spec.name} is not installed: octoform install {spec.name}"
    return found


def environment() -> dict[str, str]:
    """What octoform itself would see of the environment here, with the key of the scripted model."""
    kept = ("PATH", "HOME", "XDG_CACHE_HOME", "OCTOFORM_AGENTS")
    return {name: os.environ[name] for name in kept if name in os.environ} | {KEY: SECRET}


def nothing_left(workdir: Path) -> None:
    """No process carries the mark of the attempt in that folder, and the attempt is recorded as ended."""
    record = orphans.read(workdir)
    assert record is not None, "the attempt left no record"
    found = [item.pid for item in orphans.own() if record.is_of(item.pid)]
    assert found == [], [(Path("/proc") / str(pid) / "cmdline").read_bytes() for pid in found]
    assert record.ended
