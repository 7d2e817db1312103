"""``devices``: what this host has, and where each device is attached now."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.inspect.devices import listing
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.inspect import devices


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Works without an endpoint; exit code 1 where no IDENTIFY artifact was accepted yet."""
    found, told = listing(project, os.environ)
    if found is None:
        return problems.show(screen, told, as_json=arguments.json)
    if not arguments.json:
        problems.show(screen, told)
    return devices.show(screen, found, as_json=arguments.json, verbose=arguments.v)
