"""Commands that plan and carry out: plan, apply, destroy, answer, attempts.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

import os
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from octoform.cli.parser import UsageError, seconds
from octoform.diagnostics import Diagnostic, did_you_mean, error, has_errors
from octoform.views.format import problems
from octoform.views.format.console import Console

if TYPE_CHECKING:
    from octoform.engine.apply.apply import Options
    from octoform.engine.plan.plan import Request
    from octoform.engine.results import RunResult
    from octoform.plan.model import Plan


def run_plan(arguments: Namespace, project: Path, screen: Console) -> int:
    """Show what would change, and change nothing."""
    from octoform.engine.plan import memo

    more = ("target", "replace", "out", "destroy", "no_reuse", "tier1")
    usual = not any(getattr(arguments, name) for name in more)
    remembered = memo.recall(project, os.environ) if usual else None
    if remembered is None:
        return _compile(arguments, project, screen)
    status = problems.show(screen, remembered.diagnostics)
    return max(status, _show(arguments, screen, remembered.plan, diagnostics=remembered.diagnostics))


def _compile(arguments: Namespace, project: Path, screen: Console) -> int:
    from octoform.engine.plan.plan import Request, make_plan  # the one heavy import that the memo saves
    from octoform.views.format.output import JsonStream

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
    from octoform.views.format.output import JsonStream
    from octoform.views.plan import PlanHuman, PlanJson

    if arguments.json:
        stream = JsonStream(screen)
        stream.diagnostics(tuple(diagnostics))
        PlanJson(stream).show(found, saved_as)
    else:
        PlanHuman(screen).show(found, saved_as)
    return 2 if arguments.detailed_exitcode and not found.empty else 0


USAGE = "usage: octoform apply [-json] [-lock-timeout DURATION] PLANFILE"


def run_apply(arguments: Namespace, project: Path, screen: Console) -> int:
    """Apply the host of this folder."""
    from octoform.engine.plan.plan import Request

    if arguments.planfile and (arguments.target or arguments.replace or arguments.no_reuse or arguments.tier1):
        text = "a saved plan has its own -target, -replace, -no-reuse and -tier1; make a new plan to change them"
        raise UsageError(text, USAGE)
    if arguments.ask and (arguments.planfile or arguments.tier1):
        raise UsageError("-ask plans again with the answers; it cannot be used with a saved plan or -tier1", USAGE)
    if arguments.ask and (arguments.json or not screen.interactive):
        hint = 'omit -ask; `octoform answer DEVICE "..."` answers without a terminal'
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
    from octoform.views.questions import AskingHuman

    return status_of(apply_asking(request, _options(arguments), AskingHuman(screen)))


def execute(arguments: Namespace, screen: Console, request: Request, planfile: str | None = None) -> int:
    """Run an apply or a destroy and show it; for the exit code see `status_of`."""
    from octoform.engine.apply.apply import apply as carry_out
    from octoform.views.apply import RunHuman, RunJson
    from octoform.views.format.output import JsonStream

    view = RunJson(JsonStream(screen)) if arguments.json else RunHuman(screen)
    return status_of(carry_out(request, _options(arguments, planfile), view))


def status_of(result: RunResult) -> int:
    """1 when something failed or was refused, 3 (degraded) when devices are closed to this user, else 0."""
    if result.failed or not (result.incomplete or result.silent):
        return int(bool(result.failed))
    # Imported here: it is seldom needed, and loads half of the daemon.
    from octoform.daemon.model import Status
    from octoform.views.daemon.event_log import EXIT

    return EXIT[Status.DEGRADED]


def _options(arguments: Namespace, planfile: str | None = None) -> Options:
    from octoform.engine.apply.apply import Options

    return Options(
        approved=arguments.auto_approve,
        lock_seconds=seconds(arguments.lock_timeout),
        planfile=Path(planfile).absolute() if planfile else None,
    )


def run_destroy(arguments: Namespace, project: Path, screen: Console) -> int:
    """Destroy the host of this folder, last node first."""
    from octoform.engine.plan.plan import Request

    return execute(arguments, screen, Request(project, os.environ, destroy=True))


ANSWER_USAGE = "usage: octoform answer [-json] [-remove] [DEVICE] [SENTENCE]"


def run_answer(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when the manifest was to be changed and was not."""
    from octoform.engine import questions
    from octoform.views import questions as views

    if arguments.remove and (arguments.device is None or arguments.sentence is not None):
        raise UsageError("-remove takes back the answer about one DEVICE", ANSWER_USAGE)
    if arguments.device is None:
        return _list(arguments, project, screen)
    if arguments.remove:
        result, found = questions.take_back(project, os.environ, arguments.device)
    else:
        sentence = arguments.sentence
        if sentence is None:
            return _answer_ask(arguments, project, screen)
        result, found = questions.answer(project, os.environ, arguments.device, sentence)
    if result is None:
        return problems.show(screen, found, as_json=arguments.json)
    return views.changed(screen, result, as_json=arguments.json)


