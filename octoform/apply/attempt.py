"""One attempt: a fresh folder with prompt, spec copy and task, then the agent, within its time.

The folder is the whole of what an attempt leaves: prompt, log, output, usage and verdict stay there as the record of
what the stage knew. Nothing of a failed attempt is read by anything but the next prompt (a bounded tail of its log).
"""

import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from octoform.apply.context import Context
from octoform.apply.reading import accepted
from octoform.diagnostics import Diagnostic, to_json
from octoform.events import AttemptProgress
from octoform.harness.plainfile import read_plain
from octoform.harness.port import AgentEvent, Harness, Outcome, Said, Task, TaskLimits, Usage
from octoform.manifest.references import resolve
from octoform.profiles import briefing, holds
from octoform.protocol import Prompt, render_prompt
from octoform.state.layout import OUTPUT_NAMES

KEEP = 100
MOST_SPEC_BYTES = 256 * 1024


@dataclass(frozen=True, slots=True)
class Failed:
    """What a failed attempt hands to the next one: why it was refused, its log, its copy of the spec."""

    diagnostics: tuple[Diagnostic, ...]
    log: Path
    spec: Path


def prepare(context: Context, stage: str, number: int, wall_seconds: float, failed: Failed | None) -> Task:
    """Make the folder of attempt ``number`` and everything in it."""
    workdir = _folder(context, stage, number)
    spec, budget = context.specs[stage], context.manifest.budget_for(stage)
    own_spec = workdir / "spec.md"
    own_spec.write_text((edited(failed.spec) if failed else None) or spec.text, encoding="utf-8")
    task = Task(
        stage=stage,
        attempt=number,
        workdir=workdir,
        prompt=workdir / "prompt.md",
        output=workdir / OUTPUT_NAMES.get(stage, "output.json"),
        log=workdir / "agent.log",
        document=workdir / "task.json",
        model=resolved_model(context, stage),
        environment=context.environ,
        limits=TaskLimits(wall_seconds, budget.idle_seconds, budget.turns),
        secrets=context.manifest.variables,
    )
    document = _document(context, task, own_spec, failed)
    task.document.write_text(json.dumps(document, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    task.prompt.write_text(_prompt(context, task, own_spec, failed), encoding="utf-8")
    return task


def edited(copy: Path) -> str | None:
    """What an agent made of its copy of the spec; None when it left no plain file of a sane size in its place."""
    data = read_plain(copy, MOST_SPEC_BYTES + 1)
    return None if data is None or len(data) > MOST_SPEC_BYTES else data.decode("utf-8", "replace")


def run(context: Context, harness: Harness, task: Task) -> Outcome:
    """Let the agent work; its progress becomes events."""

    def progress(event: AgentEvent, elapsed: float, _: Usage) -> None:
        if isinstance(event, Said):
            context.emit(AttemptProgress(task.stage, event.text, elapsed))

    return harness.run(task, progress)


def predecessor(context: Context, stage: str) -> Path | None:
    """The accepted artifact that the stage may read; None for the first."""
    consumes = context.graph.node(stage).consumes
    return context.layout.output(consumes[0]) if consumes else None


def _folder(context: Context, stage: str, number: int) -> Path:
    attempts = context.layout.attempts
    attempts.mkdir(parents=True, exist_ok=True, mode=0o700)
    present = sorted(path.name for path in attempts.iterdir() if path.name.partition("-")[0].isdigit())
    for name in present[: max(0, len(present) - KEEP)]:
        shutil.rmtree(attempts / name)
    latest = int(present[-1].partition("-")[0]) if present else 0
    folder = attempts / f"{latest + 1:06d}-{stage}-{number}"
    folder.mkdir(mode=0o700)
    return folder


def resolved_model(context: Context, stage: str) -> str | None:
    """The stage's model with its references replaced; for the agent's arguments alone, never for a file."""
    model = context.manifest.model_for(stage)
    return None if model is None else resolve(model, context.environ)


def _document(context: Context, task: Task, spec: Path, failed: Failed | None) -> dict[str, object]:
    given = predecessor(context, task.stage)
    schema = context.specs[task.stage].schema
    return {
        "format": 1,
        "stage": task.stage,
        "attempt": task.attempt,
        "host": context.layout.host,
        "input": str(given) if given else None,
        "schema": str(schema) if schema else None,
        "spec": str(spec),
        "prompt": str(task.prompt),
        "output": str(task.output),
        "model": context.manifest.model_for(task.stage),
        "limits": {"wall_seconds": task.limits.wall_seconds, "tools": context.manifest.budget_for(task.stage).tools},
        "diagnostics": _as_json(failed.diagnostics if failed else ()),
    }


def _as_json(items: Sequence[Diagnostic]) -> list[dict[str, object]]:
    return [to_json(item) for item in items]


def _prompt(context: Context, task: Task, own_spec: Path, failed: Failed | None) -> str:
    given = predecessor(context, task.stage)
    return render_prompt(
        Prompt(
            spec=context.specs[task.stage],
            output=task.output,
            input=given,
            workdir=task.workdir,
            own_spec=own_spec,
            tools=context.manifest.budget_for(task.stage).tools,
            wall_seconds=task.limits.wall_seconds,
            profiles=_briefings(context, task.stage),
            failed_log=failed.log if failed else None,
            diagnostics=failed.diagnostics if failed else (),
        )
    )


def _briefings(context: Context, stage: str) -> tuple[str, ...]:
    """What the profiles say, each with the devices of this host for which its evidence holds; nothing otherwise."""
    if stage == "probe" or not context.profiles:
        return ()
    probe = accepted(context, "probe")
    held = [(profile, holds(profile, probe)) for profile in context.profiles]
    return tuple(briefing(profile, devices) for profile, devices in held if devices)
