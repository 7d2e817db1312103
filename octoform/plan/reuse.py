"""Which of the planned stages can be taken from another host instead of running their agents. Pure.

A stage whose inputs are known has a known key, and with the output that is lent for it the key of the next stage is
known as well. Behind a stage that really runs, nothing is known before it has run.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from octoform.graph.model import Graph, Node, NodeKind, key_of, key_parts
from octoform.plan.diff import Prior
from octoform.plan.model import Cause, Loan, PlannedAction

WANTED_ANEW = frozenset({Cause.REQUESTED, Cause.TAINTED})


@dataclass(frozen=True, slots=True)
class Offer:
    """An output that another host has: whose it is, the parts of its key, its digest."""

    host: str
    parts: Mapping[str, str]
    output_digest: str


Offers = Mapping[str, tuple[Offer, ...]]
"""Stage to what is offered for it."""


def with_loans(
    graph: Graph, actions: tuple[PlannedAction, ...], prior: Mapping[str, Prior], offers: Offers
) -> tuple[PlannedAction, ...]:
    """The actions, with a loan on each that another host's output can (or may, once its inputs are known) stand for."""
    outputs: dict[str, str | None] = {name: known.output_digest for name, known in prior.items()}
    out = []
    for action in actions:
        if action.calls_agent:
            node = graph.node(action.node)
            outputs[node.name] = None
            loan = _loan(node, action, outputs, offers.get(node.name, ()))
            if loan is not None:
                action = replace(action, loan=loan, calls_agent=not loan.certain, calls_model=_may_call(action, loan))
                outputs[node.name] = loan.output_digest if loan.certain else None
        out.append(action)
    return tuple(out)


def _may_call(action: PlannedAction, loan: Loan) -> bool:
    return action.calls_model and not loan.certain


def _loan(
    node: Node, action: PlannedAction, outputs: Mapping[str, str | None], offers: tuple[Offer, ...]
) -> Loan | None:
    if node.kind is not NodeKind.STAGE or any(reason.cause in WANTED_ANEW for reason in action.reasons):
        return None
    inputs = {name: outputs.get(name) or "" for name in node.consumes}
    known = all(inputs.values())
    parts = key_parts(node, inputs, None)
    for offer in offers:
        if known and key_of(parts) == key_of(offer.parts):
            return Loan(offer.host, offer.output_digest, certain=action.certain)
        if not known and _without_inputs(parts) == _without_inputs(offer.parts):
            return Loan(offer.host, offer.output_digest, certain=False)
    return None


def _without_inputs(parts: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in parts.items() if not name.startswith("input.")}
