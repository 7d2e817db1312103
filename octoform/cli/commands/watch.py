"""``watch``: keep the deployment alive in the foreground; ``-once`` for one round."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.daemon.watching import watch
from octoform.views import problems
from octoform.views.console import Console
from octoform.views.watching import EXIT, Lines, Objects


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """That of the signal which ended it; with ``-once`` the exit codes of ``health``."""
    view = Objects(screen) if arguments.json or not screen.out.isatty() else Lines(screen)
    try:
        done, found = watch(project, os.environ, view, arguments.once)
    finally:
        view.end()
    if done is None:
        return problems.show(screen, found, as_json=arguments.json)
    if done.signal is not None:
        return 128 + done.signal
    health = done.last.health if done.last is not None else None
    return EXIT[health.status] if health is not None else 1
