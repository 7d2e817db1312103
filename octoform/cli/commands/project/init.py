"""``init``: write a commented octopus.yaml for this host."""

from argparse import Namespace
from pathlib import Path

from octoform.engine.init import start_project
from octoform.views.format import output, problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Refuses to overwrite a manifest that is there."""
    started, found = start_project(project, arguments.host)
    if started is None:
        return problems.show(screen, found, as_json=arguments.json)
    return output.started(screen, started, as_json=arguments.json)
