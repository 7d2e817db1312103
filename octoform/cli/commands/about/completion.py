"""``completion``: a script for the shell that completes commands, verbs and options."""

from argparse import Namespace
from pathlib import Path

from octoform.cli.completion import script
from octoform.views.format.console import Console


def run(arguments: Namespace, _: Path, screen: Console) -> int:
    """Prints the script; exit code 0."""
    screen.line(script(arguments.shell))
    return 0
