"""``state list|show|rm``: the state node by node."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.inspect.state import forget, node_of, open_project
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.inspect import state


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """One of the three verbs."""
    if arguments.verb == "rm":
        status = problems.show(screen, forget(project, os.environ, arguments.node), as_json=arguments.json)
        return status or state.forgotten(screen, arguments.node, as_json=arguments.json)
    opened, found = open_project(project, os.environ)
    if opened is None:
        return problems.show(screen, found, as_json=arguments.json)
    if arguments.verb == "list":
        return state.listing(screen, opened.snapshot, as_json=arguments.json)
    node, found = node_of(opened.snapshot, arguments.node)
    if node is None:
        return problems.show(screen, found, as_json=arguments.json)
    return state.node(screen, arguments.node, node, as_json=arguments.json)
