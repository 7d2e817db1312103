"""Open a host for a change: compile, take its lock, read its state, finish what a killed run has left. (Heavy.)

An apply and the daemon's agents change the same folders, so they come in by the same door, one at a time.
"""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from octoform.apply.context import Clock, Context
from octoform.apply.rewrite.promotion import resume
from octoform.base.files import make_way, private_folder, write_all
from octoform.diagnostics import Diagnostic, has_errors, to_json
from octoform.engine.apply.rollback import settle
from octoform.engine.plan.configuration import Compiled, compile_project
from octoform.engine.plan.refresh import Situation
from octoform.events import AttemptProgress, Event, EventSink, Notice
from octoform.harness import logins
from octoform.records import dataclass, field
from octoform.state.files import Checkpoint, check_writable, foreign, pass_by
from octoform.state.git_repository import commit
from octoform.state.layout import Layout
from octoform.state.model import Snapshot
from octoform.state.reusable import Donors
from octoform.state.store.lock import Waiting, acquire
from octoform.state.store.store import Ports, StateStore


@dataclass(frozen=True, slots=True)
class HostRefused:
    """Why a host cannot be changed now; ``failed`` is ``compile``, ``lock`` or ``state``."""

    failed: str
    diagnostics: tuple[Diagnostic, ...]
    host: str = ""


@dataclass(frozen=True, slots=True)
class Locked:
    """A compiled project whose host is ours to change; ``notices`` are sentences for a person."""

    compiled: Compiled
    notices: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Opened:
    """Its state, with nothing left half done; ``finished`` states what a killed run had begun and was carried through.

    ``undone`` states what a killed run that no one watched had begun and was taken back.
    """

    store: StateStore
    finished: tuple[str, ...] = ()
    undone: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Means:
    """The surroundings of a run: its environment variables, its event sink, its clock, and reusable outputs."""

    environ: Mapping[str, str]
    emit: EventSink
    clock: Clock = field(default_factory=Clock)
    checkpoint: Checkpoint = pass_by
    donors: Callable[[], Donors] = dict


@contextmanager
def locked(
    project: Path, environ: Mapping[str, str], operation: str, seconds: float = 0.0
) -> Iterator[Locked | HostRefused]:
    """The compiled project under the lock of its host's state, for which ``seconds`` are waited; or why not."""
    compiled, found = compile_project(project, environ)
    if compiled is None:
        yield HostRefused("compile", tuple(found))
        return
    host = compiled.layout.host
    if shut := foreign(compiled.layout):
        yield HostRefused("state", (shut,), host)
        return
    acquired = acquire(compiled.layout, operation, Waiting(timeout=seconds))
    if acquired.lock is None:
        yield HostRefused("lock", acquired.diagnostics, host)
        return
    with acquired.lock:
        # Only with the lock: this writes into the folders, and removes what looks like a dead run's leftovers.
        found = check_writable(compiled.layout)
        yield HostRefused("state", tuple(found), host) if found else Locked(compiled, acquired.notices)


def opened(compiled: Compiled, ports: Ports | None = None) -> Opened | HostRefused:
    """The state of a host whose lock the caller holds, after what a killed run had begun to adopt is finished."""
    layout = compiled.layout
    undone, problems = settle(layout)
    if has_errors(problems):
        return HostRefused("state", tuple(problems), layout.host)
    store, found = StateStore.open(layout, ports or Ports())
    if store is None:
        return HostRefused("state", tuple(found), layout.host)
    finished, problems = resume(layout, store, compiled.graph)
    if has_errors(problems):
        return HostRefused("state", tuple(problems), layout.host)
    return Opened(store, finished, undone)


def context_of(compiled: Compiled, situation: Situation, store: StateStore, means: Means) -> Context:
    """All that a run on this host works with."""
    return Context(
        layout=compiled.layout,
        manifest=compiled.manifest,
        graph=compiled.graph,
        specs=compiled.specs,
        steps=compiled.steps,
        schemas=compiled.schemas,
        profiles=compiled.profiles,
        store=store,
        contract=situation.contract,
        fingerprint=situation.fingerprint.digest,
        hardware=situation.fingerprint.entries,
        environ={**means.environ, **logins.variables(compiled.manifest, means.environ)},
        emit=means.emit,
        clock=means.clock,
        checkpoint=means.checkpoint,
        donors=means.donors,
    )


