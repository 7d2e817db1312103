"""``audit``: what was allowed, refused, approved, stopped; ``audit -verify``: whether the log is as it was written."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.options import UsageError
from octoform.engine.guarding import check_records, records
from octoform.views import audit, guarding, problems
from octoform.views.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when something was done to the log."""
    if arguments.verify:
        checked, found = check_records(project, os.environ)
        if checked is None:
            return problems.show(screen, found, as_json=arguments.json)
        return guarding.checked(screen, checked, found, as_json=arguments.json)
    if not arguments.n.isascii() or not arguments.n.isdigit():
        raise UsageError(f"-n: {arguments.n!r} is no number of lines", "")
    count = int(arguments.n)
    latest, found = records(project, os.environ, count)
    if latest is None:
        return problems.show(screen, found, as_json=arguments.json)
    return audit.records(screen, latest, count, as_json=arguments.json)
