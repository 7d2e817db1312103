"""Rules on scope and policy: settings of a scope that is not chosen, rules that can never decide.

(Heavy: the document.)
"""

from octoform.manifest.schema.document import Document
from octoform.manifest.source import tree
from octoform.manifest.source.report import Report
from octoform.manifest.source.tree import Loc, Table

_USED_IN = {"network": ("intranet", "internet"), "tunnel": ("internet",)}


def check(document: Document, root: Table, report: Report) -> None:
    """Report what does not fit together in a document that fits the schema."""
    for name, scopes in _USED_IN.items():
        key = tree.key_at(root, (name,))
        if key is not None and document.scope not in scopes:
            report.error(
                "MANIFEST-SCOPE",
                f"scope {document.scope} has no {name}",
                key.span,
                hint=f"remove it, or write {' or '.join(f'`scope: {scope}`' for scope in scopes)}",
            )
    _rules(document, root, report)


def _rules(document: Document, root: Table, report: Report) -> None:
    """A name that an earlier rule has taken already; what a later one says of it would look as if it were in force."""
    taken: dict[str, int] = {}
    for index, rule in enumerate(document.policy.rules):
        for at, glob in enumerate(rule.tools):
            loc: Loc = ("policy", "rules", index, "tools", at)
            before = taken.get("*", taken.get(glob))
            node = tree.at(root, loc)
            if before is not None and before != index and node is not None:
                report.warning(
                    "MANIFEST-UNUSED",
                    f"this has no effect: `policy.rules[{before}]` decides for these tools",
                    node.span,
                    hint="the first rule that matches decides; put the more special one first, or remove this one",
                )
            taken.setdefault(glob, index)
