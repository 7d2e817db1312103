"""``plan``: the memo answers when nothing has moved; otherwise everything is compiled and compared."""

import os
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from octoform.diagnostics import Diagnostic
from octoform.engine.plan import cache
from octoform.plan.model import Plan
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.format.output import JsonStream
from octoform.views.plan.plan import PlanHuman, PlanJson


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Show what would change, and change nothing."""
    more = ("target", "replace", "out", "destroy", "no_reuse", "tier1")
    usual = not any(getattr(arguments, name) for name in more)
    remembered = cache.recall(project, os.environ) if usual else None
    return _show(arguments, screen, remembered) if remembered is not None else _compile(arguments, project, screen)


def _compile(arguments: Namespace, project: Path, screen: Console) -> int:
    from octoform.engine.plan.plan import Request, make_plan  # the one heavy import that the memo saves

    targets, replace = tuple(arguments.target), tuple(arguments.replace)
    how = {"destroy": arguments.destroy, "reuse": not arguments.no_reuse, "tier1": arguments.tier1}
    request = Request(project, os.environ, targets, replace, **how)
    result = make_plan(request, Path(arguments.out).absolute() if arguments.out else None)
    if result.plan is None and arguments.json:
        JsonStream(screen).diagnostics(result.diagnostics)
        return 1
    status = problems.show(screen, result.diagnostics)
    if result.plan is None:
        return 1
    return max(
        status, _show(arguments, screen, result.plan, arguments.out if result.saved_as else None, result.diagnostics)
    )


def _show(
    arguments: Namespace,
    screen: Console,
    found: Plan,
    saved_as: str | None = None,
    diagnostics: Sequence[Diagnostic] = (),
) -> int:
    if arguments.json:
        stream = JsonStream(screen)
        stream.diagnostics(tuple(diagnostics))
        PlanJson(stream).show(found, saved_as)
    else:
        PlanHuman(screen).show(found, saved_as)
    return 2 if arguments.detailed_exitcode and not found.empty else 0
