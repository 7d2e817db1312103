"""diff(desired, prior, observed) -> actions with reasons. Pure: no file, no clock, no process.

The observed side is given as plain values so that the same function serves the command line, the tests and, later,
a daemon.
"""

from collections.abc import Iterable, Mapping

from octoform.graph.model import ANSWER, HARDWARE, INPUT, STEP, Graph, Node, NodeKind, input_of, key_parts, moved_parts
from octoform.plan.model import TOOL, Action, Cause, Change, PlannedAction, Reason, Reuse
from octoform.records import dataclass, field, replace


@dataclass(frozen=True, slots=True)
class Prior:
    """The state's entry for one node."""

    status: str
    key_parts: Mapping[str, str]
    output_digest: str
    file_digest: str
    tainted: bool = False
    last: Mapping[str, object] = field(default_factory=dict)
    accepted_at: str = ""


@dataclass(frozen=True, slots=True)
class Observed:
    """The observed state: artifact digests by stage (None: missing), links, contract complaints, endpoint complaints.

    ``contract`` holds, by stage, why an accepted artifact no longer passes (empty when it does or was not asked);
    ``endpoint`` holds plain sentences about the live side; ``hardware`` explains a moved fingerprint.
    ``instances_gone``: this machine has lost, or never had, what PROBE knew of its own units.
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
    """The person's options: nodes to replace, nodes to keep to (None: all), key parts to overlook."""

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
        # The new answer is the reason for what it breaks.
        reasons = [item for item in broken if not (spoken and item.cause is Cause.CONTRACT)] + changed
    if reasons:
        return _action(node, _word(reasons, known), tuple(reasons), known, certain=True)
    if upstream:
        waits = tuple(Reason(Cause.UPSTREAM, part=f"{INPUT}{name}") for name in upstream)
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
    """One reason for each key part that differs; inputs that are only known after apply are omitted."""
    now = key_parts(node, outputs, observed.fingerprint)
    reasons = []
    for part in moved_parts(known.key_parts, now):
        if is_ignored(part, wishes.ignore) or input_of(part) in unknown_inputs:
            continue
        before, after = known.key_parts.get(part), now.get(part)
        text = "; ".join(observed.hardware) if part == HARDWARE and observed.hardware else None
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


# Which of the planned stages can be taken from another host instead of running their agents. Pure.
#
# A stage whose inputs are known has a known key, and with the output that is reused for it the key of the next stage is
# known as well. Behind a stage that really runs, nothing is known before it has run.

WANTED_ANEW = frozenset({Cause.REQUESTED, Cause.TAINTED})


@dataclass(frozen=True, slots=True)
class Offer:
    """An output that another host has: whose it is, the parts of its key, its digest."""

    host: str
    parts: Mapping[str, str]
    output_digest: str


Offers = Mapping[str, tuple[Offer, ...]]
"""Stage to what is offered for it."""


def with_reuse(
    graph: Graph, actions: tuple[PlannedAction, ...], prior: Mapping[str, Prior], offers: Offers
) -> tuple[PlannedAction, ...]:
    """The actions, with a loan on each that another host's output can (or may, once its inputs are known) stand for."""
    outputs: dict[str, str | None] = {name: known.output_digest for name, known in prior.items()}
    out = []
    for action in actions:
        if action.calls_agent:
            node = graph.node(action.node)
            outputs[node.name] = None
            loan = _reuse(node, action, outputs, offers.get(node.name, ()))
            if loan is not None:
                action = replace(action, loan=loan, calls_agent=not loan.certain, calls_model=_may_call(action, loan))
                outputs[node.name] = loan.output_digest if loan.certain else None
        out.append(action)
    return tuple(out)


def _may_call(action: PlannedAction, reuse: Reuse) -> bool:
    return action.calls_model and not reuse.certain


def _reuse(
    node: Node, action: PlannedAction, outputs: Mapping[str, str | None], offers: tuple[Offer, ...]
) -> Reuse | None:
    if node.kind is not NodeKind.STAGE or any(reason.cause in WANTED_ANEW for reason in action.reasons):
        return None
    inputs = {name: outputs.get(name) or "" for name in node.consumes}
    known = all(inputs.values())
    parts = key_parts(node, inputs, None)
    for offer in offers:
        if known and not moved_parts(offer.parts, parts):
            return Reuse(offer.host, offer.output_digest, certain=action.certain)
        if not known and _without_inputs(parts) == _without_inputs(offer.parts):
            return Reuse(offer.host, offer.output_digest, certain=False)
    return None


def _without_inputs(parts: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in parts.items() if not input_of(name)}


# Which tools come, go or are only called something else, between what the endpoint offers and what INTERFACE has.
#
# What a tool is for are its devices and what it does to them; its name is a word. So a tool that goes while one comes
# for the same devices with the same effect, each of them the only one, was renamed. Pure.


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool as far as it counts here."""

    name: str
    devices: frozenset[str]
    effect: str


def changes(before: Iterable[Tool], after: Iterable[Tool]) -> tuple[Change, ...]:
    """Renamed tools first, then what comes, then what goes; nothing of a tool that keeps its name."""
    old, new = {tool.name: tool for tool in before}, {tool.name: tool for tool in after}
    gone = [tool for name, tool in old.items() if name not in new]
    come = [tool for name, tool in new.items() if name not in old]
    renamed = {
        tool.name: same[0] for tool in come if (same := _same(tool, gone)) and len(same) == len(_same(tool, come)) == 1
    }
    left = {tool.name for tool in gone} - {tool.name for tool in renamed.values()}
    return (
        *(Change(TOOL, name, Action.UPDATE, f"renamed from {was.name}") for name, was in sorted(renamed.items())),
        *(Change(TOOL, tool.name, Action.CREATE) for tool in come if tool.name not in renamed),
        *(Change(TOOL, tool.name, Action.DESTROY) for tool in gone if tool.name in left),
    )


def _same(tool: Tool, among: Iterable[Tool]) -> list[Tool]:
    return [other for other in among if (other.devices, other.effect) == (tool.devices, tool.effect)]
