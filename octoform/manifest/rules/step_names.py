"""The privileged steps that a manifest switches on, each with its place.

Whether a step exists is told by the files of the protocol, which the manifest does not know; whoever knows both needs
the place for what there is to say.
"""

from octoform.manifest.model import NamedStep
from octoform.manifest.source import tree
from octoform.manifest.source.report import Report
from octoform.manifest.source.tree import Items, Scalar, Table


def named(root: Table, report: Report) -> tuple[NamedStep, ...]:
    """The steps of a document without errors, in order."""
    node = tree.at(root, ("privileged_steps",))
    items = node.items if isinstance(node, Items) else ()
    return tuple(
        NamedStep(item.text, item.span, report.source(item.span)) for item in items if isinstance(item, Scalar)
    )
