"""diff(desired, prior, observed) -> actions with reasons. Pure: no file, no clock, no process.

The observed side is given as plain values so that the same function serves the command line, the tests and, later,
a daemon.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from octoform.graph.model import ANSWER, STEP, Graph, Node, NodeKind, key_parts
from octoform.plan.model import Action, Cause, PlannedAction, Reason


@dataclass(frozen=True, slots=True)
class Prior:
    """What the state says of one node."""

    status: str
    key_parts: Mapping[str, str]
    output_digest: str
    file_digest: str
    tainted: bool = False
    last: Mapping[str, object] = field(default_factory=dict)
    accepted_at: str = ""


@dataclass(frozen=True, slots=True)
class Observed:
    """What is there: artifact digests by stage (None: missing), links, contract complaints, endpoint complaints.

    ``contract`` holds, by stage, why an accepted artifact no longer passes (empty when it does or was not asked);
    ``endpoint`` holds plain sentences about the live side; ``hardware`` explains a moved fingerprint.
    ``instances_gone``: this machine has lost, or never had, what PROBE knew of its own specimens.
    """

    fingerprint: str | None
    files: Mapping[str, str | None]
    links: frozenset[str] = frozenset()
    contract: Mapping[str, str] = field(default_factory=dict)
    endpoint: tuple[str, ...] = ()
    hardware: tuple[str, ...] = ()
    instances_gone: bool = False


@dataclass(frozen=True, slots=True)
class Wishes:
    """What the person asked for: nodes to replace, nodes to keep to (None: all), key parts to overlook."""

    replace: frozenset[str] = frozenset()
    targets: frozenset[str] | None = None
    ignore: frozenset[str] = frozenset()


def diff(graph: Graph, prior: Mapping[str, Prior], observed: Observed, wishes: Wishes) -> tuple[PlannedAction, ...]:
    """The action of every node, in order; a node outside the targets is a no-op.

    What the state has and the graph no longer does comes first, and goes; a run that keeps to some nodes leaves it.
    """
    moving: set[str] = set()
    actions = [] if wishes.targets is not None else _gone(graph, prior)
    for node in graph.nodes:
        if wishes.targets is not None and node.name not in wishes.targets:
            action = _action(node, Action.NOOP, (), prior.get(node.name), certain=True)
        else:
            action = _plan_node(node, prior, observed, wishes, moving)
        if action.action is not Action.NOOP:
            moving.add(node.name)
        actions.append(action)
    return tuple(actions)


def _gone(graph: Graph, prior: Mapping[str, Prior]) -> list[PlannedAction]:
    """Steps that are no longer wanted. Other nodes that are unknown here belong to another version and are left."""
    names = [name for name in prior if name.startswith(STEP) and name not in graph.names()]
    reason = Reason(Cause.REMOVED)
    return [PlannedAction(name, Action.DESTROY, certain=True, reasons=(reason,)) for name in reversed(names)]


def _plan_node(
    node: Node, prior: Mapping[str, Prior], observed: Observed, wishes: Wishes, moving: set[str]
) -> PlannedAction:
    known = prior.get(node.name)
    if known is None:
        return _action(node, Action.CREATE, (Reason(Cause.NEW),), None, certain=True)
    broken = _broken(node, known, observed, wishes)
    upstream = [name for name in node.consumes if name in moving]
    outputs = {name: _output(prior, name) for name in node.consumes}
    reasons = broken
    if known.status == "accepted":
        changed = _changed(node, known, outputs, observed, wishes, frozenset(upstream))
        spoken = any((reason.part or "").startswith(ANSWER) for reason in changed)
        # What a new answer breaks is told by the answer.
        reasons = [item for item in broken if not (spoken and item.cause is Cause.CONTRACT)] + changed
    if reasons:
        return _action(node, _word(reasons, known), tuple(reasons), known, certain=True)
    if upstream:
        waits = tuple(Reason(Cause.UPSTREAM, part=f"input.{name}") for name in upstream)
        return _action(node, Action.UPDATE, waits, known, certain=False)
    return _action(node, Action.NOOP, (), known, certain=True)


def _output(prior: Mapping[str, Prior], name: str) -> str:
    return prior[name].output_digest if name in prior else ""


def _broken(node: Node, known: Prior, observed: Observed, wishes: Wishes) -> list[Reason]:
    """Reasons that need no key: the state, the artifact or the live side is not as it was left."""
    reasons = []
    if node.name in wishes.replace:
        reasons.append(Reason(Cause.REQUESTED))
    if known.tainted:
        reasons.append(Reason(Cause.TAINTED))
    if known.status != "accepted":
        reasons.append(Reason(Cause.INTERRUPTED if known.status == "interrupted" else Cause.FAILED))
        return reasons
    if node.kind is NodeKind.ENDPOINT:
        return reasons + [Reason(Cause.ENDPOINT, text=text) for text in observed.endpoint]
    if node.observes_host and observed.instances_gone:
        reasons.append(Reason(Cause.INSTANCES_GONE))
    found = observed.files.get(node.name)
    if node.name in observed.links:
        reasons.append(Reason(Cause.ARTIFACT_LINK))
    elif found is None:
        reasons.append(Reason(Cause.ARTIFACT_DELETED, before=known.file_digest))
    elif found != known.file_digest:
        reasons.append(Reason(Cause.ARTIFACT_EDITED, before=known.file_digest, after=found))
    elif observed.contract.get(node.name):
        reasons.append(Reason(Cause.CONTRACT, text=observed.contract[node.name]))
    return reasons


def _changed(
    node: Node,
    known: Prior,
    outputs: Mapping[str, str],
    observed: Observed,
    wishes: Wishes,
    unknown_inputs: frozenset[str],
) -> list[Reason]:
    """One reason for each key part that differs; inputs that are only known after apply are left out."""
    now = key_parts(node, outputs, observed.fingerprint)
    reasons = []
    for part in sorted(set(now) | set(known.key_parts)):
        if is_ignored(part, wishes.ignore) or part.removeprefix("input.") in unknown_inputs:
            continue
        before, after = known.key_parts.get(part), now.get(part)
        if before != after:
            text = "; ".join(observed.hardware) if part == "hardware" and observed.hardware else None
            reasons.append(Reason(Cause.CHANGED, part=part, before=before, after=after, text=text))
    return reasons


def is_ignored(part: str, ignore: frozenset[str]) -> bool:
    """True for a key part that may change without making anything again; a second agent's go with the first's."""
    return part.removeprefix("escalate.") in ignore


def _word(reasons: list[Reason], known: Prior) -> Action:
    """A node is created when there is no artifact of it, whether there never was one or it went."""
    causes = {reason.cause for reason in reasons}
    if causes & {Cause.REQUESTED, Cause.TAINTED, Cause.ARTIFACT_LINK}:
        return Action.REPLACE
    if Cause.ARTIFACT_DELETED in causes or not known.output_digest:
        return Action.CREATE
    return Action.UPDATE


def _action(
    node: Node, action: Action, reasons: tuple[Reason, ...], known: Prior | None, *, certain: bool
) -> PlannedAction:
    runs_agent = node.kind is not NodeKind.ENDPOINT and action is not Action.NOOP
    return PlannedAction(
        node=node.name,
        action=action,
        certain=certain,
        reasons=reasons,
        harness=node.harness,
        model=node.model,
        calls_agent=runs_agent,
        calls_model=runs_agent and node.calls_model,
        escalate=node.escalate if runs_agent else None,
        last=known.last if known is not None else {},
    )
