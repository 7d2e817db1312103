"""``coverage``: what of the host's hardware is usable, what is not and why."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.options import UsageError
from octoform.engine.coverage import report as engine
from octoform.views.coverage import report as coverage_view
from octoform.views.format import problems
from octoform.views.format.console import Console


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
        return coverage_view.show(screen, report, everything=arguments.all, as_json=arguments.json)
    from octoform.views.coverage.page import page  # the template engine is for who wants a page

    path = Path(arguments.html)
    problem = engine.save(path.absolute(), page(report))
    if problem is not None:
        return problems.show(screen, [problem], as_json=arguments.json)
    return coverage_view.written(screen, path, as_json=arguments.json)
