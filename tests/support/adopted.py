"""A host whose state stands on one server, about to get another one; and a kill at any moment of that."""

from pathlib import Path

from octoform.apply.endpoint_node import made_of
from octoform.base import digest
from octoform.graph.model import Graph, Node, NodeKind, key_of
from octoform.state.accepted import accept, file_digest
from octoform.state.layout import Layout
from octoform.state.model import NodeState, Status
from octoform.state.store.store import Ports, StateStore

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
