"""A rewritten server takes the accepted one's place as a whole, also when the run is killed at any moment of it."""

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from octoform import digest
from octoform.apply import adopting
from octoform.apply.context import Context
from octoform.apply.endpoint_node import CANDIDATE, made_of
from octoform.diagnostics import error
from octoform.graph.model import Graph, Node, NodeKind, key_of
from octoform.state.artifacts import accept, file_digest
from octoform.state.layout import Layout
from octoform.state.model import NodeState, Status
from octoform.state.store import Ports, StateStore

OLD, NEW = "import runtime\nBAUD = 9600\n", "import runtime\nBAUD = 1000000\n"
BEFORE, AFTER = digest.of_bytes(OLD.encode()), digest.of_bytes(NEW.encode())
CHAIN = ("probe", "identify", "interface", "serve", "deploy")
STEPS = ("step.rail", "step.arm")
GRAPH = Graph(
    (
        *(Node(name, NodeKind.STAGE, CHAIN[max(0, at - 1) : at], {"spec": name}) for at, name in enumerate(CHAIN)),
        Node("endpoint", NodeKind.ENDPOINT, CHAIN),
        *(Node(name, NodeKind.STEP, ("identify", "interface", "serve", "deploy")) for name in STEPS),
    )
)


RUNTIME = {"runtime/faults.py": b"FEW = True\n"}


@pytest.fixture(autouse=True)
def few_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """One module beside the server in place of some thirty, and no environment, which costs seconds to build."""
    monkeypatch.setattr(adopting, "runtime_files", lambda: RUNTIME)
    unbuilt = error("ENDPOINT-BUILD-FAILED", "there is nothing here to publish an endpoint with")
    monkeypatch.setattr(adopting, "build", lambda layout, text: (None, (unbuilt,)))


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder in memory where there is one: these tests wait for nothing but the disk."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if os.access(memory, os.W_OK) else None) as name:
        yield Path(name)


class Killed(BaseException):
    """What a kill -9 is to the code that runs."""


class Crash:
    """Lets so many moments pass and then kills."""

    def __init__(self, moments: int) -> None:
        self.left = moments

    def __call__(self, name: str) -> None:
        self.left -= 1
        if self.left < 0:
            raise Killed(name)


def host(folder: Path) -> Layout:
    """A host whose stages, endpoint and rail are accepted, and whose arm is about to be."""
    layout = Layout(folder, "bench")
    store = opened(layout)
    assert accept(layout, "serve", {"server.py": OLD.encode(), **RUNTIME}) == []
    layout.requirements_lock.parent.mkdir(parents=True)
    layout.requirements_lock.write_text("fastmcp==4.1\n")
    outputs = {name: f"sha256:{name}" for name in CHAIN} | {"serve": BEFORE}
    for node in GRAPH.nodes[:-1]:
        parts = {"spec": node.name, **{f"input.{name}": outputs[name] for name in node.consumes}}
        output = made_of({name: outputs[name] for name in node.consumes}, "fastmcp==4.1\n")
        state = NodeState(
            key=key_of(parts),
            key_parts=parts,
            output_digest=outputs.get(node.name, output),
            file_digest=file_digest(layout, node.name) or "",
            detail={"tools": 2},
        )
        assert store.success(node.name, state) == []
    assert store.begin("step.arm") == []
    assert store.commit_snapshot() == []
    layout.endpoint.mkdir(parents=True)
    (layout.endpoint / "check.json").write_text("{}")
    return layout


def opened(layout: Layout, ports: Ports | None = None) -> StateStore:
    store, found = StateStore.open(layout, ports)
    assert store is not None, found
    return store


def adopt(layout: Layout, crash: Any) -> None:
    """The adoption itself, all but the endpoint."""
    context = SimpleNamespace(
        layout=layout, store=opened(layout, Ports(checkpoint=crash)), graph=GRAPH, checkpoint=crash
    )
    found = adopting.adopt(cast(Context, context), "step.arm", NEW)
    assert [item.code for item in found] == ["ENDPOINT-BUILD-FAILED"]


