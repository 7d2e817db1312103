"""A graph of six nodes, a state in which each was accepted, and what is observed of it."""

from typing import Any

from octoform.graph.model import Graph, Node, NodeKind, key_parts
from octoform.plan.diff import Observed, Prior

NAMES = ("probe", "identify", "interface", "serve", "deploy", "endpoint")


def node(name: str) -> Node:
    before = NAMES[: NAMES.index(name)]
    if name == "endpoint":
        return Node(name, NodeKind.ENDPOINT, ("interface", "serve", "deploy"), {"setting.scope": "local"})
    parts = {"spec": f"sha256:spec-{name}", "harness": "builtin", "model": ""}
    return Node(name, NodeKind.STAGE, before[-1:], parts, observes_host=name == "probe", harness="builtin")


GRAPH = Graph(tuple(node(name) for name in NAMES))
FINGERPRINT = "sha256:host"
OUTPUTS = {name: f"sha256:out-{name}" for name in NAMES}
FILES = {name: f"sha256:file-{name}" for name in NAMES}


def settled(**changes: Prior) -> dict[str, Prior]:
    """A state in which every node was accepted with today's key."""
    prior = {
        item.name: Prior("accepted", key_parts(item, OUTPUTS, FINGERPRINT), OUTPUTS[item.name], FILES[item.name])
        for item in GRAPH.nodes
    }
    return {**prior, **changes}


def observed(**changes: Any) -> Observed:
    """That state seen unchanged, but for what is given."""
    return Observed(**{"fingerprint": FINGERPRINT, "files": FILES, **changes})
