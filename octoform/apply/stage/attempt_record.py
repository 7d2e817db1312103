"""The record of an attempt: all that octoform knows of it, in ``attempt.json``."""

from collections.abc import Mapping
from contextlib import suppress
from datetime import timedelta
from pathlib import Path

from octoform.apply.context import Context
from octoform.apply.stage.acceptance import Verdict
from octoform.apply.stage.assignment import Assignment
from octoform.apply.stage.attempt import FORMER, PROGRAM, SAID, Prepared, SoFar
from octoform.apply.stage.spec_copy import Edit
from octoform.base.clock import stamp
from octoform.base.digest import of_large_file
from octoform.base.escaping import escaped
from octoform.base.files import walk
from octoform.diagnostics import Diagnostic, to_json
from octoform.harness.contained_attempt import read_usage
from octoform.harness.containment import agent_environment
from octoform.harness.port import ExitReason, Outcome, Task, Usage
from octoform.records import replace
from octoform.redaction import redacted
from octoform.state import attempts, model
from octoform.state.attempts import AttemptRecord, SpecEdit
from octoform.state.layout import OUTPUT_NAMES
from octoform.state.reusable import ReusableOutput

MAX_FILES = 200
OURS = frozenset(
    {
        *("agent.log", "attempt.json", "input.json", "process.json", "prompt.md", "spec.md", "story.txt", "task.json"),
        *("transcript.jsonl", "trials.json", "pictures", PROGRAM, SAID),
        *(f"{FORMER}{name}" for name in ("output.json", *OUTPUT_NAMES.values())),
    }
)
"""octoform's own content of an attempt's folder: files, and the folder of what a step has seen."""


def record(
    context: Context,
    assignment: Assignment,
    prepared: Prepared,
    ended: tuple[Outcome, Verdict],
    edit: Edit | None,
    checks: int = 0,
) -> Diagnostic | None:
    """Write the record of an attempt that has just ended; None when it stands."""
    task, (outcome, verdict) = prepared.task, ended
    secrets = agent_environment.secrets(task.environment, task.secrets)
    written = AttemptRecord(
        number=int(task.workdir.name.partition("-")[0]),
        stage=task.stage,
        attempt=task.attempt,
        role=assignment.role,
        harness=assignment.harness.name,
        model=assignment.model,
        program=outcome.program,
        started_at=_started(context, outcome),
        seconds=round(outcome.seconds, 3),
        reason=outcome.reason.value,
        exit_status=outcome.exit_status,
        detail=redacted(outcome.detail, secrets),
        turns=outcome.turns,
        checks=checks,
        usage=state_usage(outcome.usage),
        prompt_bytes=task.prompt.stat().st_size if task.prompt.is_file() else 0,
        accepted=verdict.accepted and outcome.reason is not ExitReason.INTERRUPTED,
        diagnostics=[to_json(item) for item in verdict.diagnostics],
        files=[redacted(name, secrets) for name in written_files(task.workdir)],
        digests=_digests(task, prepared.given),
        changed=list(prepared.changed),
        spec_edit=spec_edit(edit),
        survivors_killed=outcome.survivors_killed,
        unconfined=outcome.unconfined,
    )
    return attempts.write(task.workdir, written)


def interrupted(context: Context, assignment: Assignment, prepared: Prepared, so_far: SoFar) -> None:
    """Leave the record of an attempt that octoform is stopped in the middle of: what it has used is paid for."""
    task, outcome = prepared.task, so_far.outcome
    if outcome is not None:
        ended = replace(outcome, reason=ExitReason.INTERRUPTED, detail="octoform was stopped before it was judged")
    else:
        is_known = so_far.usage.input_tokens is not None or so_far.usage.output_tokens is not None
        known = so_far.usage if is_known else read_usage(task.workdir)
        seconds = context.clock.monotonic() - so_far.began
        detail = "octoform was stopped while it worked"
        ended = Outcome(ExitReason.INTERRUPTED, None, seconds, detail, known, turns=so_far.turns)
    agent_environment.remove_private(task.workdir)
    # The stop itself is what has to be passed on; an attempt without a record counts as interrupted too.
    with suppress(OSError):
        record(context, assignment, prepared, (ended, Verdict(())), None, so_far.checks)


def reused(
    context: Context, assignment: Assignment, task: Task, verdict: Verdict, source: ReusableOutput
) -> Diagnostic | None:
    """The record of an output that was reused: no agent ran."""
    written = AttemptRecord(
        number=int(task.workdir.name.partition("-")[0]),
        stage=task.stage,
        attempt=task.attempt,
        role="reuse",
        harness=assignment.harness.name,
        model=assignment.model,
        started_at=context.clock.stamp(),
        seconds=0.0,
        reason="reused",
        detail=f"the accepted output of host {source.host}",
        accepted=verdict.accepted,
        diagnostics=[to_json(item) for item in verdict.diagnostics],
        files=[task.output.name],
        digests=_digests(task, _reused_input(assignment.input(context, task.workdir))),
    )
    return attempts.write(task.workdir, written)


def _digests(task: Task, given: Mapping[str, str]) -> dict[str, str]:
    """The digests of this attempt's inputs and outputs; files that are not there are omitted."""
    written = {path.name: of_large_file(path) for path in (task.log, task.transcript, task.output)}
    return dict(sorted({**{name: value for name, value in written.items() if value is not None}, **given}.items()))


def _reused_input(path: Path | None) -> dict[str, str]:
    digest = of_large_file(path) if path is not None else None
    return {"input": digest} if digest is not None else {}


def spec_edit(edit: Edit | None) -> SpecEdit | None:
    """An edit in the words of the record."""
    if edit is None:
        return None
    return SpecEdit(digest=edit.digest, permitted=edit.permitted, added=edit.added, removed=edit.removed)


def state_usage(usage: Usage) -> model.Usage:
    """A usage as the state keeps it."""
    return model.Usage(
        input_tokens=usage.input_tokens,
        cached_tokens=usage.cached_tokens,
        output_tokens=usage.output_tokens,
        cost_usd=usage.cost_usd,
        cost_source=usage.cost_source,
    )


def written_files(workdir: Path) -> list[str]:
    """The files that the agent left in its folder, relative, sorted, bounded; links are named and not followed."""
    found: list[str] = []
    for place, folders, names in walk(workdir):
        own = OURS if place == workdir else frozenset[str]()
        folders[:] = sorted(name for name in folders if name not in own)
        links = (name for name in folders if (place / name).is_symlink())
        kept = sorted(name for name in (*names, *links) if name not in own)
        found += [(place / name).relative_to(workdir).as_posix() for name in kept]
        if len(found) >= MAX_FILES:
            break
    return sorted(map(escaped, found[:MAX_FILES]))


def _started(context: Context, outcome: Outcome) -> str:
    return stamp(context.clock.now() - timedelta(seconds=outcome.seconds))
