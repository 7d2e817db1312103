"""``heal``: let the daemon look now, or make one round where none runs; with ``-retry`` what was given up as well."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.daemon.asking import daemon_of, given_up, retry
from octoform.daemon.watching import watch
from octoform.engine.serving import layout_of
from octoform.views import keeping, problems
from octoform.views.console import Console
from octoform.views.watching import EXIT, Lines


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
        return keeping.asked(screen, daemon, known, retried, as_json=arguments.json)
    view = Lines(screen)
    try:
        done, found = watch(project, os.environ, (lambda _: None) if arguments.json else view, once=True)
    finally:
        view.end()
    if done is None:
        return problems.show(screen, found, as_json=arguments.json)
    if done.signal is not None:
        return 128 + done.signal
    health = done.last.health if done.last is not None else None
    status = str(health.status) if health is not None else "unknown"
    keeping.healed(screen, given_up(layout), retried, status, as_json=arguments.json)
    return EXIT[health.status] if health is not None else 1
