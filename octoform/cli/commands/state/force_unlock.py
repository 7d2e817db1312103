"""``force-unlock``: remove the lock of a run that is known to be gone."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.inspect.state import unlock
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.inspect import state


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Needs the lock's id, which a refused run has printed."""
    status = problems.show(screen, unlock(project, os.environ, arguments.lock_id))
    return status or state.unlocked(screen, arguments.lock_id)
