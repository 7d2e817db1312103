"""The run: the plan's actions in order, each journalled; what came out the same stops the wave (early cutoff)."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from octoform import __version__, events
from octoform.apply.context import Context, Tally, accepted
from octoform.apply.destroy import take_away
from octoform.apply.endpoint_node import run_endpoint
from octoform.apply.rewrite import promotion
from octoform.apply.stage import reuse
from octoform.apply.stage.acceptance import Finished, Verdict
from octoform.apply.stage.artifact_writer import remember
from octoform.apply.stage.attempt import Failed
from octoform.apply.stage.attempt_loop import may_go_on, run_stage
from octoform.apply.stage.attempt_record import state_usage
from octoform.apply.stage.serve_feedback import BLAMES, rerun, sent_back
from octoform.base import digest
from octoform.contracts.artifact_parser import parse
from octoform.contracts.contract_check import has_shape
from octoform.diagnostics import Diagnostic, has_errors
from octoform.graph.model import Node, NodeKind, key_of, key_parts, moved_parts
from octoform.harness.watcher import added
from octoform.manifest.model import MODEL_FREE
from octoform.plan.diff import WANTED_ANEW, Tool, changes, is_ignored
from octoform.plan.model import Action, Plan, PlannedAction
from octoform.records import dataclass, replace
from octoform.state.accepted import accept, file_digest, keyed
from octoform.state.files import read_regular
from octoform.state.model import NodeState, Status

# What became of the tools when INTERFACE was made again: a new name for the same is reported as such, not as a loss.

STAGE = "interface"
MAX_RENAMED = 3


def renamed(context: Context, stage: str, value: Any) -> str:
    """``, take_picture was capture_image``: the end of a line on an INTERFACE that takes the accepted one's place."""
    if stage != STAGE:
        return ""
    data, _ = read_regular(context.layout.output(STAGE))
    before, _ = parse(STAGE, data, STAGE) if data is not None else (None, [])
    if not isinstance(before, Mapping) or not has_shape(STAGE, before, context.schemas):
        return ""
    found = [item for item in changes(_tools(before), _tools(value)) if item.action is Action.UPDATE]
    lines = [f", {item.name} was {item.text.removeprefix('renamed from ')}" for item in found]
    more = f" and {len(lines) - MAX_RENAMED} more renamed" if len(lines) > MAX_RENAMED else ""
    return "".join(lines[:MAX_RENAMED]) + more


def _tools(interface: Mapping[str, Any]) -> Iterable[Tool]:
    return [Tool(tool["name"], frozenset(tool["devices"]), tool["effect"]) for tool in interface["tools"]]


@dataclass(frozen=True, slots=True)
class _Again:
    """A node's second run in one apply; ``failed`` is what it has to fix, None for one that stands on what was fixed.

    ``counted`` states that the node was accepted before in this apply.
    """

    failed: Failed | None
    counted: bool


def execute(context: Context, plan: Plan, allowed: Callable[[str], bool]) -> Tally:
    """Carry out the plan's work in order; stops at the first node that fails. ``allowed`` leaves nodes out."""
    tally, returns, made = Tally(), Counter[str](), set[str]()
    for action in plan.work:
        if not allowed(action.node):
            continue
        if action.action is Action.DESTROY:
            _take_away(context, action.node, tally)
            if tally.failed:
                return tally
            continue
        node = context.graph.node(action.node)
        if not action.certain and settled(context, node):
            context.emit(events.NodeUnchanged(node.name, "its inputs came out the same"))
            continue
        _carry_out(context, node, action, tally)
        while (judge := tally.failed) and (maker := context.graph.node(judge).returns):
            spent = returns[judge] >= BLAMES[maker].most or maker not in made
            if spent or not _restored(context, action, tally, maker, made):
                break
            returns[judge] += 1
            _follow(context, action, tally, judge, made)
        if tally.failed:
            return tally
        made.add(node.name)
    return tally


def _take_away(context: Context, node: str, tally: Tally) -> None:
    """Remove a node that is no longer in the graph: what it had made, and what the state knows of it."""
    found = take_away(context, node)
    tally.diagnostics += found
    if has_errors(found):
        tally.failed = node
    else:
        tally.destroyed += 1


def _restored(context: Context, action: PlannedAction, tally: Tally, maker: str, made: set[str]) -> bool:
    """Whether what failed is an earlier stage's to fix; then that has run again, and the failed node after it."""
    judge, fault = tally.failed or "", BLAMES[maker].fault
    failed = sent_back(context, maker, tally.diagnostics)
    if failed is None:
        return False
    spent = [name for name in (maker, judge) if not may_go_on(context, name)]
    if spent:
        text = f"{fault}, and the budget of {' and '.join(spent)} has nothing left to fix it with"
        context.emit(events.Notice(judge, text))
        return False
    context.emit(events.Notice(judge, f"{fault}; {maker.upper()} gets the findings and runs again"))
    tally.failed = None
    tally.diagnostics = [item for item in tally.diagnostics if item not in failed.standing]
    _repeat(context, action, tally, maker, _Again(failed, counted=True))
    _repeat(context, action, tally, judge, _Again(None, counted=judge in made))
    return True


def _follow(context: Context, action: PlannedAction, tally: Tally, judge: str, made: set[str]) -> None:
    """Run again what lies between the stage that was sent back and the node at which the run is."""
    for name in context.graph.from_to(judge, action.node):
        if name in made or name == action.node:
            _repeat(context, action, tally, name, _Again(None, counted=name in made))


def _repeat(context: Context, action: PlannedAction, tally: Tally, name: str, again: _Again) -> None:
    if tally.failed is None:
        _carry_out(context, context.graph.node(name), replace(action, node=name), tally, again)


