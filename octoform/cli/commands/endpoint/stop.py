"""``stop``: the endpoint's process, and nothing else."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.endpoint_process import stop
from octoform.views.endpoint import process
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 when no process of the endpoint is left."""
    done, found = stop(project, os.environ, arguments.host)
    if done is None:
        return problems.show(screen, found, as_json=arguments.json)
    return process.stopped(screen, done, as_json=arguments.json)