def is_whole(layout: Layout, server: str) -> bool:
    """Whether files and state agree on one server, and every key with it."""
    nodes = opened(layout).snapshot.nodes
    assert layout.output("serve").read_text() == server
    wanted = digest.of_bytes(server.encode())
    assert nodes["serve"].output_digest == wanted
    assert nodes["serve"].file_digest == file_digest(layout, "serve")
    for name in ("deploy", "endpoint", "step.rail"):
        assert nodes[name].key_parts["input.serve"] == wanted
        assert nodes[name].key == key_of(nodes[name].key_parts)
    outputs = {name: nodes[name].output_digest for name in CHAIN}
    assert nodes["endpoint"].output_digest == made_of(outputs, "fastmcp==4.1\n")
    assert nodes["step.arm"].status is Status.INTERRUPTED
    return all(nodes[name].status is Status.ACCEPTED for name in (*CHAIN, "endpoint", "step.rail"))


def test_the_server_is_adopted_with_all_that_rests_on_it(folder: Path) -> None:
    layout = host(folder)
    adopt(layout, lambda name: None)
    assert is_whole(layout, NEW)
    serve = opened(layout).snapshot.nodes["serve"]
    assert serve.detail == {"tools": 2, "lines": 2, "rewritten": {"by": "step.arm", "former": BEFORE}}
    assert serve.key_parts["spec"] == "serve"
    assert (layout.local / adopting.FORMER).read_text() == OLD
    assert not (layout.local / adopting.RECORD).exists()


def test_a_run_that_is_killed_at_any_moment_is_finished_by_the_next(folder: Path) -> None:
    finished = 0
    for moments in range(200):
        layout = host(folder / str(moments))
        try:
            adopt(layout, Crash(moments))
        except Killed:
            told, found = adopting.resume(layout, opened(layout), GRAPH)
            assert found == []
        else:
            break
        if told:
            finished += 1
            assert is_whole(layout, NEW)
            # How the endpoint was published is not known: it is made anew.
            assert not (layout.endpoint / "check.json").exists()
        else:
            assert is_whole(layout, layout.output("serve").read_text())
        assert not (layout.local / adopting.RECORD).exists()
        assert adopting.resume(layout, opened(layout), GRAPH) == ((), [])
    else:
        raise AssertionError("it never came to its end")
    assert finished > 10


def test_what_was_recorded_for_another_server_is_dropped(folder: Path) -> None:
    layout = host(folder)
    with pytest.raises(Killed):
        adopt(layout, Crash(0))
    assert (layout.local / adopting.RECORD).exists()
    store = opened(layout)
    serve = store.snapshot.nodes["serve"].model_copy(update={"output_digest": "sha256:other"})
    assert store.success("serve", serve) == []
    assert adopting.resume(layout, store, GRAPH) == ((), [])
    assert layout.output("serve").read_text() == OLD
    assert not (layout.local / adopting.RECORD).exists()


def test_half_a_record_is_none(folder: Path) -> None:
    layout = host(folder)
    for text in ("", "{}", '{"node": 1}', '{"node":"a","base":"b","digest":"c","source":"d"}'):
        (layout.local / adopting.RECORD).write_text(text)
        assert adopting.resume(layout, opened(layout), GRAPH) == ((), [])
    assert is_whole(layout, OLD)


def test_the_server_that_is_tried_lies_outside_of_the_accepted_artifacts(folder: Path) -> None:
    layout, trial = Layout(folder, "bench"), adopting.Candidate(folder, "bench")
    assert trial.output("serve") == layout.local / CANDIDATE / "server.py"
    assert trial.runtime == trial.output("serve").parent / "runtime"
    assert trial.output("interface") == layout.output("interface") and trial.socket == layout.socket
