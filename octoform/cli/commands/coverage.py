"""``coverage``: what of the host's hardware is usable, what is not and why."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.options import UsageError
from octoform.engine import covering as engine
from octoform.views import coverage, problems
from octoform.views.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """The report, on the terminal or as a page; reads only, but for the page."""
    if arguments.html == "":
        raise UsageError("-html: give the file that the page should be written to", "")
    report, found = engine.report(project, os.environ)
    if report is None:
        return problems.show(screen, found, as_json=arguments.json)
    if not arguments.json:
        problems.show(screen, found)
    if arguments.html is None:
        return coverage.show(screen, report, everything=arguments.all, as_json=arguments.json)
    from octoform.views.coverage_page import page  # the template engine is for who wants a page

    path = Path(arguments.html)
    problem = engine.save(path.absolute(), page(report))
    if problem is not None:
        return problems.show(screen, [problem], as_json=arguments.json)
    return coverage.written(screen, path, as_json=arguments.json)
