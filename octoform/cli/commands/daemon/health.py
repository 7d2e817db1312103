"""``health``: how the deployment is, in one word and one exit code."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.daemon.status import survey
from octoform.views.daemon.health import health
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """0 healthy, 3 degraded, 4 error, 5 down, 6 unknown; 1 where it cannot be told at all."""
    found, trouble = survey(project, os.environ)
    if found is None:
        return problems.show(screen, trouble, as_json=arguments.json)
    return health(screen, found, as_json=arguments.json)
