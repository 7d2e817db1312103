"""The main commands: init, validate, plan, apply, answer, destroy.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

from pathlib import Path

from octoform.cli.table import Json, UsageError, duration, flag, option, optional, repeated, setting

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence

    from octoform.cli.dispatch import Run
    from octoform.diagnostics import Diagnostic
    from octoform.engine.apply.apply import Options
    from octoform.engine.plan.plan import Request
    from octoform.engine.results import RunResult
    from octoform.plan.model import Plan


class InitArguments(Json):
    """Of ``init``."""

    host: str | None = option(
        str, "NAME", "the name of the host in the state (default: derived from this machine's name)"
    )


def run_init(arguments: InitArguments, run: Run) -> int:
    """Refuses to overwrite a manifest that is there."""
    from octoform.manifest.starter import start_project
    from octoform.views.format import output

    return run.answer(start_project(run.project, arguments.host), output.started)


def run_validate(_: Json, run: Run) -> int:
    """All problems at once; exit code 1 when one is an error."""
    from octoform.apply.stage.assignment import unpriced
    from octoform.diagnostics import as_warning
    from octoform.engine.plan.configuration import compile_project
    from octoform.harness import logins
    from octoform.views.format import output

    compiled, found = compile_project(*run.here)
    if compiled is not None:
        found += unpriced(compiled.manifest, run.environ)
        found += [as_warning(each) for each in logins.problems(compiled.manifest, run.environ)]
    return output.validation(run.screen, found, as_json=run.as_json)


class Scope(Json):
    """What plan and apply have in common."""

    target: list[str] = repeated("NODE", "only NODE and the nodes that it needs; may be given more than once")
    replace: list[str] = repeated("NODE", "create NODE again although nothing changed; may be given more than once")
    no_reuse: bool = flag("run every agent; do not reuse the accepted output of another host")
    tier1: bool = flag("without profiles and answers, as if no person had described the hardware")

    @property
    def narrowed(self) -> bool:
        """Whether one of them was given."""
        return bool(self.target or self.replace or self.no_reuse or self.tier1)

    def request(self, run: Run, *, destroy: bool = False) -> Request:
        """The plan that is wanted."""
        from octoform.engine.plan.plan import Request  # the one heavy import that the memo saves

        chosen = tuple(self.target), tuple(self.replace)
        return Request(*run.here, *chosen, destroy=destroy, reuse=not self.no_reuse, tier1=self.tier1)


class PlanArguments(Scope):
    """Of ``plan``."""

    out: str | None = option(str, "FILE", "save the plan, for `apply FILE`")
    detailed_exitcode: bool = flag("exit with 2 when there are changes")
    destroy: bool = flag("plan the removal of everything that apply created")


def run_plan(arguments: PlanArguments, run: Run) -> int:
    """Show what would change, and change nothing."""
    from octoform.engine.plan import memo

    usual = not (arguments.narrowed or arguments.out or arguments.destroy)
    remembered = memo.recall(*run.here) if usual else None
    if remembered is not None:
        return _show(arguments, run, remembered.plan, remembered.diagnostics)
    from octoform.engine.plan.plan import make_plan

    path = Path(arguments.out).absolute() if arguments.out else None
    result = make_plan(arguments.request(run, destroy=arguments.destroy), path)
    return _show(arguments, run, result.plan, result.diagnostics, arguments.out if result.saved_as else None)


def _show(
    arguments: PlanArguments, run: Run, plan: Plan | None, found: Sequence[Diagnostic], saved_as: str | None = None
) -> int:
    from octoform.views.format.output import JsonStream
    from octoform.views.plan import PlanHuman, PlanJson

    stream = JsonStream(run.screen) if run.as_json else None
    status = 0 if plan is None and stream is not None else run.note(*found)
    if stream is not None:
        stream.diagnostics(tuple(found))
    if plan is None:
        return 1
    (PlanHuman(run.screen) if stream is None else PlanJson(stream)).show(plan, saved_as)
    return max(status, 2 if arguments.detailed_exitcode and not plan.empty else 0)


class Consent(Json):
    """What the commands that carry out have in common."""

    auto_approve: bool = flag("do not ask")
    lock_timeout: float = setting(
        duration, "DURATION", "wait up to DURATION for the state's lock, such as 30s", default="0s"
    )

    def options(self, planfile: str | None = None) -> Options:
        """How the engine carries it out."""
        from octoform.engine.apply.apply import Options

        path = Path(planfile).absolute() if planfile else None
        return Options(approved=self.auto_approve, lock_seconds=self.lock_timeout, planfile=path)


class ApplyArguments(Scope, Consent):
    """Of ``apply``."""

    planfile: str | None = optional("PLANFILE", "a plan saved with `plan -out`")
    ask: bool = flag("on a terminal: ask about each unknown device, then plan and apply once more")


def run_apply(arguments: ApplyArguments, run: Run) -> int:
    """Apply the host of this folder."""
    if arguments.planfile and arguments.narrowed:
        text = "a saved plan has its own -target, -replace, -no-reuse and -tier1; make a new plan to change them"
        raise UsageError(text)
    if arguments.ask and (arguments.planfile or arguments.tier1):
        raise UsageError("-ask plans again with the answers; it cannot be used with a saved plan or -tier1")
    if arguments.ask and (run.as_json or not run.screen.interactive):
        from octoform.diagnostics import error

        hint = 'omit -ask; `octoform answer DEVICE "..."` answers without a terminal'
        return run.show(
            error("APPLY-ASK-NO-TERMINAL", "-ask needs a terminal with a person; nothing was done", hint=hint)
        )
    if not arguments.ask:
        return _execute(run, arguments.request(run), arguments.options(arguments.planfile))
    # Apply, ask about what is still unknown, apply what the answers change.
    from octoform.engine.questions import apply_asking
    from octoform.views.questions import AskingHuman

    return _status_of(apply_asking(arguments.request(run), arguments.options(), AskingHuman(run.screen)))


def run_destroy(arguments: Consent, run: Run) -> int:
    """Destroy the host of this folder, last node first."""
    from octoform.engine.plan.plan import Request

    return _execute(run, Request(*run.here, destroy=True), arguments.options())


def _execute(run: Run, request: Request, options: Options) -> int:
    """Run an apply or a destroy and show it; for the exit code see `_status_of`."""
    from octoform.engine.apply.apply import apply as carry_out
    from octoform.views.apply import RunHuman, RunJson
    from octoform.views.format.output import JsonStream

    view = RunJson(JsonStream(run.screen)) if run.as_json else RunHuman(run.screen)
    return _status_of(carry_out(request, options, view))


def _status_of(result: RunResult) -> int:
    """1 when something failed or was refused, 3 (degraded) when devices are closed to this user, else 0."""
    if result.failed or not (result.incomplete or result.silent):
        return int(bool(result.failed))
    # Imported here: it is seldom needed, and loads half of the daemon.
    from octoform.base.health_status import Status
    from octoform.views.daemon.event_log import EXIT

    return EXIT[Status.DEGRADED]


class AnswerArguments(Json):
    """Of ``answer``."""

    device: str | None = optional("DEVICE", "the device's id, as plan shows it")
    sentence: str | None = optional("SENTENCE", "what it is (default: ask on the terminal)")
    remove: bool = flag("remove the answer about DEVICE")


def run_answer(arguments: AnswerArguments, run: Run) -> int:
    """Exit code 1 when the manifest was to be changed and was not."""
    from octoform.engine import questions
    from octoform.views import questions as view

    device, sentence = arguments.device, arguments.sentence
    if arguments.remove and (device is None or sentence is not None):
        raise UsageError("-remove takes back the answer about one DEVICE")
    if device is None:
        return run.answer(questions.asked(*run.here), view.listed)
    if arguments.remove:
        return run.answer(questions.take_back(*run.here, device), view.changed)
    if sentence is None:
        return _ask(device, run)
    return run.answer(questions.answer(*run.here, device, sentence), view.changed)


def _ask(device: str, run: Run) -> int:
    """The sentence from the terminal."""
    from octoform.diagnostics import error
    from octoform.engine import questions
    from octoform.views import questions as view

    if run.as_json or not run.screen.interactive:
        hint = f'give it as an argument: octoform answer {device} "..."'
        text = "there is no sentence, and no terminal to ask for one"
        return run.show(error("ANSWER-NO-SENTENCE", text, hint=hint))
    known, found = questions.asked(*run.here)
    if known is None:
        return run.show(*found)
    sentence = ""
    if device in known.devices:
        sentence = view.ask(run.screen, known.about(device), device)
        if not sentence:
            return view.passed_over(run.screen)
    return run.answer(questions.answer(*run.here, device, sentence), view.changed)
