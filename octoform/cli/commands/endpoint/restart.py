"""``restart``: end the endpoint's process and start another."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.endpoint_process import restart
from octoform.views.endpoint import process
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 when the endpoint runs again."""
    done, found = restart(project, os.environ)
    if done is None:
        return problems.show(screen, found, as_json=arguments.json)
    return process.started(screen, done, as_json=arguments.json)
