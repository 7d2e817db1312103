"""HEAL on a host: a repair that was tried takes its place, and is taken back where it made things worse. (Heavy.)

A rewrite is tried and adopted while the agent's work is judged. Any other action is octoform's own, and is carried out
once the agent has ended: the same repairs that triage has, and the packages decided again.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from octoform.apply import heal as healing
from octoform.apply.context import Context
from octoform.apply.repair_outcome import RepairOutcome, RepairVerdict
from octoform.apply.rewrite import pending_rewrite, promotion
from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.endpoint.process import estop, start_stop
from octoform.endpoint.process.record import is_marked
from octoform.engine.tools import layout_of
from octoform.engine.unattended.rediscover import Left, redeploy, rediscover
from octoform.engine.unattended.repairs import restore
from octoform.engine.unattended.session import ready, run_task
from octoform.manifest.loader import load
from octoform.manifest.model import FILE_NAME
from octoform.state.layout import Layout, is_left
from octoform.state.store.store import Ports

ROLL_BACK, SETTLE, CONFIRM = "roll_back", "settle", "confirm"
ASK = "ask"


def heal(
    project: Path, environ: Mapping[str, str], brief: Mapping[str, Any], ports: Ports | None = None
) -> RepairOutcome:
    """Ask the agent of HEAL for a repair of one error, and carry out what it proposes where that holds.

    ``brief`` is ``{error, readings, failures, target, episode, since}``, ``error`` one of a report of WATCH. The
    outcome's ``report`` names the action that was done.
    """
    answer = run_task(project, environ, healing.HEAL, lambda context: _done(context, healing.heal, brief), ports)
    act = ACTIONS.get(str((answer.report or {}).get("action"))) if answer.ok else None
    layout, _ = layout_of(project, environ)
    if act is None or layout is None:
        return answer
    if estop.is_engaged(layout):
        text = "an emergency stop was given meanwhile, so nothing is carried out"
        return RepairOutcome.refused("heal.estop", text).after(answer)
    return act(layout, environ, Left.of(brief, answer.spent.calls, answer.spent.usd)).after(answer)


def roll_back(
    project: Path, environ: Mapping[str, str], brief: Mapping[str, Any], ports: Ports | None = None
) -> RepairOutcome:
    """Put the server back that an incident's repair has replaced; ``brief`` is ``{episode, reason}``."""
    return run_task(project, environ, ROLL_BACK, lambda context: _done(context, healing.roll_back, brief), ports)


def waiting_rewrite(project: Path, environ: Mapping[str, str], identity: str) -> pending_rewrite.Rewrite | None:
    """The rewrite of what moves a device that waits for a person under this id; None where none does."""
    layout, _ = layout_of(project, environ)
    return pending_rewrite.read(layout, identity) if layout is not None else None


def waiting_rewrites(project: Path, environ: Mapping[str, str]) -> list[pending_rewrite.Rewrite]:
    """All rewrites that wait for a person, the oldest first."""
    layout, _ = layout_of(project, environ)
    return pending_rewrite.waiting(layout) if layout is not None else []


def decide_rewrite(
    project: Path, environ: Mapping[str, str], rewrite: pending_rewrite.Rewrite, *, yes: bool
) -> Diagnostic | None:
    """Put it in service, or drop it; None when that is done."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return found[0]
    if not yes:
        return pending_rewrite.forget(layout, rewrite.id)
    answer = run_task(
        project, environ, CONFIRM, lambda context: _done(context, lambda here, _: healing.confirm(here, rewrite), {})
    )
    if answer.ok:
        return None
    hint = "octoform plan shows the state of the endpoint; the rewrite still waits"
    return error("HEAL-NOT-CONFIRMED", f"{rewrite.id} is not in service: {answer.detail}", hint=hint)


def settle(layout: Layout, environ: Mapping[str, str]) -> RepairOutcome | None:
    """Finish or take back what a killed repair or step has left in service; None when it has left nothing."""
    if not is_left(layout) or is_marked(layout):
        return None
    return run_task(layout.project, environ, SETTLE, _settled)


def _settled(context: Context) -> RepairOutcome:
    found = promotion.put_back(context, smoke=False)
    if has_errors(found):
        return RepairOutcome.of_diagnostics(found)
    text = "what a killed repair had left in service is settled: the accepted server is served"
    return RepairOutcome.done("settle.served", text)


def _done(
    context: Context, duty: Callable[[Context, Mapping[str, Any]], RepairOutcome], brief: Mapping[str, Any]
) -> RepairOutcome:
    found = ready(context)
    return RepairOutcome.of_diagnostics(found) if has_errors(found) else duty(context, brief)


def _restored(layout: Layout, _: Mapping[str, str], _left: Left) -> RepairOutcome:
    return restore(layout)


def _restarted(layout: Layout, _: Mapping[str, str], _left: Left) -> RepairOutcome:
    if is_marked(layout):
        return RepairOutcome.refused("heal.stopped", "a person has stopped the endpoint; it stays so")
    problem = start_stop.obstacle(layout)
    if problem is not None:
        return RepairOutcome.of_diagnostics([problem])
    start_stop.stop(layout)
    process, problem = start_stop.start(layout)
    if process is None:
        return RepairOutcome.of_diagnostics([problem] if problem is not None else [], verdict=RepairVerdict.FAILED)
    return RepairOutcome.done("heal.restart", "the endpoint was started again")


def _redeployed(layout: Layout, environ: Mapping[str, str], _left: Left) -> RepairOutcome:
    return redeploy(layout, environ)


def _rediscovered(layout: Layout, environ: Mapping[str, str], left: Left) -> RepairOutcome:
    manifest, _ = load(layout.project / FILE_NAME, environ)
    return rediscover(layout, environ, apply=manifest.daemon.apply if manifest is not None else ASK, left=left)


ACTIONS: Mapping[str, Callable[[Layout, Mapping[str, str], Left], RepairOutcome]] = {
    "restore": _restored,
    "redeploy": _redeployed,
    "restart": _restarted,
    "rediscover": _rediscovered,
}
