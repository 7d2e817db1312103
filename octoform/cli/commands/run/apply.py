"""``apply``: do what the plan says; with a plan file, exactly that plan."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.options import UsageError
from octoform.cli.parser import seconds
from octoform.daemon.model import Status
from octoform.diagnostics import error
from octoform.engine.apply.apply import Options
from octoform.engine.apply.apply import apply as carry_out
from octoform.engine.plan.plan import Request
from octoform.engine.results import RunResult
from octoform.views.daemon.event_log import EXIT
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.format.output import JsonStream
from octoform.views.run.apply import RunHuman, RunJson

USAGE = "usage: octoform apply [-json] [-lock-timeout DURATION] PLANFILE"


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Apply the host of this folder."""
    if arguments.planfile and (arguments.target or arguments.replace or arguments.no_reuse or arguments.tier1):
        text = "a saved plan has its own -target, -replace, -no-reuse and -tier1; make a new plan to change them"
        raise UsageError(text, USAGE)
    if arguments.ask and (arguments.planfile or arguments.tier1):
        raise UsageError("-ask goes on with what a person says; it goes with neither a saved plan nor -tier1", USAGE)
    if arguments.ask and (arguments.json or not screen.interactive):
        hint = 'leave out -ask; `octoform answer DEVICE "..."` answers without a terminal'
        nobody = error("APPLY-ASK-NO-TERMINAL", "-ask needs a terminal with a person; nothing was done", hint=hint)
        return problems.show(screen, [nobody], as_json=arguments.json)
    chosen = tuple(arguments.target), tuple(arguments.replace)
    request = Request(project, os.environ, *chosen, reuse=not arguments.no_reuse, tier1=arguments.tier1)
    return (
        _ask(arguments, screen, request) if arguments.ask else execute(arguments, screen, request, arguments.planfile)
    )


def _ask(arguments: Namespace, screen: Console, request: Request) -> int:
    """Apply, ask about what is still unknown, apply what the answers change."""
    from octoform.engine.questions import apply_asking
    from octoform.views.run.questions import AskingHuman

    return status_of(apply_asking(request, _options(arguments), AskingHuman(screen)))


def execute(arguments: Namespace, screen: Console, request: Request, planfile: str | None = None) -> int:
    """Run an apply or a destroy and show it; for the exit code see `status_of`."""
    view = RunJson(JsonStream(screen)) if arguments.json else RunHuman(screen)
    return status_of(carry_out(request, _options(arguments, planfile), view))


def status_of(result: RunResult) -> int:
    """1 when something failed or was refused, 3 (degraded) when devices are closed to this user, else 0."""
    return 1 if result.failed else EXIT[Status.DEGRADED] if result.incomplete or result.silent else 0


def _options(arguments: Namespace, planfile: str | None = None) -> Options:
    return Options(
        approved=arguments.auto_approve,
        lock_seconds=seconds(arguments.lock_timeout),
        planfile=Path(planfile).absolute() if planfile else None,
    )
