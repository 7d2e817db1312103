"""The graph as text for drawing programs: Graphviz DOT and mermaid."""

from octoform.escaping import escaped
from octoform.graph.model import Graph, Node, NodeKind


def to_dot(graph: Graph) -> str:
    """A DOT digraph; an arrow points from a node to what it consumes, a dashed one to what it is carried out with."""
    lines = ["digraph octoform {", "  rankdir = LR;", '  node [shape = box, fontname = "sans-serif"];']
    lines += [f'  "{node.name}" [label = "{_quoted(node)}"];' for node in graph.nodes]
    lines += [f'  "{node.name}" -> "{other}";' for node in graph.nodes for other in node.consumes]
    lines += [f'  "{node.name}" -> "{other}" [style = dashed];' for node in graph.nodes for other in node.after]
    return "\n".join([*lines, "}", ""])


def to_mermaid(graph: Graph) -> str:
    """A mermaid flowchart, left to right in the order of work."""
    lines = ["flowchart LR"]
    lines += [f'    {node.name}["{_entities(node)}"]' for node in graph.nodes]
    lines += [f"    {other} --> {node.name}" for node in graph.nodes for other in node.consumes]
    lines += [f"    {other} -.-> {node.name}" for node in graph.nodes for other in node.after]
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