# ``git: {commit: true}``: apply commits what it changed, and names in trailers what made it.


def commit_run(layout: Layout, snapshot: Snapshot, operation: str) -> tuple[str | None, list[Diagnostic]]:
    """Commit the host's folder below ``state/`` and nothing else; (None, []) when nothing changed."""
    message = f"octoform {operation} {layout.host}: serial {snapshot.serial}"
    return commit(layout.project, [layout.committed], message, _trailers(snapshot))


def _trailers(snapshot: Snapshot) -> dict[str, str]:
    makers = sorted({state.harness for state in snapshot.nodes.values() if state.harness})
    models = sorted({state.model for state in snapshot.nodes.values() if state.model})
    return {
        "Octoform-Host": snapshot.host,
        "Octoform-Lineage": snapshot.lineage,
        "Octoform-Serial": str(snapshot.serial),
        "Octoform-Harness": ", ".join(makers) or "none",
        "Octoform-Model": ", ".join(models) or "none",
        "Octoform-Usage": _usage(snapshot),
    }


def _usage(snapshot: Snapshot) -> str:
    """Tokens and money of the accepted runs, as far as the agents reported them; unreported is unknown, not zero."""
    usages = [state.usage for state in snapshot.nodes.values()]
    counts = [count for usage in usages for count in (usage.input_tokens, usage.output_tokens) if count is not None]
    costs = [usage.cost_usd for usage in usages if usage.cost_usd is not None]
    tokens = f"{sum(counts)} tokens" if counts else "tokens unknown"
    return f"{tokens}, {sum(costs):.4f} USD" if costs else f"{tokens}, cost unknown"


# The orchestrator's lines in the host's one execution log, beside those of the tools.
#
# One stream, so that a later reader sees in one order what was done to the host and what was called on it.


@contextmanager
def logging_to(path: Path, clock: Clock, show: Callable[[Event], None]) -> Iterator[Callable[[Event], None]]:
    """A sink that writes each event as one line and passes it on; progress lines are only passed on.

    A log that cannot be written (a full disk) stops no run: that it is incomplete is shown, once.
    """
    log = _Log(path, show)

    def emit(event: Event) -> None:
        if not isinstance(event, AttemptProgress):
            log.write(_line(event, clock))
        show(event)

    try:
        yield emit
    finally:
        log.close()


class _Log:
    """The open file; None after the system has refused it."""

    def __init__(self, path: Path, show: Callable[[Event], None]) -> None:
        self._show = show
        self._torn = False
        self._is_reported = False
        self._descriptor: int | None = None
        try:
            private_folder(path.parent)
            make_way(path)
            how = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOFOLLOW
            self._descriptor = os.open(path, how, 0o600)
        except OSError as problem:
            self._report_refusal(problem)

    def write(self, line: bytes) -> None:
        if self._descriptor is None:
            return
        try:
            write_all(self._descriptor, b"\n" + line if self._torn else line)
            self._torn = False
        except OSError as problem:
            self._torn = True  # some of it may be there; the next line must not be glued to it
            self._report_refusal(problem)

    def _report_refusal(self, problem: OSError) -> None:
        if not self._is_reported:
            self._is_reported = True
            self._show(Notice("", f"the execution log is incomplete: {problem.strerror}"))

    def close(self) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)


def _line(event: Event, clock: Clock) -> bytes:
    fields = asdict(event)
    for name in ("diagnostics",):
        if name in fields:
            fields[name] = [to_json(item) for item in getattr(event, name) if isinstance(item, Diagnostic)]
    record = {"event": type(event).__name__, "time": clock.stamp(), "from": "octoform", **fields}
    # A name that is no text becomes an escape, which JSON has for it.
    return json.dumps(record, ensure_ascii=False).encode("utf-8", "backslashreplace") + b"\n"
