"""``help``: the commands, or the options of one."""

from argparse import Namespace
from pathlib import Path

from octoform.cli.parser import parse
from octoform.views.format.console import Console


def run(arguments: Namespace, _: Path, __: Console) -> int:
    """Prints what ``octoform COMMAND --help`` prints."""
    try:
        parse([*arguments.words, "--help"])
    except SystemExit:  # how argparse ends after its help
        return 0
    return 1
