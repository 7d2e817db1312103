"""Re-discovery: kinds of hardware came or went, so PROBE and what depends on it run again, with no one there. (Heavy.)

Unattended, so it does less than a person's apply and leaves no doubt behind:

* It carries out only what the hardware asks for. Whatever else the plan holds (an edit of the manifest, a spec, a
  profile or an artifact that no one has applied yet) is a person's, and then nothing is done but to ask.
* A privileged step that has tried a device moves it again when the server is another one. That a step is listed
  allows its first proof, also with no one there: of a device that came. It does not allow a movement because a camera
  came, nor another try of one that failed. So it asks.
* It is begun only where the hour's agent runs and dollars are enough for all of it
  (`octoform.engine.unattended.rediscover`).
* It is all or nothing. When a stage fails, everything is as it was before, and the former endpoint serves.

What is asked lies in ``daemon/asks.json``, once for each change.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from octoform.apply.repair_outcome import Cost, RepairOutcome, RepairVerdict
from octoform.apply.rewrite.promotion import MAKER
from octoform.diagnostics import Diagnostic, Severity, has_errors
from octoform.endpoint.process.record import is_marked
from octoform.engine.apply import approval
from octoform.engine.apply.apply import Options, apply
from octoform.engine.apply.rollback import Former, forget, go_back, keep, remember, taken_back
from octoform.engine.plan.plan import Outlook, Request, prepare
from octoform.engine.results import RunResult, Unwatched
from octoform.graph.model import HARDWARE, STEP, input_of, key_parts, moved_parts
from octoform.host import root_from_environment, settle
from octoform.manifest.model import MODEL_FREE, Manifest
from octoform.plan.model import Cause, PlannedAction
from octoform.protocol.model import FRAME
from octoform.records import dataclass, replace
from octoform.state.layout import Layout

# What an unattended run may cost at most, against what the hour has left for agents. (Heavy.)
#
# The daemon's caps hold for everything that it starts, and a run of several stages would be stopped in its middle. So
# all of it is reckoned before it begins: every attempt that each agent has, SERVE's second round where a test sends it
# back.


@dataclass(frozen=True, slots=True)
class Left:
    """The agents' remaining budget of this hour: runs as a count, US dollars; None: no one counts."""

    calls: int | None = None
    usd: float | None = None

    @classmethod
    def of(cls, brief: Mapping[str, Any], calls: int = 0, usd: float | None = 0.0) -> "Left":
        """As the daemon reports it, less what was spent since; of an unknown price nothing is left."""
        found, money = brief.get("calls"), brief.get("usd")
        rest = None if not isinstance(money, int | float) else 0.0 if usd is None else max(0.0, money - usd)
        return cls(max(0, found - calls) if isinstance(found, int) else None, rest)


def shortages(outlook: Outlook, left: Left) -> tuple[str, ...]:
    """Why this plan is not begun with what is left, each with the cap that is in the way; empty when it may be."""
    manifest = outlook.compiled.manifest
    asked = [item for item in outlook.plan.work if item.calls_agent]
    found = []
    most = sum(_runs(manifest, item) for item in asked)
    if left.calls is not None and most > left.calls:
        words = f"it may take {most} agent runs and the hour has {left.calls} left"
        found.append(f"{words} (daemon.calls_per_hour)")
    dear = [item for item in asked if item.calls_model]
    if left.usd is not None and dear:
        bound = _dollars(manifest, dear)
        if bound is None or bound > left.usd:
            words = (
                "what it costs has no bound (budget.usd)" if bound is None else f"it may cost {bound:.2f} US dollars"
            )
            found.append(f"{words} and the hour has {left.usd:.2f} left (daemon.usd_per_hour)")
    return tuple(found)


def _runs(manifest: Manifest, item: PlannedAction) -> int:
    settings = manifest.settings_of(item.node)
    attempts = settings.budget.attempts
    runs = 1 if settings.harness.name in MODEL_FREE else attempts
    runs += attempts if settings.escalate is not None else 0
    return 2 * runs if item.node == MAKER else runs


def _dollars(manifest: Manifest, dear: list[PlannedAction]) -> float | None:
    """The maximum cost of these together; None without a bound."""
    each = [manifest.budget_for(item.node).usd for item in dear]
    known = [usd for usd in each if usd is not None]
    bounds = [sum(known)] if len(known) == len(each) else []
    bounds += [manifest.run_usd] if manifest.run_usd is not None else []
    return min(bounds, default=None)


