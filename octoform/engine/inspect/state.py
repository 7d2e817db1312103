"""Looking and small interventions: show, state, accept, force-unlock, explain, graph. (Heavy.)"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from octoform.apply.context import Clock
from octoform.contracts.canon import output_digest
from octoform.contracts.parsing import parse
from octoform.diagnostics import Diagnostic, did_you_mean, error, has_errors
from octoform.engine.plan.configuration import Compiled, compile_project
from octoform.engine.plan.refresh import Situation, look
from octoform.engine.plan.refresh import verify as verify_artifact
from octoform.graph.model import key_of, key_parts
from octoform.plan import model, planfile
from octoform.plan.model import Plan
from octoform.state.artifacts.accepted import file_digest
from octoform.state.files import read_regular
from octoform.state.layout import STAGES, STEP
from octoform.state.model import NodeState, Snapshot, Status
from octoform.state.store.lock import acquire, force_unlock
from octoform.state.store.store import StateStore


@dataclass(frozen=True, slots=True)
class Found:
    """A compiled project with its opened state."""

    compiled: Compiled
    store: StateStore

    @property
    def snapshot(self) -> Snapshot:
        """The state, journal folded, its nodes in the order of work (the file sorts them by name)."""
        found, names = self.store.snapshot, self.compiled.graph.names()
        order = sorted(found.nodes, key=lambda name: names.index(name) if name in names else len(names))
        return found.model_copy(update={"nodes": {name: found.nodes[name] for name in order}})


def open_project(project: Path, environ: Mapping[str, str]) -> tuple[Found | None, list[Diagnostic]]:
    """Manifest and state of a folder; changes nothing."""
    compiled, found = compile_project(project, environ)
    if compiled is None:
        return None, found
    store, more = StateStore.open(compiled.layout)
    return (Found(compiled, store) if store is not None else None), [*found, *more]


def saved_plan(path: Path) -> tuple[Plan | None, list[Diagnostic]]:
    """The plan that a file of ``plan -out`` holds."""
    data, problem = read_regular(path)
    if data is None:
        return None, [problem or error("PLAN-NOT-A-PLAN", "there is no such file", path=str(path))]
    document, found = planfile.read(data, str(path))
    return (model.from_json(document.plan) if document else None), found


def node_of(snapshot: Snapshot, name: str) -> tuple[NodeState | None, list[Diagnostic]]:
    """One node of the state, or STATE-NO-NODE with a near name."""
    state = snapshot.nodes.get(name)
    if state is not None:
        return state, []
    near = did_you_mean(name, list(snapshot.nodes))
    hint = f"did you mean {near}?" if near else "`octoform state list` shows what there is"
    return None, [error("STATE-NO-NODE", f"the state has no node {name!r}", hint=hint)]


Step = Callable[[Found], list[Diagnostic]]


def change(project: Path, environ: Mapping[str, str], operation: str, step: Step) -> list[Diagnostic]:
    """One small change of the state, under the lock, in the journal, in the snapshot."""
    compiled, found = compile_project(project, environ)
    if compiled is None:
        return found
    acquired = acquire(compiled.layout, operation)
    if acquired.lock is None:
        return [*found, *acquired.diagnostics]
    with acquired.lock:
        opened, found = open_project(project, environ)
        if opened is None:
            return found
        found = step(opened)
        return found if has_errors(found) else [*found, *opened.store.commit_snapshot()]


def forget(project: Path, environ: Mapping[str, str], name: str) -> list[Diagnostic]:
    """``state rm``: the node leaves the state, its artifact stays."""

    def step(opened: Found) -> list[Diagnostic]:
        state, found = node_of(opened.snapshot, name)
        return found if state is None else opened.store.remove(name)

    return change(project, environ, "state rm", step)


def accept(project: Path, environ: Mapping[str, str], name: str) -> list[Diagnostic]:
    """``accept NODE``: the artifact that is there, verified, under the key of today's specs and settings."""

    def step(opened: Found) -> list[Diagnostic]:
        state, found = node_of(opened.snapshot, name)
        found = found or _not_to_be_accepted(opened, name)
        if state is None or found:
            return found
        situation = look(opened.compiled, opened.snapshot, environ)
        if _has_artifact(name) and name not in situation.artifacts:
            return _unacceptable(opened.compiled, name, situation)
        found = verify_artifact(opened.compiled, name, situation.artifacts)
        if has_errors(found):
            return found
        return found + opened.store.success(name, _adopted(opened, state, situation, name))

    return change(project, environ, "accept", step)


def _has_artifact(name: str) -> bool:
    return name in STAGES or name.startswith(STEP)


def _not_to_be_accepted(opened: Found, name: str) -> list[Diagnostic]:
    """What stands in the way before any artifact is looked at."""
    if name not in opened.compiled.graph.names():
        summary = f"the step {name} is not switched on, so nothing says what it would be accepted as"
        return [error("STATE-NO-NODE", summary, hint="name it under privileged_steps first")]
    if not _has_artifact(name):
        summary = f"{name} is no artifact, so there is nothing to accept"
        return [error("ARTIFACT-MISSING", summary, hint="octoform apply brings it up to date; no agent runs for it")]
    gone = [other for other in opened.compiled.graph.node(name).consumes if other not in opened.snapshot.nodes]
    summary = f"{name} rests on {', '.join(gone)}, which the state does not have"
    return [error("STATE-NO-NODE", summary, hint="octoform apply makes what is missing")] if gone else []


def _unacceptable(compiled: Compiled, name: str, situation: Situation) -> list[Diagnostic]:
    """Why what lies there cannot even be read as an artifact of that stage."""
    path = compiled.layout.output(name)
    hint = f"restore it, or run `octoform apply -replace {name}`"
    data, problem = read_regular(path)
    if data is None:
        summary = f"the artifact of {name} is not there; nothing can be accepted"
        return [problem or error("ARTIFACT-MISSING", summary, path=str(path), hint=hint)]
    value, found = parse(name, data, str(path))
    return found or verify_artifact(compiled, name, {**situation.artifacts, name: value})


def _adopted(opened: Found, state: NodeState, situation: Situation, name: str) -> NodeState:
    compiled = opened.compiled
    node = compiled.graph.node(name)
    outputs = {other: opened.snapshot.nodes[other].output_digest for other in node.consumes}
    parts = key_parts(node, outputs, situation.fingerprint.digest)
    value: Any = situation.artifacts.get(name)
    changed = {
        "key": key_of(parts),
        "key_parts": parts,
        "output_digest": output_digest(name, value, compiled.schemas) if value is not None else state.output_digest,
        "file_digest": file_digest(compiled.layout, name) or "",
        "accepted_at": Clock().stamp(),
        "tainted": False,
        "status": Status.ACCEPTED,
        "detail": {**state.detail, "contract": situation.contract, "adopted": True},
    }
    return state.model_copy(update=changed)


def unlock(project: Path, environ: Mapping[str, str], lock_id: str) -> list[Diagnostic]:
    """``force-unlock``: remove the lock with that id."""
    compiled, found = compile_project(project, environ)
    return found if compiled is None else force_unlock(compiled.layout, lock_id)
