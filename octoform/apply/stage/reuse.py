"""Reuse: an output that was accepted for another host with the same input hash, used without running an agent.

It passes the same gate as an agent's output, on this host: schema, rules against this host's own artifacts, and for
SERVE and DEPLOY the proof by running. What does not pass is left, and the next host's is tried; behind a few of those
the stage's agent runs.
"""

import os
from typing import Any

from octoform import events
from octoform.apply.context import Context
from octoform.apply.stage.acceptance import Finished, Verdict, judge
from octoform.apply.stage.assignment import of_stage
from octoform.apply.stage.attempt import new_task
from octoform.apply.stage.attempt_loop import prove
from octoform.apply.stage.attempt_record import reused
from octoform.base import files
from octoform.diagnostics import has_errors
from octoform.harness.port import Task, TaskLimits, Usage
from octoform.records import replace
from octoform.state.accepted import file_digest
from octoform.state.files import read_regular
from octoform.state.reusable import ReusableOutput

MAX_REFUSED = 5
"""A test of a server takes as long as an agent's run may; behind so many that do not hold, the agent is asked."""


def take(context: Context, stage: str, key: str) -> Finished | None:
    """The stage done with another host's output; None when there is none that is accepted here.

    The first that holds is taken. Each that does not is reported, but for copies of one that was reported already.
    """
    started = context.clock.monotonic()
    judged: set[bytes] = set()
    refused = 0
    for donor in context.donors().get(stage, {}).get(key, ()):
        if refused == MAX_REFUSED:
            break
        data, _ = read_regular(donor.layout.output(stage))
        if data is None or file_digest(donor.layout, stage) != donor.state.file_digest:
            reason = "is not as it was accepted"
        elif data in judged:
            continue
        else:
            judged.add(data)
            context.emit(events.Checking(stage, f"reusing the output of host {donor.host}"))
            verdict = _verdict(context, stage, donor, data)
            if verdict.accepted:
                return Finished(verdict, 0, Usage(), context.clock.monotonic() - started)
            first = next(item for item in verdict.diagnostics if item.severity == "error")
            reason = f"does not hold here ({first.code}: {first.summary})"
        refused += 1
        context.emit(events.Notice(stage, f"the output of host {donor.host} {reason}; not reused"))
    return None


def _verdict(context: Context, stage: str, source: ReusableOutput, data: bytes) -> Verdict:
    assignment = of_stage(context, stage)
    task = new_task(context, assignment, 0, TaskLimits(assignment.budget.attempt_seconds))
    files.replace(task.output, data, 0o644, synced=False)
    verdict = _gate(context, task, data)
    reused(context, assignment, task, verdict, source)
    if not verdict.accepted:
        return verdict
    detail = {**verdict.detail, "reused": provenance(context, source)}
    return replace(verdict, detail=detail, found=f"{verdict.found}; reused from host {source.host}")


def _gate(context: Context, task: Task, data: bytes) -> Verdict:
    value: Any
    value, found = judge(context, task, data)
    return Verdict(tuple(found)) if value is None or has_errors(found) else prove(context, task, value, found)


def provenance(context: Context, source: ReusableOutput) -> dict[str, object]:
    """Where an output comes from, for the state: host, project folder relative to this one's, state, who made it."""
    state = source.state
    made = state.detail.get("reused")
    origin = made if isinstance(made, dict) else {}
    return {
        "host": source.host,
        "project": _relative(source, context),
        "serial": source.serial,
        "accepted_at": state.accepted_at,
        "made_for": origin.get("made_for", source.host),
        "attempts": state.attempts,
    }


def _relative(source: ReusableOutput, context: Context) -> str:
    return os.path.relpath(source.layout.project, context.layout.project.resolve())
