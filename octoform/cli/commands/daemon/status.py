"""``status``: in sync or not, how the deployment is, and what runs."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.daemon.status import survey
from octoform.engine.status import status
from octoform.views.daemon import status as status_view
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """0 only in sync and healthy; 3 to 6 as ``health`` leaves; 1 out of sync, or where it cannot be told at all."""
    found = status(project, os.environ)
    if found.sync is None:
        return problems.show(screen, found.diagnostics, as_json=arguments.json)
    surveyed, trouble = survey(project, os.environ)
    if surveyed is None:
        return problems.show(screen, trouble, as_json=arguments.json)
    return status_view.status(screen, found, surveyed, as_json=arguments.json)
