"""What a program has printed in a recorded run, as events; and what an adapter makes of a task, without the program."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from octoform.harness.adapters.program import Adapter, Launch
from octoform.harness.contained_attempt import Invocation
from octoform.harness.event_parser import Dialect
from octoform.harness.llm.route import Access, access
from octoform.harness.port import AgentEvent, Replying, Task, TaskLimits, Turn
from octoform.harness.program_location import Located
from octoform.manifest.model import HarnessSpec

STREAMS = Path(__file__).parents[2] / "harness" / "streams"
SECRET = "loop-5d81e0c6b7"


def lines(dialect: Dialect, stream: str, *read: bytes | dict[str, Any]) -> list[AgentEvent]:
    """The events of lines, given as bytes or as the object that one holds."""
    whole = [line if isinstance(line, bytes) else json.dumps(line).encode() for line in read]
    return [event for line in whole for event in dialect.read(stream, line)]


def recorded(dialect: Dialect, name: str) -> list[AgentEvent]:
    """The events of a recorded run, pieces of replies left out: first of standard error, then of standard output."""
    errors, output = STREAMS / f"{name}.stderr", STREAMS / f"{name}.jsonl"
    assert errors.exists() or output.exists(), name
    items = lines(dialect, "stderr", *errors.read_bytes().splitlines()) if errors.exists() else []
    items += lines(dialect, "stdout", *output.read_bytes().splitlines()) if output.exists() else []
    return [event for event in items if not isinstance(event, Replying)]


def of(events: list[AgentEvent], kind: type[Any]) -> list[Any]:
    """Those of one kind."""
    return [event for event in events if isinstance(event, kind)]


def without_turns(events: list[AgentEvent]) -> list[AgentEvent]:
    """What remains when the replies are left out, which may stand before or after what they ask for."""
    return [event for event in events if not isinstance(event, Turn)]


def a_task(folder: Path, model: str = "openai/scripted", **limits: Any) -> Task:
    """A task in that folder, with a key in LOOP_KEY."""
    (folder / "prompt.md").write_text("Do it.\n", encoding="utf-8")
    return Task(
        stage="probe",
        attempt=1,
        workdir=folder,
        prompt=folder / "prompt.md",
        output=folder / "output.json",
        log=folder / "task.log",
        document=folder / "task.json",
        model=model,
        environment={"PATH": "/usr/bin:/bin", "LOOP_KEY": SECRET},
        limits=TaskLimits(60.0, **limits),
    )


def invoked(adapter: Adapter, spec: HarnessSpec, model: str, folder: Path, **limits: Any) -> Invocation:
    """How the adapter starts its program (/opt/it) for a task in that folder; the key is `SECRET`."""
    (folder / "home").mkdir()
    task = a_task(folder, model, **limits)
    environ = {"PATH": "/usr/bin:/bin", spec.key or "LOOP_KEY": SECRET}
    task = replace(task, environment=environ)
    way = access(spec, model, adapter.apis, environ)
    assert isinstance(way, Access), way
    program = Located(("/opt/it",), "installed", ("/opt/node",), "1.2.3")
    return adapter.invocation(Launch(task, way, program, spec))


def nowhere_in_files(folder: Path) -> None:
    """The key stands in no file below the folder."""
    holding = [path for path in folder.rglob("*") if path.is_file() and SECRET.encode() in path.read_bytes()]
    assert holding == []
