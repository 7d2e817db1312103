"""Open a host for a change: compile, take its lock, read its state, finish what a killed run has left. (Heavy.)

An apply and the daemon's agents change the same folders, so they come in by the same door, one at a time.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from octoform.apply.context import Clock, Context
from octoform.apply.rewrite.promotion import resume
from octoform.diagnostics import Diagnostic, has_errors
from octoform.engine.apply.rollback import settle
from octoform.engine.plan.configuration import Compiled, compile_project
from octoform.engine.plan.refresh import Situation
from octoform.events import EventSink
from octoform.harness import logins
from octoform.state.artifacts.reusable import Donors
from octoform.state.files import Checkpoint, check_writable, pass_by
from octoform.state.store.lock import Waiting, acquire
from octoform.state.store.store import Ports, StateStore


@dataclass(frozen=True, slots=True)
class Refused:
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
    """Its state, with nothing left half done; ``finished`` says what a killed run had begun and was carried through.

    ``undone`` says what a killed run that nobody watched had begun and was taken back.
    """

    store: StateStore
    finished: tuple[str, ...] = ()
    undone: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Means:
    """What a run brings along: its environment variables, who hears of it, its clock, and what other hosts can lend."""

    environ: Mapping[str, str]
    emit: EventSink
    clock: Clock = field(default_factory=Clock)
    checkpoint: Checkpoint = pass_by
    donors: Callable[[], Donors] = dict


@contextmanager
def locked(
    project: Path, environ: Mapping[str, str], operation: str, seconds: float = 0.0
) -> Iterator[Locked | Refused]:
    """The compiled project under the lock of its host's state, for which ``seconds`` are waited; or why not."""
    compiled, found = compile_project(project, environ)
    if compiled is None:
        yield Refused("compile", tuple(found))
        return
    host = compiled.layout.host
    acquired = acquire(compiled.layout, operation, Waiting(timeout=seconds))
    if acquired.lock is None:
        yield Refused("lock", acquired.diagnostics, host)
        return
    with acquired.lock:
        # Only with the lock: this writes into the folders, and removes what looks like a dead run's leftovers.
        found = check_writable(compiled.layout)
        yield Refused("state", tuple(found), host) if found else Locked(compiled, acquired.notices)


def opened(compiled: Compiled, ports: Ports | None = None) -> Opened | Refused:
    """The state of a host whose lock the caller holds, after what a killed run had begun to adopt is finished."""
    layout = compiled.layout
    undone, problems = settle(layout)
    if has_errors(problems):
        return Refused("state", tuple(problems), layout.host)
    store, found = StateStore.open(layout, ports or Ports())
    if store is None:
        return Refused("state", tuple(found), layout.host)
    finished, problems = resume(layout, store, compiled.graph)
    if has_errors(problems):
        return Refused("state", tuple(problems), layout.host)
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
