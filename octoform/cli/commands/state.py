"""Commands on what was accepted: show, devices, coverage, nodes, the lock.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.parser import UsageError
from octoform.views.format import problems
from octoform.views.format.console import Console


def run_show(arguments: Namespace, project: Path, screen: Console) -> int:
    """Show it; nothing is compared and nothing is changed."""
    from octoform.engine.inspect.state import open_project, saved_plan
    from octoform.views import state
    from octoform.views.format.output import JsonStream
    from octoform.views.plan import PlanHuman, PlanJson

    if arguments.planfile:
        plan, found = saved_plan(Path(arguments.planfile).absolute())
        if plan is not None:
            (PlanJson(JsonStream(screen)) if arguments.json else PlanHuman(screen)).show(plan)
        return problems.show(screen, found)
    opened, found = open_project(project, os.environ)
    if opened is None:
        return problems.show(screen, found, as_json=arguments.json)
    problems.show(screen, found)
    return state.show(screen, opened.snapshot, as_json=arguments.json)


def run_state(arguments: Namespace, project: Path, screen: Console) -> int:
    """One of the four verbs; ``adopt`` verifies the artifact first."""
    from octoform.engine.inspect.state import accept, forget, node_of, open_project
    from octoform.views import state

    if arguments.verb == "adopt":
        status = problems.show(screen, accept(project, os.environ, arguments.node), as_json=arguments.json)
        return status or state.adopted(screen, arguments.node, as_json=arguments.json)
    if arguments.verb == "rm":
        status = problems.show(screen, forget(project, os.environ, arguments.node), as_json=arguments.json)
        return status or state.forgotten(screen, arguments.node, as_json=arguments.json)
    opened, found = open_project(project, os.environ)
    if opened is None:
        return problems.show(screen, found, as_json=arguments.json)
    if arguments.verb == "list":
        return state.listing(screen, opened.snapshot, as_json=arguments.json)
    node, found = node_of(opened.snapshot, arguments.node)
    if node is None:
        return problems.show(screen, found, as_json=arguments.json)
    return state.node(screen, arguments.node, node, as_json=arguments.json)


def run_devices(arguments: Namespace, project: Path, screen: Console) -> int:
    """Works without an endpoint; exit code 1 where no IDENTIFY artifact was accepted yet."""
    from octoform.engine.inspect.devices import listing
    from octoform.views import devices

    found, result = listing(project, os.environ)
    if found is None:
        return problems.show(screen, result, as_json=arguments.json)
    if not arguments.json:
        problems.show(screen, result)
    return devices.show(screen, found, as_json=arguments.json, verbose=arguments.v)


def run_coverage(arguments: Namespace, project: Path, screen: Console) -> int:
    """The report, on the terminal or as a page; reads only, but for the page."""
    from octoform.engine import coverage as engine
    from octoform.views import coverage as coverage_view

    if arguments.html == "":
        raise UsageError("-html: give the file that the page should be written to", "")
    report, found = engine.report(project, os.environ)
    if report is None:
        return problems.show(screen, found, as_json=arguments.json)
    if not arguments.json:
        problems.show(screen, found)
    if arguments.html is None:
        return coverage_view.show(screen, report, everything=arguments.all, as_json=arguments.json)
    path = Path(arguments.html)
    problem = engine.save(path.absolute(), coverage_view.page(report))
    if problem is not None:
        return problems.show(screen, [problem], as_json=arguments.json)
    return coverage_view.written(screen, path, as_json=arguments.json)


def run_force_unlock(arguments: Namespace, project: Path, screen: Console) -> int:
    """Needs the lock's id, which a refused run has printed."""
    from octoform.engine.inspect.state import unlock
    from octoform.views import state

    status = problems.show(screen, unlock(project, os.environ, arguments.lock_id))
    return status or state.unlocked(screen, arguments.lock_id)
