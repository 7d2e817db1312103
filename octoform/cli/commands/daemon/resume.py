"""``resume``: let the daemon repair again."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.daemon.store import instance_lock
from octoform.engine.tools import layout_of
from octoform.views.daemon import control
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 when repairs are not paused any more."""
    layout, found = layout_of(project, os.environ)
    if layout is None:
        return problems.show(screen, found, as_json=arguments.json)
    was, problem = instance_lock.resume(layout)
    if problem is not None:
        return problems.show(screen, [problem], as_json=arguments.json)
    return control.resumed(screen, layout.host, instance_lock.alive(layout), was=was, as_json=arguments.json)
