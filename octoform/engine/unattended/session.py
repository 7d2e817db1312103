"""Runs the daemon's agents on a host: by the same way as an apply, and only on an applied host. (Heavy.)

Who diagnoses or fixes stands on the accepted artifacts, and a repair on the endpoint that was published from them.
Where files are not as they were accepted, or a person has begun to change the project, a repair is put off: it would
carry half of that change into service.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from octoform.apply.context import Clock, Context
from octoform.apply.repair_outcome import RepairOutcome
from octoform.apply.rewrite import promotion
from octoform.apply.stage.serve_proof import service_of
from octoform.apply.watch import WATCH, watch
from octoform.claims.settings import bound_documents
from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.endpoint.process.record import is_marked, unmark
from octoform.endpoint.publication import is_published, is_published_for
from octoform.engine.apply.session import (
    HostRefused,
    Locked,
    Means,
    Opened,
    commit_run,
    context_of,
    locked,
    logging_to,
    opened,
)
from octoform.engine.plan import memo
from octoform.engine.plan.configuration import compile_project
from octoform.engine.plan.refresh import look
from octoform.events import Event, Notice
from octoform.harness.containment.orphans import sweep
from octoform.profiles.registers import RegisterDefinition
from octoform.records import replace
from octoform.state.accepted import observe
from octoform.state.layout import STAGES, Layout
from octoform.state.model import Status
from octoform.state.store.store import Ports

LOCK_SECONDS = 30.0
"""How long a duty waits for somebody else who works on the host: longer than a plan, shorter than an apply."""

Work = Callable[[Context], RepairOutcome]


def run_task(
    project: Path, environ: Mapping[str, str], operation: str, work: Work, ports: Ports | None = None
) -> RepairOutcome:
    """Do the work under the lock of the host's state; what is in the way is an answer too.

    ``operation`` is the lock's operation meanwhile. The state file is written again, and committed where the manifest
    states that, when another server is the accepted one afterwards.
    """
    with locked(project, environ, operation, LOCK_SECONDS) as held:
        if isinstance(held, HostRefused):
            return RepairOutcome.of_diagnostics(held.diagnostics)
        there = opened(held.compiled, ports)
        if isinstance(there, HostRefused):
            return RepairOutcome.of_diagnostics(there.diagnostics)
        with logging_to(held.compiled.layout.call_log, Clock(), _no_sink) as emit:
            sweep(held.compiled.layout.attempts)
            for text in (*held.notices, *there.undone, *there.finished):
                emit(Notice(operation, text))
            means = Means(environ, emit, checkpoint=(ports or Ports()).checkpoint)
            return _worked(held, there, means, operation, work)


def _worked(held: Locked, there: Opened, means: Means, operation: str, work: Work) -> RepairOutcome:
    compiled, store = held.compiled, there.store
    unready = _unready(held, there)
    if unready is not None:
        return RepairOutcome.of_diagnostics([unready])
    context = context_of(compiled, look(compiled, store.snapshot, means.environ), store, means)
    if there.finished and not is_marked(compiled.layout):
        # What a killed run had begun is carried through; the endpoint is published from it, as the next plan expects.
        found = promotion.published(context, smoke=False)
        if has_errors(found):
            return RepairOutcome.of_diagnostics(found)
    try:
        answer = work(context)
    except BaseException:
        # An orderly stop closes the journal. Where that fails, the journal stays, and the next run folds it in.
        store.commit_snapshot()
        raise
    return _recorded(held, there, operation, answer)


def _recorded(held: Locked, there: Opened, operation: str, answer: RepairOutcome) -> RepairOutcome:
    """The state file and the commit; a repair that is in service and not recorded is stated, and still one."""
    layout, unsettled = held.compiled.layout, there.store.unsettled
    found = there.store.commit_snapshot()
    if not unsettled:
        return answer
    memo.path_of(layout.project).unlink(missing_ok=True)
    if held.compiled.manifest.git.commit and not has_errors(found):
        _, more = commit_run(layout, there.store.snapshot, operation)
        found += more
    if not has_errors(found):
        return answer
    return replace(answer, reasons=(*answer.reasons, *RepairOutcome.of_diagnostics(found).reasons))


def _unready(held: Locked, there: Opened) -> Diagnostic | None:
    """Why nothing can be done on what is there: not all of it is accepted, or some of it is not as it was accepted."""
    nodes, files = there.store.snapshot.nodes, observe(held.compiled.layout)
    for stage in STAGES:
        known = nodes.get(stage)
        if known is None or known.status is not Status.ACCEPTED:
            summary = f"{stage} has no accepted output: there is nothing that an agent could keep working"
            return error("DUTY-NOT-APPLIED", summary, hint="octoform apply")
        if files[stage].digest != known.file_digest:
            summary = f"the files of {stage} are not as they were accepted"
            return error("DUTY-CHANGED", summary, hint="octoform plan shows it, octoform apply puts it in order")
    return None


def ready(context: Context) -> list[Diagnostic]:
    """Why no other server may be put in service now: errors, and none where the endpoint is what it was applied as."""
    if is_marked(context.layout):
        summary = "a person has stopped the endpoint, and a repair would start it"
        return [error("DUTY-STOPPED", summary, hint="octoform start brings it back")]
    # A killed run may have left another server in service than the accepted one.
    found = promotion.put_back(context, smoke=False)
    if has_errors(found) or is_published(context.layout, service_of(context), context.environ):
        return found
    summary = "the endpoint is not what the manifest and the accepted artifacts make of it now"
    hint = "octoform apply brings what was changed into service; until then no agent works on it"
    return [*found, error("DUTY-CHANGED", summary, hint=hint)]


def _no_sink(_: Event) -> None:
    """No one watches a background task; the execution log has it."""


# WATCH on a host: what the daemon has seen becomes a report, or nothing is known. (Heavy.)


def diagnose(project: Path, environ: Mapping[str, str], brief: Mapping[str, Any]) -> RepairOutcome:
    """Ask the agent of WATCH how the deployment is.

    ``brief`` is ``{causes, readings, failures, claims, summary, since, target, calls}``; ``calls`` bounds the attempts.
    ``report`` of the outcome is the accepted output, None when there is none: then how the deployment is stays unknown.
    Nothing of the host is changed.
    """
    return run_task(project, environ, WATCH, lambda context: watch(context, brief))


# What the project's profiles call clean of what its tools measure, for the ledger of claims.


def bounds(project: Path, environ: Mapping[str, str]) -> list[dict[str, Any]]:
    """Plain values, for `octoform.claims.settings.bounds_of`; none for a project that does not compile.

    Fewer bounds refuse fewer claims, and those that are believed still end by their own readings.
    """
    compiled, _ = compile_project(project, environ)
    if compiled is None:
        return []
    grammars = [(profile.name, profile.grammar) for profile in compiled.profiles]
    registers = [(name, one.registers) for name, one in grammars if isinstance(one, RegisterDefinition)]
    return bound_documents(compiled.layout, [(name, one.protect) for name, one in registers if one.protect is not None])


# An endpoint of this folder's own, where the one that is there was written for another: a copy, a moved one. (Heavy.)
#
# What was applied is carried over as it is: no agent is asked, no tool is called, and nothing of an edited manifest
# comes into service by the way. The original keeps its process, its sockets and its units.


def take_over(layout: Layout, environ: Mapping[str, str], foreign: Diagnostic) -> Diagnostic | None:
    """Write the endpoint for this folder and start it; ``foreign`` with the reason where that cannot be."""
    done = run_task(layout.project, environ, "start", _published)
    return None if done.ok else replace(foreign, detail=done.detail)


def _published(context: Context) -> RepairOutcome:
    if not is_published_for(context.layout, service_of(context), context.environ):
        text = "the manifest was edited since it was applied, or the endpoint's files were"
        return RepairOutcome.refused("start.edited", text)
    unmark(context.layout)  # a person starts it, and the daemon judges nothing while this holds the state's lock
    found = promotion.published(context, smoke=False)
    if has_errors(found):
        return RepairOutcome.of_diagnostics(found)
    return RepairOutcome.done("start.own", "the endpoint is this folder's own")
