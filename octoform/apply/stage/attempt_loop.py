"""One stage: attempts within a budget, each behind the gate, until one is accepted or the budget is spent.

Fail-stop: a spent budget ends the stage and with it the run. What a failed attempt wrote stays in its folder.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from octoform import events
from octoform.apply import file_integrity, protected_paths
from octoform.apply.context import Context
from octoform.apply.stage import escalation, serve_proof, spec_copy
from octoform.apply.stage.acceptance import Finished, Verdict, cleared, ended_well, read_output
from octoform.apply.stage.artifact_writer import settle
from octoform.apply.stage.assignment import UNMEASURED, Assignment, of_stage, unaffordable
from octoform.apply.stage.attempt import Failed, Prepared, SoFar, prepare, run
from octoform.apply.stage.attempt_record import interrupted, record
from octoform.apply.stage.secret_scan import leaked, masked, without_secrets
from octoform.apply.stage.serve_feedback import is_earlier_fault, remembered
from octoform.apply.stage.spec_copy import Edit
from octoform.base import files
from octoform.base.files import replace as replace_file
from octoform.base.shortage import is_shortage
from octoform.diagnostics import Diagnostic, error, has_errors, warning
from octoform.endpoint.process.record import STOPPED
from octoform.harness import transcript
from octoform.harness.adapters import resolve
from octoform.harness.containment import agent_environment, sandbox
from octoform.harness.port import (
    AgentEvent,
    Closed,
    ExitReason,
    Harness,
    ModelProblem,
    Outcome,
    Output,
    Task,
    TaskLimits,
    ToolCalled,
    ToolReturned,
    Usage,
)
from octoform.harness.watcher import added
from octoform.protocol import PromptTooLarge
from octoform.state import attempts as spec_edits
from octoform.state.files import full_disk, refused, unforeseen_refusal

# The log of a failed attempt as its successor can use it.
#
# What a coding-agent program prints is a stream of records for machines, of which a few kilobytes say nothing. Its
# transcript has the same in one line for each thing that it did.

FILE_NAME = "story.txt"
MAX_LINES = 400


def readable_log(task: Task, outcome: Outcome) -> Path:
    """The file to quote from: the story of a program whose output was read, else the log as it is.

    OSError when the attempt's folder cannot be written.
    """
    if outcome.turns is None:
        return task.log
    items = [(moment.at, _line(moment.event)) for moment in transcript.read(task.transcript)]
    lines = [f"{at:7.1f} s  {text}" for at, text in items if text]
    if not lines:
        return task.log
    story = task.workdir / FILE_NAME
    replace_file(story, "".join(f"{line}\n" for line in lines[-MAX_LINES:]).encode(), 0o644, synced=False)
    return story


def _line(event: AgentEvent) -> str:
    match event:
        case Output():
            return f"message: {event.text}" if event.text else ""
        case ToolCalled():
            return f"{event.tool}: {event.text}"
        case ToolReturned():
            return "  that failed" if event.failed else ""
        case ModelProblem():
            return f"the model's side failed: {event.text}"
        case Closed():
            return f"it ended: {event.text}" if event.text else ""
    return ""


DELAY_SECONDS = 0.5
IDLE_SECONDS = 120.0
"""For agents whose output shows what they do; others may work for minutes and print nothing."""
FARAWAY_SECONDS = 5.0
HOPELESS = frozenset({ExitReason.NOT_INSTALLED, ExitReason.AUTH, ExitReason.REFUSED, ExitReason.BUDGET})
"""Ends after which another attempt can only end the same way."""
FARAWAY = frozenset({ExitReason.RATE_LIMIT, ExitReason.UNREACHABLE})
"""Ends that lie with the model's provider, who is given longer from attempt to attempt."""


@dataclass(slots=True)
class _Progress:
    """The usage of the attempts so far, and the last one's feedback."""

    attempts: int = 0
    usage: Usage = field(default_factory=Usage)
    failed: Failed | None = None
    edit: Edit | None = None
    program: str | None = None