def settled(context: Context, node: Node) -> bool:
    """True when nothing that the node's key holds has moved: it need not run after all."""
    known = context.store.snapshot.nodes.get(node.name)
    return known is not None and known.status is Status.ACCEPTED and _moved(context, node, known) == []


def _moved(context: Context, node: Node, known: NodeState) -> list[str]:
    now = _parts(context, node)
    ignored = frozenset(context.manifest.lifecycle.ignore)
    return [name for name in moved_parts(known.key_parts, now) if not is_ignored(name, ignored)]


def _parts(context: Context, node: Node) -> dict[str, str]:
    outputs = {name: context.store.snapshot.nodes[name].output_digest for name in node.consumes}
    return key_parts(node, outputs, context.fingerprint)


def _carry_out(context: Context, node: Node, action: PlannedAction, tally: Tally, again: _Again | None = None) -> None:
    context.emit(events.NodeStarted(node.name, action.action.value))
    before = _output(context, node)
    found = context.store.begin(node.name, {"action": action.action.value})
    if not has_errors(found):
        finished = _run(context, node, action, again)
        tally.agent_runs += finished.attempts
        tally.usage = added(tally.usage, finished.usage)
        found = _end(context, node, finished)
        tally.diagnostics += finished.verdict.diagnostics if finished.verdict.accepted else ()
    if has_errors(found):
        tally.failed = node.name
        tally.diagnostics += found
    elif again is not None and again.counted:
        return
    elif action.action is Action.CREATE:
        tally.added += 1
    elif before is not None and before == _output(context, node):
        tally.alike += 1
    else:
        tally.changed += 1


def _output(context: Context, node: Node) -> str | None:
    """The digest of the node's accepted output; None where there is none."""
    known = context.store.snapshot.nodes.get(node.name)
    return known.output_digest if known is not None else None


def _run(context: Context, node: Node, action: PlannedAction, again: _Again | None) -> Finished:
    if node.kind is NodeKind.ENDPOINT:
        return run_endpoint(context, again=action.action is Action.REPLACE)
    if node.kind is NodeKind.STEP:
        # Imported here: most manifests name no step, and loading its tests and cameras takes long.
        from octoform.apply.privileged_step import run_step

        return run_step(context, node.name)
    if again is not None:
        return run_stage(context, node.name, again.failed)
    if not _may_borrow(action):
        return run_stage(context, node.name)
    parts = _parts(context, node)
    return reuse.take(context, node.name, key_of(parts)) or run_stage(context, node.name, _former(context, node, parts))


def _former(context: Context, node: Node, parts: Mapping[str, str]) -> Failed | None:
    """The accepted output that an agent begins with; an agent without a model writes its own again at no cost."""
    return None if context.manifest.harness_for(node.name).name in MODEL_FREE else rerun(context, node.name, parts)


def _may_borrow(action: PlannedAction) -> bool:
    return not any(reason.cause in WANTED_ANEW for reason in action.reasons)


def _end(context: Context, node: Node, finished: Finished) -> list[Diagnostic]:
    """Accept or refuse; the diagnostics with errors are why the node failed."""
    verdict = finished.verdict
    before = context.store.snapshot.nodes.get(node.name)
    found, result = list(verdict.diagnostics), verdict.found
    if verdict.accepted:
        result += renamed(context, node.name, verdict.value)
        found = _adopted(context, node, verdict)
        found += _accept(context, node, verdict) if not has_errors(found) else []
        if not has_errors(found):
            found += context.store.success(node.name, _state(context, node, finished))
    if has_errors(found):
        context.emit(events.NodeFailed(node.name, tuple(found), finished.seconds))
        return found + context.store.failure(node.name, found)
    changed = before is None or before.output_digest != verdict.digest
    used = finished.usage
    spent = (used.input_tokens, used.output_tokens, used.cost_usd)
    context.emit(events.NodeAccepted(node.name, finished.attempts, finished.seconds, result, changed, *spent))
    return found


def _adopted(context: Context, node: Node, verdict: Verdict) -> list[Diagnostic]:
    """The server that a step has rewritten and proved becomes the accepted one, before the step itself does."""
    if verdict.rewritten is None:
        return []
    context.emit(events.Checking(node.name, "the rewritten server takes the place of the accepted one"))
    return promotion.adopt(context, node.name, verdict.rewritten)


def _accept(context: Context, node: Node, verdict: Verdict) -> list[Diagnostic]:
    if node.kind is NodeKind.ENDPOINT:
        return []
    return [
        *remember(context, node.name, verdict.value),
        *accept(context.layout, node.name, verdict.files, context.checkpoint),
    ]


def _state(context: Context, node: Node, finished: Finished) -> NodeState:
    parts = _parts(context, node)
    return NodeState(
        **keyed(parts),
        output_digest=finished.verdict.digest,
        file_digest=file_digest(context.layout, node.name) or "",
        harness=node.harness,
        model=node.model,
        program=finished.program or (f"octoform {__version__}" if node.harness in (None, *MODEL_FREE) else None),
        specs=digest.of_value({name: spec.digest for name, spec in context.specs.items()}),
        platform=_platform(context),
        attempts=finished.attempts,
        usage=state_usage(finished.usage),
        seconds=round(finished.seconds, 3),
        accepted_at=context.clock.stamp(),
        detail={**finished.verdict.detail, "contract": context.contract},
    )


def _platform(context: Context) -> dict[str, str]:
    """The system's facts in the accepted PROBE; empty where there is none yet."""
    found: dict[str, str] = accepted(context, "probe")["platform"] if context.layout.output("probe").is_file() else {}
    return found
