"""Apply: plan under the lock, show, ask, do, record. (Heavy.)"""

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from octoform.apply.context import Clock, Context, Tally
from octoform.apply.destroy import destroy
from octoform.apply.executor import execute
from octoform.diagnostics import Diagnostic, Severity, error, has_errors
from octoform.endpoint.environment.early_build import prewarmed
from octoform.endpoint.process import desired_state
from octoform.engine.apply import approval, summary
from octoform.engine.apply.commit import commit_run
from octoform.engine.apply.execution_log import logging_to
from octoform.engine.apply.saved_plan import SavedRun, read_saved
from octoform.engine.apply.session import Locked, Means, Refused, context_of, locked, opened
from octoform.engine.plan import cache as plan_cache
from octoform.engine.plan import device_knowledge
from octoform.engine.plan.configuration import Compiled, source_files
from octoform.engine.plan.plan import Outlook, Request, prepare
from octoform.engine.plan.prices import calling, unpriced
from octoform.engine.plan.refresh import read_artifacts
from octoform.engine.ports import RunView
from octoform.engine.results import RunResult, RunUsage
from octoform.events import Event, Notice
from octoform.harness import logins
from octoform.harness.orphans import sweep
from octoform.plan.model import Plan
from octoform.state.artifacts import reusable
from octoform.state.artifacts.accepted import observe
from octoform.state.artifacts.cache import keep_accepted
from octoform.state.files import write_atomic
from octoform.state.git.repository import repository_facts
from octoform.state.layout import STEP, Layout
from octoform.state.model import GitRecord
from octoform.state.store.store import Context as RunFacts
from octoform.state.store.store import Ports, StateStore

_SERVING = ("deploy", "endpoint")
"""The nodes that start the endpoint, as every privileged step does."""


@dataclass(frozen=True, slots=True)
class Options:
    """How a run is carried out; ``planfile`` is a saved plan to obey, ``ports`` are the state's crash points.

    ``consent`` decides in a person's place, with all that the plan was made from before it.
    """

    approved: bool = False
    consent: Callable[[Outlook], bool] | None = None
    lock_seconds: float = 0.0
    planfile: Path | None = None
    clock: Clock = field(default_factory=Clock)
    ports: Ports = field(default_factory=Ports)


def apply(request: Request, options: Options, view: RunView) -> RunResult:
    """Run the apply; the result tells how it ended, and the view has shown it."""
    result = _locked(request, options, view)
    if result.failed is None:
        result = _rounded(request, result)
    view.ended(result)
    return result


def _rounded(request: Request, result: RunResult) -> RunResult:
    """The result with what lies outside of this host's folders: rights, a tunnel, entries of clients that are left."""
    layout = Layout(request.project, result.host)
    if not request.destroy:
        return summary.outside(layout, summary.rights(layout, result, request.environ))
    from octoform.engine.clients import left_behind  # only a destroy pays for it

    return replace(result, diagnostics=(*result.diagnostics, *left_behind(layout, request.environ)))


def _locked(request: Request, options: Options, view: RunView) -> RunResult:
    """Everything under the lock of the host's state."""
    operation = "destroy" if request.destroy else "apply"
    blank = RunResult(operation, "")
    with locked(request.project, request.environ, operation, options.lock_seconds) as held:
        if isinstance(held, Refused):
            return replace(blank, host=held.host, failed=held.failed, diagnostics=held.diagnostics)
        return _planned(request, options, view, held)


