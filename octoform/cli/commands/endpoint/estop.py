"""``estop``: everything that moves, now; ``estop -clear`` lets it move again."""

from argparse import Namespace
from pathlib import Path

from octoform.engine.safety import clear, stop
from octoform.views.endpoint import safety
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 only when it is latched and every stop action was done; with -clear, when it is open."""
    done, found = clear(project) if arguments.clear else stop(project, arguments.reason or "")
    if not done:
        return problems.show(screen, found, as_json=arguments.json)
    if arguments.clear:
        return safety.cleared(screen, done, found, as_json=arguments.json)
    return safety.stopped(screen, done, found, as_json=arguments.json)
