"""Re-discovery: kinds of hardware came or went, so PROBE and what depends on it run again, with nobody there. (Heavy.)

Unattended, so it does less than a person's apply and leaves no doubt behind:

* It carries out only what the hardware asks for. Whatever else the plan holds (an edit of the manifest, a spec, a
  profile or an artifact that nobody has applied yet) is a person's, and then nothing is done but to ask.
* A privileged step that has tried a device moves it again when the server is another one. That a step is listed
  allows its first proof, also with nobody there: of a device that came. It does not allow a movement because a camera
  came, nor another try of one that failed. So it asks.
* It is begun only where the hour's agent runs and dollars are enough for all of it
  (`octoform.engine.unattended.cost_estimate`).
* It is all or nothing. When a stage fails, everything is as it was before, and the former endpoint serves.

What is asked lies in ``daemon/asks.json``, once for each change.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from octoform.diagnostics import Diagnostic, has_errors
from octoform.endpoint.process.desired_state import is_marked
from octoform.engine.apply import approval
from octoform.engine.apply.apply import Options, apply
from octoform.engine.apply.rollback import Former, forget, go_back, keep, remember, taken_back
from octoform.engine.plan.plan import Outlook, Request, prepare
from octoform.engine.results import RunResult
from octoform.engine.unattended.cost_estimate import Left, shortages
from octoform.engine.unattended.null_view import Unwatched
from octoform.graph.model import STEP, key_parts
from octoform.host.fingerprint import root_from_environment, settle
from octoform.plan.model import Cause, PlannedAction
from octoform.protocol.model import FRAME
from octoform.state.layout import Layout

AUTO = "auto"
LOCK_SECONDS = 60.0
HARDWARE = "hardware"
NO_CAP = Left()
_OURS = frozenset({Cause.UPSTREAM, Cause.ENDPOINT, Cause.FAILED, Cause.INTERRUPTED, Cause.INSTANCES_GONE})
"""Reasons that no person's edit stands behind."""
_BEFORE = ("compile", "lock", "state", "plan", "approval")
"""Where a run stops before it has changed anything."""


def rediscover(layout: Layout, environ: Mapping[str, str], *, apply: str, left: Left = NO_CAP) -> dict[str, Any]:
    """Onboard what changed, or ask; ``apply`` is the manifest's ``daemon.apply``, ``left`` what agents may cost.

    ``{ok, detail, again, spent, asked}``: ``asked`` is True where a question lies in ``daemon/asks.json`` now that was
    not there before.
    """
    if is_marked(layout):
        return _told(False, "a person has stopped the endpoint; what changed waits for octoform apply", again=False)
    settle(root_from_environment(environ))
    request = Request(layout.project, environ)
    if apply == AUTO:
        return _carried_out(layout, request, left)
    outlook, found = prepare(request)
    if outlook is None:
        return _told(False, f"there is no plan: {_words(found)}", again=False)
    mine = _Consent(layout, apply, left)
    mine(outlook)
    return mine.answer or _told(True, "the hardware is what PROBE saw")


class _Consent:
    """Decides over a plan in a person's place; ``answer`` is what is told where it is not carried out."""

    def __init__(self, layout: Layout, apply: str, left: Left) -> None:
        self._layout = layout
        self._left = left
        self._apply = apply
        self.answer: dict[str, Any] | None = None
        self.former: Former | None = None
        self.free = True
        """No agent of the plan uses a model, so that it costs nothing."""

    def __call__(self, outlook: Outlook) -> bool:
        """True when it may be done; what the host has before it is remembered then."""
        self.free = not any(item.calls_model for item in outlook.plan.work)
        if outlook.compiled.layout.host != self._layout.host:
            self.answer = _told(False, f"the manifest is of host {outlook.compiled.layout.host} now", again=False)
        elif not any(item.node == "probe" for item in outlook.plan.work):
            approval.withdraw(self._layout)
            self.answer = _told(True, "the hardware is what PROBE saw")
        elif why := (*_asking(self._apply), *objections(outlook), *shortages(outlook, self._left)):
            self.answer = _asked(self._layout, outlook, why)
        else:
            self.former = remember(self._layout, outlook.snapshot)
            problem = keep(self.former) if self.former is not None else None
            if problem is not None:
                self.answer = _told(False, f"what there is cannot be kept, so nothing is begun: {problem.summary}")
        return self.answer is None


def _asking(apply: str) -> tuple[str, ...]:
    return () if apply == AUTO else ("the manifest says daemon: {apply: ask}",)


