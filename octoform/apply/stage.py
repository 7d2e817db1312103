"""One stage: attempts within a budget, each behind the gate, until one is accepted or the budget is spent.

Fail-stop: a spent budget ends the stage and with it the run. What a failed attempt wrote stays in its folder.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from octoform import events
from octoform.apply import audit, serving
from octoform.apply.attempt import Failed, edited, prepare, run
from octoform.apply.context import Context
from octoform.apply.gate import Verdict, ended_well, judge, read_output
from octoform.apply.leaks import leaked
from octoform.apply.result import Finished
from octoform.apply.settling import settle
from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.harness.port import ExitReason, Harness, Outcome, Task, Usage
from octoform.harness.registry import resolve
from octoform.protocol import PromptTooLarge
from octoform.state.files import full_disk, refused

DELAY_SECONDS = 0.5


@dataclass(slots=True)
class _Progress:
    """What the attempts have used so far."""

    attempts: int = 0
    usage: Usage = field(default_factory=Usage)
    failed: Failed | None = None


def run_stage(context: Context, stage: str) -> Finished:
    """Run the stage's agent until its contract accepts an output; never raises for what an agent does."""
    started = context.clock.monotonic()
    progress = _Progress()
    verdict = _attempts(context, stage, started, progress)
    return Finished(verdict, progress.attempts, progress.usage, context.clock.monotonic() - started)


def _attempts(context: Context, stage: str, started: float, progress: _Progress) -> Verdict:
    budget = context.manifest.budget_for(stage)
    chosen = context.manifest.harness_for(stage)
    harness = resolve(chosen, context.environ, context.layout.project)
    if isinstance(harness, Diagnostic):
        return Verdict((harness,))
    verdict = Verdict(())
    while progress.attempts < budget.attempts:
        left = budget.stage_seconds - (context.clock.monotonic() - started)
        if left <= 0:
            return _spent(verdict, stage, budget.stage_seconds)
        progress.attempts += 1
        context.emit(events.AttemptStarted(stage, progress.attempts, budget.attempts, harness.name))
        outcome, verdict = _attempt(context, stage, harness, min(left, budget.attempt_seconds), progress)
        if verdict.accepted or outcome is None or outcome.reason is ExitReason.NOT_INSTALLED:
            return verdict
        context.emit(events.AttemptFailed(stage, progress.attempts, verdict.diagnostics, outcome.seconds))
        full = full_disk(context.layout)
        if full is not None:
            return replace(verdict, diagnostics=(full,))
        if outcome.exit_status not in (0, None):
            context.clock.sleep(DELAY_SECONDS)
    return verdict


def _spent(verdict: Verdict, stage: str, seconds: float) -> Verdict:
    spent = error(
        "APPLY-BUDGET-SPENT",
        f"the stage budget of {stage} ({seconds:.0f} s) is spent",
        hint="raise budget.stage_timeout in octopus.yaml, or look at the attempts to see what took so long",
    )
    return replace(verdict, diagnostics=(*verdict.diagnostics, spent))


def _attempt(
    context: Context, stage: str, harness: Harness, wall_seconds: float, progress: _Progress
) -> tuple[Outcome | None, Verdict]:
    """The agent's end and the gate's word; no outcome when no agent could be started and none should be again."""
    try:
        task = prepare(context, stage, progress.attempts, wall_seconds, progress.failed)
    except PromptTooLarge as problem:
        return None, Verdict((error("APPLY-PROMPT-TOO-LARGE", str(problem), hint="shorten the spec or the profiles"),))
    except OSError as problem:
        progress.attempts -= 1
        return None, Verdict((refused(problem, context.layout.attempts),))
    watch = _watch(context)
    try:
        outcome = run(context, harness, task)
        progress.usage = _add(progress.usage, outcome.usage)
        verdict = _gate(context, task, outcome, audit.end(watch))
        _note_edit(context, task)
    except OSError as problem:  # a full disk, or an agent that has made away with its own folder
        outcome = Outcome(ExitReason.CRASHED, None, 0.0)
        verdict = Verdict((*audit.end(watch), refused(problem, task.workdir)))
    if not verdict.accepted:
        progress.failed = Failed(verdict.diagnostics, task.log, task.workdir / "spec.md")
    return outcome, verdict


def _gate(context: Context, task: Task, outcome: Outcome, touched: list[Diagnostic]) -> Verdict:
    ended = ended_well(outcome, task)
    if ended or has_errors(touched):
        return Verdict((*touched, *ended))
    data, found = read_output(task)
    secret = leaked(task, data)
    if secret:
        task.output.unlink()
    if found or secret:
        return Verdict((*touched, *found, *secret))
    value, found = judge(context, task, data)
    found = [*touched, *found]
    if has_errors(found):
        return Verdict(tuple(found))
    return _prove(context, task, value, found)


def _prove(context: Context, task: Task, value: Any, found: list[Diagnostic]) -> Verdict:
    """SERVE and DEPLOY are also proved by running them; the other stages are values only."""
    proof = serving.PROOFS.get(task.stage)
    if proof is None:
        return settle(context, task.stage, value, found)
    more, files, detail = proof(context, task, value)
    found += more
    if has_errors(found):
        return Verdict(tuple(found))
    verdict = settle(context, task.stage, value, found, files)
    return replace(verdict, detail={**verdict.detail, **detail}, found=_joined(verdict.found, detail))


def _joined(found: str, detail: Mapping[str, object]) -> str:
    said = detail.get("said")
    return f"{found}, {said}" if said else found


def _watch(context: Context) -> audit.Watch:
    layout, manifest = context.layout, context.manifest
    files = [manifest.path, *manifest.profiles, *(spec.path for spec in context.specs.values())]
    return audit.begin(layout.project, files, [layout.committed])


def _note_edit(context: Context, task: Task) -> None:
    copy = task.workdir / "spec.md"
    if edited(copy) not in (None, context.specs[task.stage].text):
        context.emit(
            events.Notice(task.stage, f"the agent edited its copy of the spec: {copy.name} in {task.workdir.name}")
        )


def _add(before: Usage, after: Usage) -> Usage:
    def total(name: str) -> Any:
        values = [value for value in (getattr(before, name), getattr(after, name)) if value is not None]
        return sum(values) if values else None

    return Usage(*(total(name) for name in ("input_tokens", "cached_tokens", "output_tokens", "cost_usd")))