AUTO = "auto"
LOCK_SECONDS = 60.0
NO_CAP = Left()
_AS_SEEN = RepairOutcome.done("rediscover.as-seen", "the hardware is what PROBE saw")
_OURS = frozenset({Cause.UPSTREAM, Cause.ENDPOINT, Cause.FAILED, Cause.INTERRUPTED, Cause.INSTANCES_GONE})
"""Reasons that no person's edit is behind."""
_BEFORE = ("compile", "lock", "state", "plan", "approval")
"""Where a run stops before it has changed anything."""


def rediscover(layout: Layout, environ: Mapping[str, str], *, apply: str, left: Left = NO_CAP) -> RepairOutcome:
    """Onboard what changed, or ask; ``apply`` is the manifest's ``daemon.apply``, ``left`` what agents may cost.

    The outcome has ``asked`` where a question lies in ``daemon/asks.json`` now that was not there before.
    """
    if is_marked(layout):
        text = "a person has stopped the endpoint; what changed waits for octoform apply"
        return RepairOutcome.refused("rediscover.stopped", text, again=False)
    settle(root_from_environment(environ))
    request = Request(layout.project, environ)
    if apply == AUTO:
        return _carried_out(layout, request, left)
    outlook, found = prepare(request)
    if outlook is None:
        return RepairOutcome.refused("rediscover.no-plan", f"there is no plan: {_words(found)}", again=False)
    mine = _Consent(layout, apply, left)
    mine(outlook)
    return mine.answer or _AS_SEEN


class _Consent:
    """Decides over a plan in a person's place; ``answer`` is what is reported where it is not carried out."""

    def __init__(self, layout: Layout, apply: str, left: Left) -> None:
        self._layout = layout
        self._left = left
        self._apply = apply
        self.answer: RepairOutcome | None = None
        self.former: Former | None = None
        self.free = True
        """No agent of the plan uses a model, so that it costs nothing."""

    def __call__(self, outlook: Outlook) -> bool:
        """True when it may be done; what the host has before it is remembered then."""
        self.free = not any(item.calls_model for item in outlook.plan.work)
        if outlook.compiled.layout.host != self._layout.host:
            text = f"the manifest is of host {outlook.compiled.layout.host} now"
            self.answer = RepairOutcome.refused("rediscover.other-host", text, again=False)
        elif not any(item.node == "probe" for item in outlook.plan.work):
            approval.withdraw(self._layout)
            self.answer = _AS_SEEN
        elif why := (*_asking(self._apply), *objections(outlook), *shortages(outlook, self._left)):
            self.answer = _asked(self._layout, outlook, why)
        else:
            self.former = remember(self._layout, outlook.snapshot)
            problem = keep(self.former) if self.former is not None else None
            if problem is not None:
                text = f"what there is cannot be kept, so nothing is begun: {problem.summary}"
                self.answer = RepairOutcome.refused("rediscover.not-kept", text)
        return self.answer is None


def _asking(apply: str) -> tuple[str, ...]:
    return () if apply == AUTO else ("the manifest sets daemon: {apply: ask}",)


def objections(outlook: Outlook) -> tuple[str, ...]:
    """Why this plan is not carried out with no one there; empty when it may be."""
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
    """The reasons beside the hardware for which a node would run."""
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
    names = {reason.part for reason in item.reasons}
    for part in moved_parts(known.key_parts, now):
        if part != HARDWARE and not input_of(part) and part not in ignored and part not in names:
            yield f"changed {part}"


def _carried_out(layout: Layout, request: Request, left: Left) -> RepairOutcome:
    mine = _Consent(layout, AUTO, left)
    with taken_back(lambda: mine.former):
        result = apply(request, Options(consent=mine, lock_seconds=LOCK_SECONDS), Unwatched())
    if mine.answer is not None:
        return mine.answer
    cost = _cost(result, free=mine.free)
    if result.failed is None and mine.former is None and not result.agent_runs:
        return _AS_SEEN
    if result.failed is None:
        forget(layout)
        tools = len(result.endpoint.tools) if result.endpoint is not None else 0
        text = f"{result.changed + result.alike + result.added} nodes were made again, {tools} tools now"
        return RepairOutcome.done("rediscover.onboarded", text, changed=True, cost=cost)
    why = f"{result.failed} failed: {_words(result.diagnostics)}"
    if mine.former is None and result.failed in _BEFORE:
        return RepairOutcome.refused("rediscover.not-begun", why, cost=cost)
    return _undone(mine.former, RepairOutcome.failed("rediscover.stage", why, cost=cost))


