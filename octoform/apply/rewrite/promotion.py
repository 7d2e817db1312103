"""A rewritten server: served for its proof, then put into the place of the accepted one, or taken back.

While it is only being tried it is outside of the accepted artifacts, and the endpoint is published from there. So
a run that is killed meanwhile leaves the artifacts as they were, and an endpoint that the next plan finds to differ
and the next apply puts back. Once it is proved, one file records it before anything of the artifacts changes: a run
that is killed from then on is finished by the next one.
"""

import shutil
from dataclasses import asdict
from pathlib import Path

from octoform import events
from octoform.apply import file_integrity, protected_paths
from octoform.apply.context import CANDIDATE, Context
from octoform.apply.endpoint_node import made_of
from octoform.apply.stage.artifact_writer import runtime_files, text_of
from octoform.apply.stage.serve_proof import STARTING, Judge, prove_import, publish
from octoform.base import digest, files
from octoform.base.files import private_folder
from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.endpoint.client.check import judge_check
from octoform.endpoint.environment.build import build
from octoform.endpoint.environment.model import Environment
from octoform.endpoint.published_files import CHECK
from octoform.graph.model import Graph, Node, NodeKind, renewed
from octoform.harness.port import Task
from octoform.records import dataclass, replace
from octoform.state.accepted import accept, file_digest, keyed
from octoform.state.artifact_cache import keep_accepted
from octoform.state.files import Checkpoint, pass_by, read_regular, spending, write_atomic
from octoform.state.layout import Layout
from octoform.state.model import NodeState, Status
from octoform.state.store.store import StateStore

MAKER = "serve"
RECORD = "adopting.json"
FORMER = "former-server.py"


class Candidate(Layout):
    """The paths of a host whose server is the one that is being tried."""

    def output(self, stage: str) -> Path:
        """The artifact of a stage; of SERVE the one that is being tried."""
        return self.local / CANDIDATE / "server.py" if stage == MAKER else Layout.output(self, stage)

    @property
    def runtime(self) -> Path:
        """The modules beside that server."""
        return self.local / CANDIDATE / "runtime"


@dataclass(frozen=True, slots=True)
class Adoption:
    """A proved server on its way: whose it is, the digests of the accepted server and of this one, its text."""

    node: str
    base: str
    digest: str
    source: str


def offer(context: Context, task: Task, source: str, judge: Judge = judge_check) -> list[Diagnostic]:
    """Import the server where it will be served, and publish the endpoint with it; no errors: it is live."""
    environment, found = _environment(context)
    if environment is None:
        return found
    watch = protected_paths.of_sources(context)
    more, _ = prove_import(context, environment, task, source)
    found += [*more, *file_integrity.end(watch, task.workdir / protected_paths.UNDONE)]
    if has_errors(found):
        return found
    trial = Candidate(context.layout.project, context.layout.host)
    problem = _write(trial, source)
    if problem is not None:
        return [*found, problem]
    context.emit(events.Checking(task.stage, STARTING))
    publish(replace(context, layout=trial), environment, found, judge)
    return found


def put_back(context: Context, *, smoke: bool = True) -> list[Diagnostic]:
    """Serve the accepted server again, if another one is being tried; problems are why it could not be.

    Without ``smoke`` it is put back whatever its tools say: it was in service before.
    """
    folder = context.layout.local / CANDIDATE
    if not folder.is_dir():
        return []
    found = published(context, smoke=smoke)
    shutil.rmtree(folder, ignore_errors=True)
    return found


def adopt(context: Context, node: str, source: str, *, smoke: bool = True) -> list[Diagnostic]:
    """Make a proved server the accepted one, with all that rests on it; ``node`` is who rewrote it.

    An error shows what the disk refused; what is not done then is finished by the next apply (`resume`).
    """
    layout, store = context.layout, context.store
    base = store.snapshot.nodes[MAKER].output_digest
    adoption = Adoption(node, base, digest.of_bytes(source.encode()), source)
    problem = spending(layout, lambda: write_atomic(layout.local / RECORD, _encoded(adoption), 0o600))
    if problem is not None:
        return [problem]
    context.checkpoint("adopting.recorded")
    found = _carry_through(layout, store, context.graph, adoption, context.checkpoint)
    if has_errors(found):
        return found
    # Without room for a copy it is adopted all the same; the next run that finds room keeps one.
    keep_accepted(layout, {MAKER: store.snapshot.nodes[MAKER].file_digest})
    context.checkpoint("adopting.journalled")
    found += published(context, smoke=smoke)
    if not has_errors(found):
        shutil.rmtree(layout.local / CANDIDATE, ignore_errors=True)
    _forget(layout)
    return found


