"""Looking and small interventions: show, state, accept, force-unlock, explain, graph. (Heavy.)"""

import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from octoform.apply.context import Clock
from octoform.contracts.artifact_parser import parse
from octoform.contracts.canonical import output_digest
from octoform.diagnostics import Diagnostic, did_you_mean, error, has_errors
from octoform.endpoint.logs import CALLS, Line, Logs, logs_of
from octoform.engine.plan.configuration import Compiled, compile_project
from octoform.engine.plan.refresh import Situation, look
from octoform.engine.plan.refresh import verify as verify_artifact
from octoform.engine.tools import layout_of
from octoform.graph.model import key_parts
from octoform.plan import model, planfile
from octoform.plan.model import Plan
from octoform.records import dataclass, field
from octoform.state.accepted import file_digest, keyed
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
        return None, [planfile.unread(str(path), problem)]
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
    """``state adopt NODE``: the artifact that is there, verified, under the key of today's specs and settings."""

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
    """The problems that prevent a look at the artifacts."""
    if name not in opened.compiled.graph.names():
        summary = f"the step {name} is not switched on, so no input hash exists for its artifact"
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
        **keyed(parts),
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


# What the endpoint did, for a person: a call and its result as one entry, beside what its process printed. Light.

PATIENCE_SECONDS = 2.0
"""A call that takes longer is shown before its result comes."""


@dataclass(frozen=True, slots=True)
class Entry:
    """The content of one line for a person; ``at`` as in `Line`.

    ``line`` is what it was made of: of a call its result, as far as there is one. ``call`` is the line with which the
    call began; None for everything that is no call.
    """

    at: float
    line: Line
    call: Mapping[str, Any] | None = None
    ended: bool = True


@dataclass(slots=True)
class Pairing:
    """Brings calls and results together; ``clock`` counts seconds."""

    clock: Callable[[], float] = time.monotonic
    _open: dict[str, tuple[Line, float]] = field(default_factory=dict)

    def take(self, lines: list[Line]) -> Iterator[Entry]:
        """Entries for what has come: a call where its result stands."""
        for line in lines:
            record = line.record or {}
            event, key = record.get("event"), str(record.get("id"))
            if line.log == CALLS and event == "call":
                self._open[key] = (line, self.clock())
            elif line.log == CALLS and event == "result":
                began = self._open.pop(key, None)
                yield Entry(line.at, line, (began[0].record if began else None) or record)
            else:
                yield Entry(line.at, line)

    def waiting(self, seconds: float) -> Iterator[Entry]:
        """Calls that have had no result for so long, each once; its result is an entry of its own."""
        now = self.clock()
        for key, (line, since) in self._open.items():
            if now - since >= seconds:
                self._open[key] = (line, float("inf"))
                yield Entry(line.at, line, line.record, ended=False)


def open_logs(project: Path, environ: Mapping[str, str]) -> tuple[Logs | None, list[Diagnostic]]:
    """The logs of the project's host; to be closed."""
    layout, found = layout_of(project, environ)
    return (logs_of(layout) if layout else None), found


def entries(logs: Logs) -> tuple[list[Entry], Pairing]:
    """All that there is now, in order, a call without a result where it began; and what is to go on with."""
    pairing = Pairing()
    found = [*pairing.take(logs.read()), *pairing.waiting(0.0)]
    return sorted(found, key=lambda entry: entry.at), pairing


def following(logs: Logs, pairing: Pairing, go_on: Callable[[], bool]) -> Iterator[list[Entry]]:
    """The further output, in pieces; ``go_on`` waits, and states whether anybody is still there to read."""
    while go_on():
        yield [*pairing.take(logs.read()), *pairing.waiting(PATIENCE_SECONDS)]


def lines(logs: Logs, go_on: Callable[[], bool]) -> Iterator[list[Line]]:
    """The same without bringing calls and results together."""
    while go_on():
        yield logs.read()