def _undone(former: Former | None, failed: RepairOutcome) -> RepairOutcome:
    """A run that failed, once everything is as it was before it, or why it is not."""
    if former is None:
        return failed.because(
            "rediscover.left", "before it the host was not whole, so octoform apply goes on from here"
        )
    problems = go_back(former)
    if has_errors(problems):
        return failed.because("rediscover.left", f"it could not be taken back: {_words(problems)}", again=False)
    text = "everything is as it was before, and the former endpoint serves"
    return failed.because("rediscover.taken-back", text, verdict=RepairVerdict.ROLLED_BACK)


def _asked(layout: Layout, outlook: Outlook, why: tuple[str, ...]) -> RepairOutcome:
    plan = outlook.plan
    hardware = sorted(f"{change.action.value} {change.name}" for change in plan.changes if change.kind == HARDWARE)
    question = approval.Question(tuple(hardware), tuple(item.node for item in plan.work), why)
    fresh, problem = approval.ask(layout, question)
    if problem is not None:
        text = f"{question.text}; the question could not be kept: {problem.summary}"
        return RepairOutcome.refused("rediscover.not-asked", text)
    return RepairOutcome.refused("rediscover.asks", question.text, again=False, asked=fresh)


def _cost(result: RunResult, *, free: bool) -> Cost:
    used = result.usage
    usd = 0.0 if free and used.cost_usd is None else used.cost_usd
    return Cost(result.agent_runs, used.input_tokens or 0, used.output_tokens or 0, usd)


def _words(found: "tuple[Diagnostic, ...] | list[Diagnostic]") -> str:
    first = next((item for item in found if item.severity == "error"), found[0] if found else None)
    return "no reason was given" if first is None else f"{first.code}: {first.summary}"


# DEPLOY again, unattended: the set of packages is resolved again, and nothing else is done. (Heavy.)
#
# HEAL asks for it where the locked set itself is at fault. It is all or nothing: when the new set fails its test,
# everything is as it was, and the former endpoint serves. A plan that holds more than that (an edit that no one has
# applied, hardware that changed, a step that would move something) is a person's.

MADE = ("deploy", "endpoint")


def redeploy(layout: Layout, environ: Mapping[str, str]) -> RepairOutcome:
    """Have the packages of the endpoint decided again, and serve from them where their test holds."""
    if is_marked(layout):
        return RepairOutcome.refused("redeploy.stopped", "a person has stopped the endpoint; it stays so")
    mine = _RedeployConsent(layout)
    request = Request(layout.project, environ, replace=("deploy",), reuse=False)
    with taken_back(lambda: mine.former):
        result = apply(request, Options(consent=mine, lock_seconds=LOCK_SECONDS), Unwatched())
    if mine.why:
        text = f"the packages are not decided again: {mine.why}"
        return RepairOutcome.refused("redeploy.not-alone", text, again=False)
    cost = _cost(result, free=not result.agent_runs)
    if result.failed is None:
        forget(layout)
        text = "the packages of the endpoint were decided again, and it serves from them"
        return RepairOutcome.done("redeploy.served", text, changed=True, cost=cost)
    text = "; ".join(item.summary for item in result.diagnostics if item.severity is Severity.ERROR)
    failed = RepairOutcome.failed("redeploy.stage", f"{result.failed} failed: {text}", cost=cost)
    return failed if mine.former is None else replace(_undone(mine.former, failed), again=True)


class _RedeployConsent:
    """Decides over the plan in a person's place; ``why`` is why it is not carried out."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self.why = ""
        self.former: Former | None = None

    def __call__(self, outlook: Outlook) -> bool:
        """True when it holds nothing but DEPLOY and what rests on it; what there is before is remembered then."""
        frames = {step.node for step in outlook.plan.steps if step.kind == FRAME or step.skipped}
        more = [item.node for item in outlook.plan.work if item.node not in {*MADE, *frames}]
        if outlook.compiled.layout.host != self._layout.host:
            self.why = "the manifest is of another host now"
        elif more:
            self.why = f"octoform apply would make {', '.join(more)} too, which is for a person to begin"
        else:
            self.former = remember(self._layout, outlook.snapshot)
            problem = keep(self.former) if self.former is not None else None
            self.why = problem.summary if problem is not None else ""
            self.why = self.why if self.former is not None else "the host is not as it was applied"
        return not self.why
