"""Apply: plan under the lock, show, ask, do, record. (Heavy.)"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from dataclasses import asdict
from functools import cache, partial
from pathlib import Path
from typing import Any

from octoform.apply.context import Clock, Context, Tally
from octoform.apply.destroy import destroy
from octoform.apply.executor import execute
from octoform.apply.stage.assignment import calling, unpriced
from octoform.base import files
from octoform.base.shape import fits
from octoform.diagnostics import Diagnostic, Severity, error, has_errors
from octoform.endpoint.access.tokens import listed
from octoform.endpoint.access.tunnel import no_tunnel, through, tunnel_opened
from octoform.endpoint.client.check_verdict import NOTHING_ANSWERS, tally
from octoform.endpoint.drift import observe as observe_endpoint
from octoform.endpoint.environment.build import prewarmed
from octoform.endpoint.expected_tools import display
from octoform.endpoint.process import record as desired_state
from octoform.engine.apply import approval
from octoform.engine.apply.session import HostRefused, Locked, Means, commit_run, context_of, locked, logging_to, opened
from octoform.engine.inspect.devices import diagnostics, lacking
from octoform.engine.plan import device_knowledge
from octoform.engine.plan import memo as plan_cache
from octoform.engine.plan.configuration import Compiled, source_files
from octoform.engine.plan.plan import Outlook, Request, prepare
from octoform.engine.plan.refresh import read_artifacts
from octoform.engine.results import EndpointSummary, Funnel, RunResult, RunUsage, RunView
from octoform.events import Event, Notice
from octoform.harness import logins
from octoform.harness.containment.orphans import sweep
from octoform.host import SYSROOT_VARIABLE
from octoform.plan import model, planfile
from octoform.plan.model import Plan
from octoform.records import dataclass, field, replace
from octoform.state import reusable
from octoform.state.accepted import observe
from octoform.state.artifact_cache import keep_accepted
from octoform.state.files import read_regular, write_atomic
from octoform.state.git_repository import repository_facts
from octoform.state.layout import STEP, Layout
from octoform.state.model import GitRecord
from octoform.state.store.store import Context as RunFacts
from octoform.state.store.store import Ports, StateStore

# A saved plan at apply: what it asked for, and which of its units may still be applied. (Heavy.)


@dataclass(slots=True)
class SavedRun:
    """One saved plan, being obeyed. ``stale`` and the units that may run are known after `check`."""

    document: planfile.PlanFile
    stale: frozenset[str] = frozenset()
    runnable: frozenset[str] = field(default_factory=frozenset)

    @property
    def plan(self) -> Plan:
        """The plan as it was shown when it was saved."""
        return model.from_json(self.document.plan)

    def request(self, request: Request) -> Request:
        """The request that the plan was made for."""
        targets = tuple(self.document.targets or ())
        document, again = self.document, tuple(self.document.replace)
        return replace(request, targets=targets, replace=again, reuse=document.reuse, tier1=document.tier1)

    def check(self, outlook: Outlook) -> tuple[Diagnostic, ...]:
        """Compare every unit with what is there now; the diagnostics name what moved."""
        situation, graph = outlook.situation, outlook.compiled.graph
        moved = planfile.moved(self.document, graph, situation.prior, situation.observed)
        before, now = self.document.lineage, outlook.plan.lineage
        if before is not None and before != now:
            moved += [planfile.Moved(unit, "lineage", before, now) for unit in self.document.units]
        self.stale = frozenset(item.unit for item in moved)
        self.runnable = planfile.applicable(self.document, graph, moved)
        return tuple(planfile.describe(item) for item in moved)

    def allows(self, node: str) -> bool:
        """Whether a unit may run."""
        return node in self.runnable


def read_saved(path: Path | None, compiled: Compiled) -> tuple[SavedRun | None, list[Diagnostic]]:
    """The saved plan at ``path``, for this host and lineage; None without diagnostics when there is no path."""
    if path is None:
        return None, []
    data, problem = read_regular(path)
    if data is None:
        return None, [planfile.unread(str(path), problem)]
    document, found = planfile.read(data, str(path))
    if document is None:
        return None, found
    if document.host != compiled.layout.host:
        text = f"the plan is for host {document.host}, this folder is host {compiled.layout.host}"
        return None, [error("PLAN-STALE", text, path=str(path), hint="make a plan for this host")]
    return SavedRun(document), []


# The summary at the end of a run: the funnel and the endpoint, read from the accepted artifacts.


def funnel(artifacts: Mapping[str, Any]) -> Funnel | None:
    """Counts from what is seen to what can be called; None before IDENTIFY was accepted."""
    probe, identify, interface = (artifacts.get(stage) for stage in ("probe", "identify", "interface"))
    if probe is None or identify is None:
        return None
    return Funnel(
        seen=len(probe["devices"]),
        annotated=len(identify["devices"]),
        unknown=sum(1 for device in identify["devices"] if device["category"] == "unknown"),
        left_out=len(probe["devices"]) - len(identify["devices"]),
        tools=len(interface["tools"]) if interface else 0,
    )


def endpoint(layout: Layout, artifacts: Mapping[str, Any]) -> EndpointSummary | None:
    """The endpoint as it was last checked; None when there is none."""
    interface = artifacts.get("interface")
    facts = observe_endpoint(layout)
    if interface is None or facts.reasons or facts.process is None:
        return None
    tools = display(layout, interface)["tools"]
    readers = [tool for tool in tools if tool["effect"] == "read"]
    calls = _sample_calls(layout)
    good = answering(calls)
    easy = [tool["name"] for tool in readers if not tool["input_schema"].get("required")]
    return EndpointSummary(
        command=f"octoform connect {layout.host}",
        scope=facts.process.scope,
        url=facts.process.url,
        tools=tuple(tool["name"] for tool in tools),
        answered=sample_answer(calls, good),
        token=next((token.name for token in listed(layout)[0] if not token.ended), None),
        denied=len(interface["tools"]) - len(tools),
        example=next((name for name in good if name in easy), easy[0] if easy else None),
    )


def answering(calls: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """The read tools none of whose calls failed; one that answered with nothing in it proves little and comes last."""
    failed = {call["tool"] for call in calls if not call.get("ok")}
    proven = {call["tool"] for call in calls if call.get("content", True)}
    ordered = sorted(calls, key=lambda call: call["tool"] not in proven)
    return {call["tool"]: call for call in ordered if call["tool"] not in failed}


def rights(layout: Layout, result: RunResult, environ: Mapping[str, str]) -> RunResult:
    """The result with each served device that this user may not use; its tools answer with an error until then.

    And with word of an endpoint most of whose read tools did not answer when they were tried.
    """
    recorded = environ.get(SYSROOT_VARIABLE) or ""
    silent = _silent(layout, result, bool(recorded)) if result.operation == "apply" else ""
    result = replace(result, silent=silent, recorded=recorded)
    shut = lacking(layout, environ)
    lines = (*result.diagnostics, *diagnostics(shut))
    return replace(result, diagnostics=lines, incomplete=tuple(sorted(shut))) if shut else result


def outside(layout: Layout, result: RunResult) -> RunResult:
    """The result with the address of the tunnel, or a warning that no one gets in there; waits until one is known."""
    found = result.endpoint
    tunnel = tunnel_opened(layout) if found is not None else None
    if found is None or tunnel is None:
        return result
    problem = no_tunnel(tunnel)
    if problem is not None:
        return replace(result, diagnostics=(*result.diagnostics, problem))
    return replace(result, endpoint=replace(found, public=through(tunnel, found.url or "")))


def _silent(layout: Layout, result: RunResult, recorded: bool) -> str:
    """A sentence when more than half of the read tools did not answer in this run's check; else empty.

    On a recorded host, whose devices cannot be opened, it states nothing about the deployment that some did not.
    """
    if any(item.code == NOTHING_ANSWERS for item in result.diagnostics):
        return "no read tool answered"
    calls = _sample_calls(layout) if not recorded and (result.added or result.changed) else []
    tried = {call["tool"] for call in calls if call.get("skipped") is None}
    failed = {call["tool"] for call in calls if call.get("skipped") is None and not call.get("ok")}
    return f"{len(failed)} of {len(tried)} read tools did not answer" if 2 * len(failed) > len(tried) else ""


_SAMPLE_CALL = {"tool": str, "ms": (None, float), "skipped": (None, str)}


def _sample_calls(layout: Layout) -> list[dict[str, Any]]:
    """The calls of the last check; empty when there was none."""
    path = layout.endpoint / "check.json"
    try:
        document = files.read_json(path)
    except (OSError, ValueError):
        return []  # the check's own verdict was reported already; only its calls are not to be had
    calls: list[dict[str, Any]] = document["calls"] if fits(document, {"calls": [_SAMPLE_CALL]}) else []
    return calls


def sample_answer(calls: list[dict[str, Any]], good: Mapping[str, dict[str, Any]]) -> str | None:
    """A read tool that answered in the last check, for the closing lines."""
    if not good:
        return None
    name, call = next(iter(good.items()))
    took = f" in {call['ms']:.0f} ms" if call.get("ms") is not None else ""
    tried = {call["tool"] for call in calls if call.get("skipped") is None}
    empty = good.keys() - {call["tool"] for call in calls if call.get("content", True)}
    return f"{name} answered{took}; {tally(good.keys(), tried, {call['tool'] for call in calls}, empty, 'did')}"


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
    """Run the apply; the result shows how it ended, and the view has shown it."""
    result = _locked(request, options, view)
    if result.failed is None:
        result = _rounded(request, result)
    view.ended(result)
    return result


def _rounded(request: Request, result: RunResult) -> RunResult:
    """The result with what lies outside of this host's folders: rights, a tunnel, entries of clients that are left."""
    layout = Layout(request.project, result.host)
    if not request.destroy:
        return outside(layout, rights(layout, result, request.environ))
    from octoform.engine.clients import left_behind  # only a destroy pays for it

    return replace(result, diagnostics=(*result.diagnostics, *left_behind(layout, request.environ)))


