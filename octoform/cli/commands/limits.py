"""``limits``: the limits on calls and what is used of them; ``limits -reset TOOL`` forgets what was counted."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.guarding import limits, reset_limits
from octoform.views import guarding, problems
from octoform.views.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when a limit's counters are damaged, or a device is outside of a range."""
    if arguments.reset is not None:
        found = reset_limits(project, os.environ, arguments.reset)
        if found:
            return problems.show(screen, found, as_json=arguments.json)
        return guarding.reset(screen, arguments.reset, as_json=arguments.json)
    listed, found = limits(project, os.environ)
    if listed is None:
        return problems.show(screen, found, as_json=arguments.json)
    return guarding.limits(screen, listed, as_json=arguments.json)
