"""Nodes, edges and keys.

A key is a digest over all that a node's output may depend on, kept in named parts so that a plan can say which part
moved and how. Revisions, times and program versions are no parts: they are recorded elsewhere and never re-run an
agent. This module stays light; the graph is compared on every plan.
"""

from collections.abc import Iterable, Mapping
from enum import StrEnum

from octoform.base import digest
from octoform.base.escaping import escaped
from octoform.records import dataclass, field

ANSWER = "answer."
"""How the key part of a person's answer begins; the device's id follows."""
INPUT = "input."
"""How the key part of a consumed output begins; the name of its node follows."""
HARDWARE = "hardware"
"""The key part of what the kernel announces."""
STEP = "step."
"""How the name of a privileged step's node begins; the step's own name follows."""


class NodeKind(StrEnum):
    """A stage is made by an agent, the endpoint by octoform's own code; a privileged step is by both.

    Of a step an agent reports what is to be tried, and octoform tries it.
    """

    STAGE = "stage"
    ENDPOINT = "endpoint"
    STEP = "step"


@dataclass(frozen=True, slots=True)
class Agent:
    """The agent of a stage: a harness, and its model where it uses one (reference unresolved)."""

    harness: str
    model: str | None = None


@dataclass(frozen=True, slots=True)
class Node:
    """One unit of the plan.

    ``parts`` are the key parts that are known before anything runs; ``consumes`` names the nodes whose output
    digests join them, ``after`` those that must merely be in place. ``observes_host`` adds the host fingerprint (PROBE
    alone). ``calls_model``: an agent that may work for it uses a model. ``escalate`` is asked for what the stage's own
    agent leaves unknown. ``returns`` names the node that makes its output again, in the same run, when this one fails
    because of it: the one edge against the order.
    """

    name: str
    kind: NodeKind
    consumes: tuple[str, ...]
    parts: Mapping[str, str] = field(default_factory=dict)
    observes_host: bool = False
    harness: str | None = None
    model: str | None = None
    calls_model: bool = False
    escalate: Agent | None = None
    after: tuple[str, ...] = ()
    returns: str | None = None

    @property
    def needs(self) -> tuple[str, ...]:
        """All nodes that come before it, whether their outputs are in its key or not."""
        return (*self.consumes, *self.after)


@dataclass(frozen=True, slots=True)
class Graph:
    """Nodes in an order in which each comes after all that it consumes."""

    nodes: tuple[Node, ...]

    def names(self) -> tuple[str, ...]:
        """Node names in order."""
        return tuple(node.name for node in self.nodes)

    def node(self, name: str) -> Node:
        """The node of that name; KeyError when there is none."""
        for node in self.nodes:
            if node.name == name:
                return node
        raise KeyError(name)

    def from_to(self, first: str, last: str) -> tuple[str, ...]:
        """The names of the nodes after ``first`` up to ``last``, in order."""
        names = self.names()
        return names[names.index(first) + 1 : names.index(last) + 1]

    def upstream(self, names: Iterable[str]) -> frozenset[str]:
        """The named nodes and all that they need."""
        wanted = set(names)
        for node in reversed(self.nodes):
            if node.name in wanted:
                wanted.update(node.needs)
        return frozenset(wanted)

    def downstream(self, names: Iterable[str]) -> frozenset[str]:
        """The named nodes and all that depend on them."""
        wanted = set(names)
        for node in self.nodes:
            if wanted.intersection(node.needs):
                wanted.add(node.name)
        return frozenset(wanted)


def key_parts(node: Node, outputs: Mapping[str, str], fingerprint: str | None) -> dict[str, str]:
    """All parts of a node's key; ``outputs`` gives the canonical output digest of each node it consumes."""
    parts = dict(node.parts)
    for name in node.consumes:
        parts[f"{INPUT}{name}"] = outputs[name]
    if node.observes_host and fingerprint is not None:
        parts[HARDWARE] = fingerprint
    return parts


def input_of(part: str) -> str:
    """The node whose output a key part is the digest of; empty for any other part."""
    return part.removeprefix(INPUT) if part.startswith(INPUT) else ""


def moved_parts(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """The names of the key parts that came, went or differ, in order."""
    return [part for part in sorted({*before, *now}) if before.get(part) != now.get(part)]


def renewed(parts: Mapping[str, str], outputs: Mapping[str, tuple[str, str]]) -> dict[str, str]:
    """The key parts of a node that was verified again after other nodes were; ``outputs`` has their digests before and
    after. An input that was not the former output stays: what was made of something older still is."""
    pairs = {f"{INPUT}{name}": pair for name, pair in outputs.items()}
    found = {part: pairs.get(part, (None, value)) for part, value in parts.items()}
    return {part: after if parts[part] == before else parts[part] for part, (before, after) in found.items()}


def key_of(parts: Mapping[str, str]) -> str:
    """The key: one digest over all parts."""
    return digest.of_value(dict(parts))


# The graph as text for drawing programs: Graphviz DOT and mermaid.


def to_dot(graph: Graph) -> str:
    """A DOT digraph; an arrow points from a node to what it consumes, a dashed one to what it is carried out with, and
    a dotted one to what it sends back when that is at fault."""
    lines = ["digraph octoform {", "  rankdir = LR;", '  node [shape = box, fontname = "sans-serif"];']
    lines += [f'  "{node.name}" [label = "{_quoted(node)}"];' for node in graph.nodes]
    lines += [f'  "{node.name}" -> "{other}";' for node in graph.nodes for other in node.consumes]
    lines += [f'  "{node.name}" -> "{other}" [style = dashed];' for node in graph.nodes for other in node.after]
    lines += [f'  "{node.name}" -> "{node.returns}" [style = dotted];' for node in graph.nodes if node.returns]
    return "\n".join([*lines, "}", ""])


def to_mermaid(graph: Graph) -> str:
    """A mermaid flowchart, left to right in the order of work; a labelled arrow leads back to what is made again."""
    lines = ["flowchart LR"]
    lines += [f'    {node.name}["{_entities(node)}"]' for node in graph.nodes]
    lines += [f"    {other} --> {node.name}" for node in graph.nodes for other in node.consumes]
    lines += [f"    {other} -.-> {node.name}" for node in graph.nodes for other in node.after]
    lines += [f"    {node.name} -. findings .-> {node.returns}" for node in graph.nodes if node.returns]
    return "\n".join([*lines, ""])


def _quoted(node: Node) -> str:
    """The label inside the quotes of DOT: the name of a model is any text."""
    return escaped(_label(node).replace("\\", "\\\\").replace('"', '\\"'))


def _entities(node: Node) -> str:
    """The label inside the quotes of mermaid, which knows no backslash."""
    return escaped(_label(node).replace("#", "#35;").replace('"', "#quot;"))


def _label(node: Node) -> str:
    if node.kind is NodeKind.ENDPOINT:
        return f"{node.name} (octoform)"
    maker = node.harness or "?"
    return f"{node.name} ({maker}, {node.model})" if node.model else f"{node.name} ({maker})"
