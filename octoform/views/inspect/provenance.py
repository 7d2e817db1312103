"""How a node's output came about: whose agent made it, for whom, with what help, at what cost.

What the state says of that may have come with a pull, so nothing of it is taken for granted: every word is escaped and
cut, and what has another shape than octoform writes is left out.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from octoform.state.model import NodeState
from octoform.views.format.values import one_line, used
from octoform.views.plan import text as plan_text

WIDTH = 160
MOST = 48
TOLD = frozenset({"reused", "escalated", "spec_edit"})
"""What of a node's detail is told here."""


def told(name: str, state: NodeState) -> Iterator[tuple[str, str]]:
    """(label, text) of each line, fit to be shown."""
    reused = _table(state, "reused")
    if state.harness and not state.detail.get("skipped"):
        yield "made by", f"{_cut(plan_text.agent(state.harness, state.model), WIDTH)}, {_tries(state, reused)}"
    if reused:
        yield "reused", _reused(reused)
    escalated = _table(state, "escalated")
    if escalated:
        yield "escalated", _escalated(escalated)
    if _table(state, "spec_edit"):
        yield "spec", f"made with a spec that an agent corrected; octoform spec diff {_cut(name)}"
    usage = state.usage
    cost = used(usage.input_tokens, usage.cached_tokens, usage.output_tokens, usage.cost_usd, usage.cost_source or "")
    if cost:
        yield "used", _cut(cost, WIDTH)


def _tries(state: NodeState, reused: Mapping[str, Any]) -> str:
    if reused:
        return f"for another host; verified here in {state.seconds:.1f} s"
    return f"{plan_text.counted(state.attempts, 'attempt')}, {state.seconds:.1f} s"


def _reused(reused: Mapping[str, Any]) -> str:
    """``from host a of project ../b (its state's serial 3), where it was accepted at ...; made for host c``."""
    project, host = reused.get("project"), _cut(reused.get("host"))
    of = "this project" if project == "." else f"project {_cut(project)}"
    accepted = reused.get("accepted_at")
    when = f", accepted there at {_cut(accepted)}" if accepted else ""
    return f"from host {host} of {of} (serial {_cut(reused.get('serial'))}){when}; made for host {_made_for(reused)}"


def _made_for(reused: Mapping[str, Any]) -> str:
    return _cut(reused.get("made_for", reused.get("host")))


def _escalated(escalated: Mapping[str, Any]) -> str:
    model = escalated.get("model")
    who = plan_text.agent(_cut(escalated.get("harness")), _cut(model) if model else None)
    asked, left = escalated.get("asked"), escalated.get("still_unknown")
    return f"{who} was asked about {_cut(asked)} unknown; {_cut(left)} still unknown"


def _table(state: NodeState, key: str) -> Mapping[str, Any]:
    value = state.detail.get(key)
    return value if isinstance(value, dict) else {}


def _cut(value: object, width: int = MOST) -> str:
    return one_line(str(value), width) if isinstance(value, str | int | float) else "?"