def run_stage(context: Context, stage: str, failed: Failed | None = None) -> Finished:
    """Run the stage's agent until its contract accepts an output; never raises for what an agent does.

    ``failed`` is what a later stage found wrong with the stage's accepted output.
    """
    finished = fulfil(context, of_stage(context, stage), failed)
    more = escalation.of_unknown(context, stage, finished.verdict) if finished.verdict.accepted else None
    return finished if more is None else _joined(finished, fulfil(context, more), more)


def _joined(first: Finished, second: Finished, more: Assignment) -> Finished:
    verdict = second.verdict
    if verdict.accepted:
        detail = escalation.detail(first.verdict, verdict, more)
        text = f"{verdict.found}; {detail['asked']} asked of {more.harness.name}"
        verdict = replace(verdict, detail={**verdict.detail, "escalated": detail}, found=text)
    return Finished(
        verdict=verdict,
        attempts=first.attempts + second.attempts,
        usage=added(first.usage, second.usage),
        seconds=first.seconds + second.seconds,
        program=first.program,
    )


def fulfil(context: Context, assignment: Assignment, failed: Failed | None = None) -> Finished:
    """Run the agent of one assignment until an output of it is accepted or its budget is spent."""
    place = assignment.stage, assignment.role
    attempts, seconds = context.purse.used.get(place, (0, 0.0))
    began = context.clock.monotonic()
    progress = _Progress(attempts, failed=failed)
    context.purse.until = began - seconds + assignment.budget.stage_seconds
    try:
        verdict = _attempts(context, assignment, began - seconds, progress)
    finally:
        context.purse.until = None
    elapsed = context.clock.monotonic() - began
    context.purse.used[place] = progress.attempts, seconds + elapsed
    if verdict.accepted and progress.edit is not None:
        edit = {"digest": progress.edit.digest, "base": context.specs[assignment.stage].digest}
        verdict = replace(verdict, detail={**verdict.detail, "spec_edit": edit})
    return Finished(verdict, progress.attempts - attempts, progress.usage, elapsed, progress.program)


def may_go_on(context: Context, stage: str) -> bool:
    """Whether the budget of a stage has an attempt left in this run, and time for it."""
    budget = context.manifest.budget_for(stage)
    attempts, seconds = context.purse.used.get((stage, of_stage(context, stage).role), (0, 0.0))
    return attempts < budget.attempts and seconds < budget.stage_seconds


def _attempts(context: Context, assignment: Assignment, started: float, progress: _Progress) -> Verdict:
    budget, stage = assignment.budget, assignment.stage
    harness = resolve(assignment.harness, context.environ, context.layout.project)
    if isinstance(harness, Diagnostic):
        return Verdict((harness,))
    verdict = Verdict(())
    while progress.attempts < budget.attempts:
        limits, stopped = _limits(context, assignment, context.clock.monotonic() - started)
        if stopped is not None:
            return replace(verdict, diagnostics=(*verdict.diagnostics, stopped))
        progress.attempts += 1
        context.emit(events.AttemptStarted(stage, progress.attempts, budget.attempts, harness.name))
        outcome, verdict = _attempt(context, assignment, harness, limits, progress)
        progress.program = outcome.program if outcome is not None else None
        if verdict.accepted or outcome is None or outcome.reason is ExitReason.NOT_INSTALLED:
            return verdict
        context.emit(events.AttemptFailed(stage, progress.attempts, verdict.diagnostics, outcome.seconds))
        full = full_disk(context.layout)
        if full is not None:
            return replace(verdict, diagnostics=(full,))
        if verdict.last or outcome.reason in HOPELESS or is_earlier_fault(stage, verdict.diagnostics):
            return verdict
        if progress.attempts < budget.attempts:
            context.clock.sleep(_delay(outcome, progress.attempts))
    return verdict