def _locked(request: Request, options: Options, view: RunView) -> RunResult:
    """Everything under the lock of the host's state."""
    operation = "destroy" if request.destroy else "apply"
    blank = RunResult(operation, "")
    with locked(request.project, request.environ, operation, options.lock_seconds) as held:
        if isinstance(held, HostRefused):
            return replace(blank, host=held.host, failed=held.failed, diagnostics=held.diagnostics)
        return _planned(request, options, view, held)


def _planned(request: Request, options: Options, view: RunView, held: Locked) -> RunResult:
    started = options.clock.monotonic()
    compiled = held.compiled
    blank = RunResult("destroy" if request.destroy else "apply", compiled.layout.host)
    there = opened(compiled, options.ports)
    if isinstance(there, HostRefused):
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
        hint = "confirm on a terminal, or use -auto-approve"
        declined = error("APPLY-NOT-APPROVED", f"{blank.operation} was not approved; nothing was done", hint=hint)
        return replace(blank, failed="approval", diagnostics=(declined,))
    if (
        not request.destroy
        and options.consent is None
        and any(item.node in _SERVING or item.node.startswith(STEP) for item in shown.work)
    ):
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
    """Diagnostics for agents that lack a price or a login, before any of them is started."""
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
            diagnostics=tuple([*found, *self._notices(artifacts), *self._uncovered(artifacts), *self._stopped(found)]),
            funnel=None if self.request.destroy else funnel(artifacts),
            questions=() if self.request.destroy else device_knowledge.questions(artifacts, compiled.manifest.answers),
            endpoint=None if self.request.destroy or failed else endpoint(compiled.layout, artifacts),
            commit=commit,
        )

    def _notices(self, artifacts: Mapping[str, Any]) -> list[Diagnostic]:
        """Profiles that match what this run found and that no one chose, and the other way round.

        What the plan reported already is not repeated.
        """
        if self.request.destroy:
            return []
        compiled, known = self.outlook.compiled, {(item.code, item.summary) for item in self.outlook.diagnostics}
        found = device_knowledge.unmatched(artifacts, compiled)
        if not any(code == device_knowledge.OFFERED for code, _ in known):
            found = [*device_knowledge.offers(artifacts, compiled), *found]
        return [item for item in found if (item.code, item.summary) not in known]

    def _stopped(self, found: Iterable[Diagnostic]) -> list[Diagnostic]:
        """That the endpoint does not run because a person stopped it, also meanwhile: a complete apply hides that.

        Where a stage ended by the stop, its error is the report of it.
        """
        reported = self.request.destroy or any(item.code == desired_state.STOPPED for item in found)
        stopped = None if reported else desired_state.refusal(self.outlook.compiled.layout)
        return [] if stopped is None else [replace(stopped, severity=Severity.WARNING)]

    def _uncovered(self, artifacts: Mapping[str, Any]) -> list[Diagnostic]:
        """The commands of a chosen profile that the accepted INTERFACE does not offer."""
        return [] if self.request.destroy else device_knowledge.uncovered(artifacts, self.outlook.compiled)

    def _keep(self) -> list[Diagnostic]:
        """Copies of what was accepted; a run without room for them has done its work all the same, and states that."""
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
        if outlook is None or not outlook.plan.empty or not same or _has_offers(outlook):
            path.unlink(missing_ok=True)
        else:
            found = tuple(item for item in outlook.diagnostics if item.code in _LASTING)
            write_atomic(path, plan_cache.document(plan_cache.Remembered(outlook.plan, found), ground), 0o600)

    def _ground(self, compiled: Compiled) -> dict[str, Any]:
        files, chosen = _sources(compiled)
        return plan_cache.rests_on(self.request.project, compiled.layout.host, files, chosen, self.request.environ)


_LASTING = (device_knowledge.STRAY, device_knowledge.UNMATCHED)
"""Diagnostics of a plan from the memo: it rests on the manifest and on what was accepted, as the memo does."""


def _has_offers(outlook: Outlook) -> bool:
    """Whether a profile is offered: that rests on those that come with octoform, which the memo does not look at."""
    return any(item.code == device_knowledge.OFFERED for item in outlook.diagnostics)


def _sources(compiled: Compiled) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The files and the environment variables that a compiled project was read from."""
    return tuple(str(path) for path in source_files(compiled)), compiled.manifest.variables


def _swept(attempts: Path) -> tuple[str, ...]:
    """End what a killed run left running, as far as it is provably ours."""
    swept = sweep(attempts)
    if not swept.ended:
        return ()
    return (f"ended {len(swept.ended)} processes that an interrupted run had left behind",)