def _planned(request: Request, options: Options, view: RunView, held: Locked) -> RunResult:
    started = options.clock.monotonic()
    compiled = held.compiled
    blank = RunResult("destroy" if request.destroy else "apply", compiled.layout.host)
    there = opened(compiled, options.ports)
    if isinstance(there, Refused):
        return replace(blank, failed=there.failed, diagnostics=there.diagnostics)
    store, notices = there.store, (*held.notices, *there.undone, *there.finished)
    saved, problems = read_saved(options.planfile, compiled)
    if problems:
        return replace(blank, failed="plan", diagnostics=tuple(problems))
    outlook, found = prepare(saved.request(request) if saved else request, store)
    if outlook is None:
        return replace(blank, failed="plan", diagnostics=tuple(found))
    missing = [] if request.destroy else _missing(outlook, request.environ)
    if has_errors(missing):
        return replace(blank, failed="plan", diagnostics=(*found, *missing))
    refused = saved.check(outlook) if saved else ()
    shown = saved.plan if saved else outlook.plan
    view.plan(shown)
    if not shown.empty and not (options.approved or saved) and not _approved(options, outlook, view):
        hint = "say yes on a terminal, or use -auto-approve"
        declined = error("APPLY-NOT-APPROVED", f"{blank.operation} was not approved; nothing was done", hint=hint)
        return replace(blank, failed="approval", diagnostics=(declined,))
    if not request.destroy and any(item.node in _SERVING or item.node.startswith(STEP) for item in shown.work):
        desired_state.unmark(compiled.layout)
    run = _Run(request, options, view, outlook, store)
    try:
        tally = run.carry_out(shown, saved, notices)
    except KeyboardInterrupt:
        # An orderly stop closes the journal. Where that fails, the journal stays, and the next run folds it in.
        store.commit_snapshot()
        raise
    result = run.record(shown, tally, options.clock.monotonic() - started)
    return replace(
        result,
        diagnostics=(*outlook.diagnostics, *missing, *result.diagnostics, *refused),
        failed=result.failed or ("saved plan" if refused else None),
        refused=tuple(sorted(saved.stale)) if saved else (),
    )


def _missing(outlook: Outlook, environ: Mapping[str, str]) -> list[Diagnostic]:
    """What the agents of a run lack before any of them is started: a price, a login."""
    manifest, plan = outlook.compiled.manifest, outlook.plan
    return [*unpriced(manifest, environ, plan), *logins.problems(manifest, environ, calling(plan))]


def _approved(options: Options, outlook: Outlook, view: RunView) -> bool:
    return view.approve() if options.consent is None else options.consent(outlook)