def _limits(context: Context, assignment: Assignment, elapsed: float) -> tuple[TaskLimits, Diagnostic | None]:
    """The budget of the next attempt, or why there is none."""
    budget, stage = assignment.budget, assignment.stage
    left = budget.stage_seconds - elapsed
    usd = context.purse.left(stage, budget.usd, context.manifest.run_usd)
    idle = budget.idle_seconds
    if idle is None and assignment.harness.name not in UNMEASURED:
        idle = IDLE_SECONDS
    limits = TaskLimits(min(left, budget.attempt_seconds), idle, budget.turns, usd)
    if left <= 0:
        return limits, _spent(stage, budget.stage_seconds)
    return limits, unaffordable(context, assignment, usd)


def _delay(outcome: Outcome, attempts: int) -> float:
    if outcome.reason in FARAWAY:
        return FARAWAY_SECONDS * attempts
    return DELAY_SECONDS if outcome.reason is not ExitReason.FINISHED else 0.0


def _spent(stage: str, seconds: float) -> Diagnostic:
    return error(
        "APPLY-BUDGET-SPENT",
        f"the stage budget of {stage} ({seconds:.0f} s) is spent",
        hint="raise budget.stage_timeout in octopus.yaml, or look at the attempts to see what took so long",
    )


def _attempt(
    context: Context, assignment: Assignment, harness: Harness, limits: TaskLimits, progress: _Progress
) -> tuple[Outcome | None, Verdict]:
    """The agent's end and the gate's word; no outcome when no agent could be started and none should be again."""
    try:
        prepared = prepare(context, assignment, progress.attempts, limits, progress.failed)
    except PromptTooLarge as problem:
        return None, Verdict(
            (error("APPLY-PROMPT-TOO-LARGE", str(problem), hint="shorten the spec, the profiles or the answers"),)
        )
    except OSError as problem:
        progress.attempts -= 1
        return None, Verdict((refused(problem, context.layout.attempts),))
    task, guard = prepared.task, protected_paths.begin(context, prepared.task)
    touched: list[Diagnostic] | None = None
    edit, so_far = None, SoFar(context.clock.monotonic())
    try:
        outcome = run(context, assignment, harness, task, so_far)
        touched = guard.end(cleared(task.workdir / protected_paths.UNDONE))
        verdict = _gate(context, assignment, task, outcome, touched)
        edit = _note_edit(context, prepared)
    except OSError as problem:  # a full disk, or an agent that has made away with its own folder
        outcome = Outcome(ExitReason.CRASHED, None, 0.0)
        found = guard.end(cleared(task.workdir / protected_paths.UNDONE)) if touched is None else touched
        verdict = Verdict((*found, _refusal(problem, task.workdir)), last=is_shortage(problem))
    except BaseException:
        # What the agent did to others' files is undone also when its output is no longer awaited; later
        # differences are of a repair that is being tried, which its own way back takes away.
        if touched is None:
            guard.end(cleared(task.workdir / protected_paths.UNDONE))
        interrupted(context, assignment, prepared, so_far)
        raise
    verdict = replace(verdict, diagnostics=without_secrets(task, verdict.diagnostics))
    if any(item.code == file_integrity.NOT_UNDONE for item in verdict.diagnostics):
        verdict = replace(verdict, last=True)  # the next attempt would take what is there for a person's
    used = added(prepared.usage, outcome.usage)
    progress.usage = added(progress.usage, used)
    context.purse.pay(assignment.stage, used)
    progress.edit = edit if edit is not None and edit.permitted else progress.edit
    if not verdict.accepted:
        spec = progress.edit.text if progress.edit is not None else prepared.spec
        before = progress.failed or Failed((), None, spec)
        failed = replace(before, diagnostics=verdict.diagnostics, log=_log(task, outcome), spec=spec)
        progress.failed = remembered(context, assignment, task, (outcome, verdict), failed)
    # The agent may have removed its own folder or filled the disk; the verdict reports both already.
    record(context, assignment, prepared, (outcome, verdict), edit, so_far.checks)
    return outcome, verdict


