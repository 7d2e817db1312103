"""``destroy``: remove what apply made for this host."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.commands.run.apply import execute
from octoform.engine.plan.plan import Request
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Destroy the host of this folder, last node first."""
    return execute(arguments, screen, Request(project, os.environ, destroy=True))
