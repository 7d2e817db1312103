"""``status``: in sync or not, healthy or not, and what runs."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.daemon.records.ownership import alive
from octoform.engine.health import status
from octoform.engine.serving import layout_of
from octoform.views import health, problems
from octoform.views.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 only when the host is in sync and its endpoint answers."""
    found = status(project, os.environ)
    if found.sync is None:
        return problems.show(screen, found.diagnostics, as_json=arguments.json)
    layout, _ = layout_of(project, os.environ)
    return health.status(screen, found, alive(layout) if layout is not None else None, as_json=arguments.json)