def _refusal(problem: OSError, place: Path) -> Diagnostic:
    return unforeseen_refusal(problem) if is_shortage(problem) else refused(problem, place)


def _log(task: Task, outcome: Outcome) -> Path:
    try:
        return readable_log(task, outcome)
    except OSError:
        return task.log  # a full disk, or no folder any more: octoform's next write reports it


def _gate(context: Context, assignment: Assignment, task: Task, outcome: Outcome, touched: list[Diagnostic]) -> Verdict:
    touched = [*touched, *_unconfined(context, assignment, outcome)]
    ended = ended_well(outcome, task)
    if ended or has_errors(touched):
        return Verdict((*touched, *ended), last=any(item.code == "SYSTEM-NO-PROCESSES" for item in ended))
    data, found = read_output(task)
    data, blanked = masked(task, data)
    if blanked:
        files.replace(task.output, data, 0o644, synced=False)
    secret = leaked(task, data)
    if secret:
        task.output.unlink()
    if found or secret:
        return Verdict((*touched, *found, *secret))
    value, found = assignment.judge(context, task, data)
    found = [*touched, *blanked, *found]
    if has_errors(found):
        return Verdict(tuple(found))
    return (assignment.prove or prove)(context, task, value, found)


def _unconfined(context: Context, assignment: Assignment, outcome: Outcome) -> list[Diagnostic]:
    """A warning for an agent that could not be confined although the machine can confine agents."""
    wanted = assignment.harness.sandbox
    if not outcome.unconfined or sandbox.unconfined(context.environ, wanted):
        return []
    text = f"the agent of {assignment.stage} ran without a sandbox: {outcome.unconfined}"
    return [warning("HARNESS-UNCONFINED", text, hint="it could write everything that you may write")]


def prove(context: Context, task: Task, value: Any, found: list[Diagnostic]) -> Verdict:
    """SERVE and DEPLOY are also proved by running them; the other stages are values only."""
    proof = serve_proof.PROOFS.get(task.stage)
    if proof is None:
        return settle(context, task.stage, value, found)
    watch = protected_paths.of_sources(context)
    more, files, detail = proof(context, task, value)
    found += [*more, *file_integrity.end(watch, task.workdir / protected_paths.UNDONE)]
    if has_errors(found):
        until = context.purse.until
        if until is not None and context.clock.monotonic() >= until:  # and whatever it was doing was cut short
            found.append(_spent(task.stage, context.manifest.budget_for(task.stage).stage_seconds))
        return Verdict(tuple(found), last=any(item.code == STOPPED for item in found))
    verdict = settle(context, task.stage, value, found, files)
    return replace(verdict, detail={**verdict.detail, **detail}, found=_with(verdict.found, detail))


def _with(found: str, detail: Mapping[str, object]) -> str:
    result = detail.get("said")
    return f"{found}, {result}" if result else found


def _note_edit(context: Context, prepared: Prepared) -> Edit | None:
    """Show the agent's edit of its copy of the spec, and keep it for a person if it was asked for one."""
    task = prepared.task
    secrets = agent_environment.secrets(task.environment, task.secrets)
    edit = spec_copy.look(task.workdir, prepared.spec, secrets, permitted=prepared.editable)
    if edit is None:
        return None
    context.emit(events.SpecEdited(task.stage, task.attempt, edit.permitted, edit.diff))
    if edit.permitted:
        base = context.specs[task.stage]
        spec_edits.keep_edit(
            context.layout,
            spec_edits.PendingEdit(
                stage=task.stage,
                base=base.digest,
                digest=edit.digest,
                text=edit.text,
                attempt=task.workdir.name,
            ),
        )
    return edit
