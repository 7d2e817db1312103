"""``graph``: the nodes and what they consume, for a drawing program."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.plan.configuration import compile_project
from octoform.graph.model import to_dot, to_mermaid
from octoform.views.format import output, problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """DOT or mermaid on standard output."""
    compiled, found = compile_project(project, os.environ)
    if compiled is None:
        return problems.show(screen, found)
    return output.plain(screen, (to_dot if arguments.type == "dot" else to_mermaid)(compiled.graph))
