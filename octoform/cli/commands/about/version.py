"""``version``: which octoform this is."""

from argparse import Namespace
from pathlib import Path

from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, _: Path, screen: Console) -> int:
    """Exit code 0."""
    return problems.version(screen, as_json=arguments.json)
