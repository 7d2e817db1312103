"""``version``: which octoform this is."""

from argparse import Namespace
from pathlib import Path

from octoform.views import problems
from octoform.views.console import Console


def run(arguments: Namespace, _: Path, screen: Console) -> int:
    """Exit code 0."""
    return problems.version(screen, as_json=arguments.json)
