"""``heal``: let the daemon look now, or make one round where none runs; with ``-retry`` what was given up as well."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.watch_command import watched
from octoform.daemon.requests import daemon_of, given_up, retry
from octoform.engine.tools import layout_of
from octoform.views.daemon import control
from octoform.views.daemon.event_log import Lines, Silence
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """0 when a daemon was asked; of a round that was made here the exit codes of ``health``."""
    layout, found = layout_of(project, os.environ)
    if layout is None:
        return problems.show(screen, found, as_json=arguments.json)
    known = given_up(layout)
    retried, problem = retry(layout, known, arguments.retry)
    if problem is not None:
        return problems.show(screen, [problem], as_json=arguments.json)
    daemon = daemon_of(layout)
    if daemon is not None:
        return control.asked(screen, daemon, known, retried, as_json=arguments.json)
    view = Silence() if arguments.json else Lines(screen)
    code, status = watched(project, screen, view, once=True, as_json=arguments.json)
    if status is not None:
        control.healed(screen, given_up(layout), retried, str(status), as_json=arguments.json)
    return code
