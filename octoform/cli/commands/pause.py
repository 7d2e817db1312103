"""``pause``: let the daemon repair nothing until ``resume``."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.daemon.records import ownership
from octoform.daemon.sensing.moments import SystemClock
from octoform.engine.serving import layout_of
from octoform.views.daemon import control
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 when repairs are paused, also where no daemon runs yet."""
    layout, found = layout_of(project, os.environ)
    if layout is None:
        return problems.show(screen, found, as_json=arguments.json)
    if problem := ownership.pause(layout, SystemClock().stamp()):
        return problems.show(screen, [problem], as_json=arguments.json)
    return control.paused(screen, layout.host, ownership.alive(layout), as_json=arguments.json)
