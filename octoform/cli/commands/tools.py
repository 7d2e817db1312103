"""``tools``: what the live endpoint offers."""

import os
from argparse import Namespace
from functools import partial
from pathlib import Path

from octoform.engine.serving import tools
from octoform.views import endpoint, problems
from octoform.views.calling import starting
from octoform.views.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Asks the endpoint itself, not a file."""
    listed, found = tools(project, os.environ, partial(starting, screen), revive=arguments.start)
    if listed is None:
        return problems.show(screen, found, as_json=arguments.json)
    return endpoint.tools(screen, listed, as_json=arguments.json)