def _list(arguments: Namespace, project: Path, screen: Console) -> int:
    from octoform.engine import questions
    from octoform.views import questions as views

    known, found = questions.asked(project, os.environ)
    if known is None:
        return problems.show(screen, found, as_json=arguments.json)
    return views.listed(screen, known, as_json=arguments.json)


def _answer_ask(arguments: Namespace, project: Path, screen: Console) -> int:
    """The sentence from the terminal."""
    from octoform.engine import questions
    from octoform.views import questions as views

    if arguments.json or not screen.interactive:
        hint = f'give it as an argument: octoform answer {arguments.device} "..."'
        missing = error("ANSWER-NO-SENTENCE", "there is no sentence, and no terminal to ask for one", hint=hint)
        return problems.show(screen, [missing], as_json=arguments.json)
    known, found = questions.asked(project, os.environ)
    if known is None:
        return problems.show(screen, found)
    sentence = ""
    if arguments.device in known.devices:
        sentence = views.ask(screen, known.about(arguments.device), arguments.device)
        if not sentence:
            return views.passed_over(screen)
    result, found = questions.answer(project, os.environ, arguments.device, sentence)
    return problems.show(screen, found) if result is None else views.changed(screen, result, as_json=False)


def run_attempts(arguments: Namespace, project: Path, screen: Console) -> int:
    """The list, or one of the two verbs."""
    from octoform.engine.inspect import attempts as engine
    from octoform.protocol.model import DUTIES
    from octoform.state.layout import STAGES, STEP
    from octoform.views import attempts

    if arguments.verb == "show":
        return _attempts_show(arguments, project, screen)
    if arguments.verb == "record":
        return _record(arguments, project, screen)
    stage = arguments.stage
    known = (*STAGES, *DUTIES)
    if stage is not None and stage not in known and not stage.startswith(STEP):
        near = did_you_mean(stage, known)
        raise UsageError(f"-stage: there is no stage {stage!r}" + (f"; did you mean {near}?" if near else ""), "")
    listed, found = engine.listed(project, os.environ, stage)
    if listed is None:
        return problems.show(screen, found, as_json=arguments.json)
    return attempts.listing(screen, listed, everything=arguments.all, as_json=arguments.json)


def _attempts_show(arguments: Namespace, project: Path, screen: Console) -> int:
    from octoform.engine.inspect import attempts as engine
    from octoform.views import attempts

    detail, found = engine.detail(project, os.environ, arguments.number)
    if detail is None:
        return problems.show(screen, found, as_json=arguments.json)
    return attempts.one(screen, detail, as_json=arguments.json)


def _record(arguments: Namespace, project: Path, screen: Console) -> int:
    from octoform.engine.recording import record
    from octoform.views import attempts

    made, found = record(project, os.environ, Path(arguments.folder).absolute(), arguments.first)
    if made is None or has_errors(found):
        return problems.show(screen, found, as_json=arguments.json)
    problems.show(screen, found)
    return attempts.recorded(screen, made, as_json=arguments.json)
