"""``limits``: the limits on calls and what is used of them; ``limits -reset TOOL`` forgets what was counted."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.safety import limits, reset_limits
from octoform.views.endpoint import safety
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when a limit's counters are damaged, or a device is outside of a range."""
    if arguments.reset is not None:
        found = reset_limits(project, os.environ, arguments.reset)
        if found:
            return problems.show(screen, found, as_json=arguments.json)
        return safety.reset(screen, arguments.reset, as_json=arguments.json)
    listed, found = limits(project, os.environ)
    if listed is None:
        return problems.show(screen, found, as_json=arguments.json)
    return safety.limits(screen, listed, as_json=arguments.json)
