"""``accept``: take a node's artifact as it is, when a person knows that only words changed."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.inspect.state import accept
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.inspect import state


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Verify the artifact and adopt it under today's key."""
    status = problems.show(screen, accept(project, os.environ, arguments.node), as_json=arguments.json)
    return status or state.adopted(screen, arguments.node, as_json=arguments.json)
