"""``show``: the state, or a saved plan."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.inspect.state import open_project, saved_plan
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.format.output import JsonStream
from octoform.views.inspect import state
from octoform.views.plan.plan import PlanHuman, PlanJson


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Show it; nothing is compared and nothing is changed."""
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