def objections(outlook: Outlook) -> tuple[str, ...]:
    """Why this plan is not carried out with nobody there; empty when it may be."""
    found = [f"{item.node}: {text}" for item in outlook.plan.work for text in _others(outlook, item)]
    kinds = {step.node: step.kind for step in outlook.plan.steps}
    for item in outlook.plan.work:
        known = outlook.snapshot.nodes.get(item.node)
        if not item.node.startswith(STEP) or known is None or kinds.get(item.node) == FRAME:
            continue
        if "skipped" not in known.detail:
            found.append(f"{item.node} would be tried again, and that moves hardware")
    return tuple(found)


def _others(outlook: Outlook, item: PlannedAction) -> Iterator[str]:
    """What a node would be run for beside the hardware."""
    for reason in item.reasons:
        if reason.cause is Cause.CHANGED and reason.part == HARDWARE:
            continue
        if reason.cause not in _OURS:
            yield f"{reason.cause.value} {reason.part or reason.text or ''}".strip()
    known = outlook.snapshot.nodes.get(item.node)
    if known is None or item.node not in outlook.compiled.graph.names():
        return
    # A node whose last run failed is planned for that alone; what else has moved in its key is looked at here.
    node = outlook.compiled.graph.node(item.node)
    now = key_parts(node, dict.fromkeys(node.consumes, ""), None)
    ignored = frozenset(outlook.compiled.manifest.lifecycle.ignore)
    told = {reason.part for reason in item.reasons}
    for part in sorted({*now, *known.key_parts}):
        if part == HARDWARE or part.startswith("input.") or part in ignored or part in told:
            continue
        if now.get(part) != known.key_parts.get(part):
            yield f"changed {part}"


def _carried_out(layout: Layout, request: Request, left: Left) -> dict[str, Any]:
    mine = _Consent(layout, AUTO, left)
    with taken_back(lambda: mine.former):
        result = apply(request, Options(consent=mine, lock_seconds=LOCK_SECONDS), Unwatched())
    if mine.answer is not None:
        return mine.answer
    spent = _spent(result, free=mine.free)
    if result.failed is None and mine.former is None and not result.agent_runs:
        return _told(True, "the hardware is what PROBE saw")
    if result.failed is None:
        forget(layout)
        tools = len(result.endpoint.tools) if result.endpoint is not None else 0
        return {
            **_told(True, f"{result.changed + result.alike + result.added} nodes were made again, {tools} tools now"),
            **spent,
        }
    why = f"{result.failed} failed: {_words(result.diagnostics)}"
    if mine.former is None and result.failed in _BEFORE:
        return {**_told(False, why), **spent}
    return {**_undone(mine.former, why), **spent}


def _undone(former: Former | None, why: str) -> dict[str, Any]:
    if former is None:
        return _told(False, f"{why}; before it the host was not whole, so octoform apply goes on from here")
    problems = go_back(former)
    if has_errors(problems):
        return _told(False, f"{why}; it could not be taken back: {_words(problems)}", again=False)
    return _told(False, f"{why}; everything is as it was before, and the former endpoint serves")


def _asked(layout: Layout, outlook: Outlook, why: tuple[str, ...]) -> dict[str, Any]:
    plan = outlook.plan
    hardware = sorted(f"{change.action.value} {change.name}" for change in plan.changes if change.kind == HARDWARE)
    question = approval.Question(tuple(hardware), tuple(item.node for item in plan.work), why)
    fresh, problem = approval.ask(layout, question)
    if problem is not None:
        return _told(False, f"{question.text}; the question could not be kept: {problem.summary}")
    return {**_told(False, question.text, again=False), "asked": fresh}


def _spent(result: RunResult, *, free: bool) -> dict[str, Any]:
    used = result.usage
    usd = 0.0 if free and used.cost_usd is None else used.cost_usd
    tokens = {"input_tokens": used.input_tokens or 0, "output_tokens": used.output_tokens or 0}
    return {"spent": {"calls": result.agent_runs, **tokens, "usd": usd}}


def _told(ok: bool, detail: str, *, again: bool = True) -> dict[str, Any]:
    return {"ok": ok, "detail": detail, "again": again, "asked": False}


def _words(found: "tuple[Diagnostic, ...] | list[Diagnostic]") -> str:
    first = next((item for item in found if item.severity == "error"), found[0] if found else None)
    return "no reason was given" if first is None else f"{first.code}: {first.summary}"