@dataclass(frozen=True, slots=True)
class _Run:
    """One approved run."""

    request: Request
    options: Options
    view: RunView
    outlook: Outlook
    store: StateStore

    def carry_out(self, plan: Plan, saved: SavedRun | None, notices: tuple[str, ...]) -> Tally:
        """Do the plan's work while the view watches."""
        allowed: Callable[[str], bool] = saved.allows if saved else lambda _: True
        layout = self.outlook.compiled.layout
        if plan.empty and not notices:
            return Tally()
        with self.view.watching() as show, logging_to(layout.call_log, self.options.clock, show) as emit:
            for text in (*notices, *_swept(layout.attempts)):
                emit(Notice("", text))
            context = self._context(emit)
            if self.request.destroy:
                return destroy(context, plan)
            serves = any(item.node == "serve" and allowed("serve") for item in plan.work)
            with prewarmed(layout) if serves else nullcontext():
                return execute(context, plan, allowed)

    def _context(self, emit: Callable[[Event], None]) -> Context:
        compiled, request, options = self.outlook.compiled, self.request, self.options
        donating = cache(partial(reusable.find, compiled.layout)) if request.reuse else dict
        means = Means(request.environ, emit, options.clock, options.ports.checkpoint, donating)
        return context_of(compiled, self.outlook.situation, self.store, means)

    def record(self, plan: Plan, tally: Tally, seconds: float) -> RunResult:
        """The snapshot, the commit, the memo, and the result."""
        compiled = self.outlook.compiled
        found: list[Diagnostic] = [*tally.diagnostics]
        facts, more = repository_facts(compiled.layout.project, source_files(compiled))
        found += more
        git = GitRecord(revision=facts.revision, dirty=list(facts.dirty)) if facts else None
        written = self.store.commit_snapshot(RunFacts(compiled.manifest.digest, git, self.outlook.plan.tier1))
        failed = tally.failed or ("state" if has_errors(written) else None)
        found += written
        commit = None
        if compiled.manifest.git.commit and not has_errors(found) and not plan.empty:
            commit, more = commit_run(compiled.layout, self.store.snapshot, plan.operation)
            found += more
            failed = "commit" if has_errors(more) else failed
        self._remember(tally)
        files = {stage: facts.digest for stage, facts in observe(compiled.layout).items()}
        found += self._keep()
        if failed is None and not self.request.destroy and not self.request.targets:
            approval.withdraw(compiled.layout)
        artifacts = read_artifacts(compiled, self.store.snapshot, files)
        return RunResult(
            operation=plan.operation,
            host=plan.host,
            added=tally.added,
            changed=tally.changed,
            alike=tally.alike,
            destroyed=tally.destroyed,
            agent_runs=tally.agent_runs,
            usage=RunUsage(**asdict(tally.usage)),
            seconds=seconds,
            failed=failed,
            diagnostics=tuple([*found, *self._offers(artifacts)]),
            funnel=None if self.request.destroy else summary.funnel(artifacts),
            questions=() if self.request.destroy else device_knowledge.questions(artifacts, compiled.manifest.answers),
            endpoint=None if self.request.destroy or failed else summary.endpoint(compiled.layout, artifacts),
            commit=commit,
        )

    def _offers(self, artifacts: Mapping[str, Any]) -> list[Diagnostic]:
        """Shipped profiles that match what this run found; what the plan said already is not repeated."""
        if self.request.destroy or any(item.code == device_knowledge.OFFERED for item in self.outlook.diagnostics):
            return []
        return device_knowledge.offers(artifacts, self.outlook.compiled)

    def _keep(self) -> list[Diagnostic]:
        """Copies of what was accepted; a run without room for them has done its work all the same, and says so."""
        if self.request.destroy:
            return []
        accepted = {name: node.file_digest for name, node in self.store.snapshot.nodes.items()}
        problem = keep_accepted(self.outlook.compiled.layout, accepted)
        return [] if problem is None else [replace(problem, severity=Severity.WARNING)]

    def _remember(self, tally: Tally) -> None:
        """Keep the memo when nothing is left to do; drop it when something is."""
        request = Request(self.request.project, self.request.environ)
        path, ground = plan_cache.path_of(request.project), self._ground(self.outlook.compiled)
        outlook = None if tally.failed or self.request.destroy else prepare(request)[0]
        # A manifest that was edited meanwhile may name other files and variables than those that were looked at.
        same = outlook is not None and _sources(outlook.compiled) == _sources(self.outlook.compiled)
        if outlook is None or not outlook.plan.empty or not same or _has_strays(outlook):
            path.unlink(missing_ok=True)
        else:
            write_atomic(path, plan_cache.document(outlook.plan, ground), 0o600)

    def _ground(self, compiled: Compiled) -> dict[str, Any]:
        files, chosen = _sources(compiled)
        return plan_cache.rests_on(self.request.project, compiled.layout.host, files, chosen, self.request.environ)


def _has_strays(outlook: Outlook) -> bool:
    """Whether there is something to say that a plan from the memo would not say."""
    return any(item.code in (device_knowledge.STRAY, device_knowledge.OFFERED) for item in outlook.diagnostics)


def _sources(compiled: Compiled) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The files and the environment variables that a compiled project was read from."""
    return tuple(str(path) for path in source_files(compiled)), compiled.manifest.variables


def _swept(attempts: Path) -> tuple[str, ...]:
    """End what a killed run left running, as far as it is provably ours."""
    swept = sweep(attempts)
    if not swept.ended:
        return ()
    return (f"ended {len(swept.ended)} processes that an interrupted run had left behind",)
