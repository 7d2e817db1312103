"""``watch``: keep the deployment alive in the foreground; ``-once`` for one round."""

from argparse import Namespace
from pathlib import Path

from octoform.cli.watch_command import watched
from octoform.views.daemon.event_log import Lines, Objects
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """That of the signal which ended it; with ``-once`` the exit codes of ``health``."""
    view = Objects(screen) if arguments.json or not screen.out.isatty() else Lines(screen)
    return watched(project, screen, view, once=arguments.once, as_json=arguments.json)[0]
