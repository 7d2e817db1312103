"""``apply``: do what the plan says; with a plan file, exactly that plan."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.options import UsageError
from octoform.cli.parser import seconds
from octoform.engine.applying import Options
from octoform.engine.applying import apply as carry_out
from octoform.engine.planning import Request
from octoform.views.apply import RunHuman
from octoform.views.apply_json import RunJson
from octoform.views.console import Console
from octoform.views.stream import JsonStream


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Apply the host of this folder."""
    if arguments.planfile and (arguments.target or arguments.replace or arguments.no_reuse):
        text = "a saved plan has its own -target, -replace and -no-reuse; make a new plan to change them"
        raise UsageError(text, "usage: octoform apply [-json] [-lock-timeout DURATION] PLANFILE")
    chosen = tuple(arguments.target), tuple(arguments.replace)
    request = Request(project, os.environ, *chosen, reuse=not arguments.no_reuse)
    return execute(arguments, screen, request, arguments.planfile)


def execute(arguments: Namespace, screen: Console, request: Request, planfile: str | None = None) -> int:
    """Run an apply or a destroy and show it; exit code 1 when something failed or was refused."""
    view = RunJson(JsonStream(screen)) if arguments.json else RunHuman(screen)
    options = Options(
        approved=arguments.auto_approve,
        lock_seconds=seconds(arguments.lock_timeout),
        planfile=Path(planfile).absolute() if planfile else None,
    )
    return 1 if carry_out(request, options, view).failed else 0
