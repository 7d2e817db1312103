"""``pause``: let the daemon repair nothing until ``resume``."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.daemon.observe.clock import SystemClock
from octoform.daemon.store import instance_lock
from octoform.engine.tools import layout_of
from octoform.views.daemon import control
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 when repairs are paused, also where no daemon runs yet."""
    layout, found = layout_of(project, os.environ)
    if layout is None:
        return problems.show(screen, found, as_json=arguments.json)
    if problem := instance_lock.pause(layout, SystemClock().stamp()):
        return problems.show(screen, [problem], as_json=arguments.json)
    return control.paused(screen, layout.host, instance_lock.alive(layout), as_json=arguments.json)