def resume(layout: Layout, store: StateStore, graph: Graph) -> tuple[tuple[str, ...], list[Diagnostic]]:
    """Finish an adoption that a killed run has left: what a person is notified of it, and why it could not be finished.

    The caller holds the lock. Nothing is started: the endpoint is made to be published again by the plan that follows.
    """
    adoption = _read(layout)
    if adoption is None:
        return (), []
    known = store.snapshot.nodes.get(MAKER)
    if known is None or known.output_digest not in (adoption.base, adoption.digest):
        _forget(layout)  # SERVE was made again since
        return (), []
    found = _carry_through(layout, store, graph, adoption)
    if has_errors(found):
        return (), found
    # Whether the endpoint was published from the tried file or the accepted one is not known; its bytes are the same.
    (layout.endpoint / CHECK).unlink(missing_ok=True)
    _forget(layout)
    return (
        f"finished what a killed run had begun: the server that {adoption.node} rewrote is the accepted one",
    ), found


def _environment(context: Context) -> tuple[Environment | None, list[Diagnostic]]:
    path = context.layout.requirements_lock
    if not path.is_file():
        hint = "octoform apply -replace deploy"
        return None, [error("ENDPOINT-NO-LOCK", "the lock of the endpoint is gone", path=str(path), hint=hint)]
    environment, found = build(context.layout, files.read(path).decode("utf-8", "replace"))
    return environment, list(found)


def published(context: Context, *, smoke: bool = True) -> list[Diagnostic]:
    """Publish the endpoint from the accepted artifacts and call its read tools; no errors: it is live."""
    environment, found = _environment(context)
    if environment is not None:
        context.emit(events.Checking("endpoint", STARTING if smoke else "starting the endpoint"))
        publish(context, environment, found, smoke=smoke)
    return found


def _write(trial: Layout, source: str) -> Diagnostic | None:
    shutil.rmtree(trial.local / CANDIDATE, ignore_errors=True)
    for name, data in {"server.py": source.encode(), **runtime_files()}.items():
        path = trial.local / CANDIDATE / name
        private_folder(path.parent)
        problem = write_atomic(path, data, 0o600)
        if problem is not None:
            return problem
    return None


def _carry_through(
    layout: Layout, store: StateStore, graph: Graph, adoption: Adoption, checkpoint: Checkpoint = pass_by
) -> list[Diagnostic]:
    """Accept the server's files, then the nodes; each part may have been done before."""
    former, _ = read_regular(layout.output(MAKER))
    if former is not None and digest.of_bytes(former) == adoption.base:
        problem = spending(layout, lambda: write_atomic(layout.local / FORMER, former, 0o600))
        if problem is not None:
            return [problem]
    found = accept(layout, MAKER, {"server.py": adoption.source.encode(), **runtime_files()}, checkpoint)
    if has_errors(found):
        return found
    known = store.snapshot.nodes[MAKER]
    made = {"lines": len(adoption.source.splitlines()), "rewritten": {"by": adoption.node, "former": adoption.base}}
    kept = {name: value for name, value in known.detail.items() if name not in ("interrupted", "failure")}
    after = known.model_copy(
        update={
            "output_digest": adoption.digest,
            "file_digest": file_digest(layout, MAKER) or "",
            "status": Status.ACCEPTED,
            "detail": {**kept, **made},
        }
    )
    found += store.success(MAKER, after)
    return found if has_errors(found) else found + _renew(layout, store, graph, adoption)


def _renew(layout: Layout, store: StateStore, graph: Graph, adoption: Adoption) -> list[Diagnostic]:
    """The keys of what was accepted with the former server: it was verified again with this one, or is untouched."""
    moved = {MAKER: (adoption.base, adoption.digest)}
    for node in graph.nodes:
        known = store.snapshot.nodes.get(node.name)
        if known is None or known.status is not Status.ACCEPTED or node.name == MAKER:
            continue
        parts = renewed(known.key_parts, moved)
        if parts == known.key_parts:
            continue
        output = _endpoint_digest(layout, store, node) if node.kind is NodeKind.ENDPOINT else known.output_digest
        moved[node.name] = (known.output_digest, output)
        after = known.model_copy(update={**keyed(parts), "output_digest": output})
        found = store.success(node.name, after)
        if has_errors(found):
            return found
    return []


def _endpoint_digest(layout: Layout, store: StateStore, node: Node) -> str:
    lock, _ = read_regular(layout.requirements_lock)
    outputs = {name: _state(store, name).output_digest for name in node.consumes}
    return made_of(outputs, (lock or b"").decode())


def _state(store: StateStore, name: str) -> NodeState:
    return store.snapshot.nodes.get(name) or NodeState()


def _encoded(adoption: Adoption) -> bytes:
    return text_of({"format": 1, **asdict(adoption)})


def _read(layout: Layout) -> Adoption | None:
    """The rewrite that a killed run was about to adopt; None when it is incomplete."""
    data, _ = read_regular(layout.local / RECORD)
    try:
        fields = files.parse(data or b"")
        found = Adoption(*(str(fields[name]) for name in ("node", "base", "digest", "source")))
    except (ValueError, LookupError, TypeError):
        return None
    return found if digest.of_bytes(found.source.encode()) == found.digest else None


def _forget(layout: Layout) -> None:
    (layout.local / RECORD).unlink(missing_ok=True)
