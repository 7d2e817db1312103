"""DEPLOY again with nobody there: the set of packages is decided anew, and nothing else is done. (Heavy.)

HEAL asks for it where the locked set itself is at fault. It is all or nothing: when the new set fails its trial,
everything is as it was, and the former endpoint serves. A plan that holds more than that (an edit that nobody has
applied, hardware that changed, a step that would move something) is a person's.
"""

from collections.abc import Mapping

from octoform.apply.duties.outcome import Answer
from octoform.diagnostics import Severity, has_errors
from octoform.endpoint.process.desired_state import is_marked
from octoform.engine.apply.apply import Options, apply
from octoform.engine.apply.rollback import Former, forget, go_back, keep, remember, taken_back
from octoform.engine.plan.plan import Outlook, Request
from octoform.engine.results import RunResult
from octoform.engine.unattended.null_view import Unwatched
from octoform.harness.port import Usage
from octoform.protocol.model import FRAME
from octoform.state.layout import Layout

MADE = ("deploy", "endpoint")
LOCK_SECONDS = 60.0


def redeploy(layout: Layout, environ: Mapping[str, str]) -> Answer:
    """Have the packages of the endpoint decided anew, and serve from them where their trial holds."""
    if is_marked(layout):
        return Answer(ok=False, detail="a person has stopped the endpoint; it stays so")
    mine = _Consent(layout)
    request = Request(layout.project, environ, replace=("deploy",), reuse=False)
    with taken_back(lambda: mine.former):
        result = apply(request, Options(consent=mine, lock_seconds=LOCK_SECONDS), Unwatched())
    if mine.why:
        return Answer(ok=False, detail=f"the packages are not decided anew: {mine.why}", again=False)
    usage = Usage(result.usage.input_tokens, None, result.usage.output_tokens, result.usage.cost_usd)
    if result.failed is None:
        forget(layout)
        detail = "the packages of the endpoint were decided anew, and it serves from them"
        return Answer(ok=True, detail=detail, changed=True, calls=result.agent_runs, usage=usage)
    return Answer(ok=False, detail=_undone(mine.former, result), calls=result.agent_runs, usage=usage)


class _Consent:
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


def _undone(former: Former | None, result: RunResult) -> str:
    said = "; ".join(item.summary for item in result.diagnostics if item.severity is Severity.ERROR)
    why = f"{result.failed} failed: {said}"
    if former is None:
        return why
    problems = go_back(former)
    if has_errors(problems):
        return f"{why}; it could not be taken back: {problems[0].summary}"
    return f"{why}; everything is as it was before, and the former endpoint serves"
