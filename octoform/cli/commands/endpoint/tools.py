"""``tools``: what the live endpoint offers."""

import os
from argparse import Namespace
from functools import partial
from pathlib import Path

from octoform.engine.tools import tools
from octoform.views.endpoint import tools as tools_view
from octoform.views.endpoint.tools import starting
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Asks the endpoint itself, not a file."""
    listed, found = tools(project, os.environ, partial(starting, screen), revive=arguments.start)
    if listed is None:
        return problems.show(screen, found, as_json=arguments.json)
    return tools_view.tools(screen, listed, as_json=arguments.json)
