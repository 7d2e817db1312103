"""Everything that one run of apply works with, in one frozen value: passed down instead of a dozen parameters."""

import marshal
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

from octoform.base import files
from octoform.base.clock import stamp
from octoform.contracts.artifact_parser import parse
from octoform.diagnostics import Diagnostic
from octoform.events import EventSink
from octoform.graph.model import Graph
from octoform.harness.port import Usage
from octoform.manifest.model import Manifest
from octoform.profiles import Profile
from octoform.protocol import Spec, Step
from octoform.records import dataclass, field
from octoform.state.files import Checkpoint, pass_by
from octoform.state.layout import STAGES, Layout
from octoform.state.reusable import Donors
from octoform.state.store.store import StateStore

CANDIDATE = "candidate"
"""Where the server lies that a privileged step has rewritten, while the endpoint is published with it for its proof."""
HEALED = "healed"
"""The folder of what repairs have replaced."""

# Money and time: what a run and its stages have cost so far, and what is left of their budgets.

LEAST_SECONDS = 0.1


@dataclass(slots=True)
class Budget:
    """The spending of this run: US dollars by stage, attempts and seconds by stage and role.

    A stage that a later one sends back goes on with what its budget has left: it is one stage of one run. ``until`` is
    when the stage at work has to be over, tests included, on the run's clock; None where nothing has.
    """

    spent: dict[str, float] = field(default_factory=dict)
    used: dict[tuple[str, str], tuple[int, float]] = field(default_factory=dict)
    until: float | None = None

    def time(self, now: float, most: float) -> float:
        """Seconds that something may take which takes ``most`` where no stage is at work; never none at all."""
        return most if self.until is None else max(LEAST_SECONDS, min(most, self.until - now))

    def pay(self, stage: str, usage: Usage) -> None:
        """Add what an attempt has cost; an unknown cost adds nothing."""
        self.spent[stage] = self.spent.get(stage, 0.0) + (usage.cost_usd or 0.0)

    def left(self, stage: str, stage_usd: float | None, run_usd: float | None) -> float | None:
        """The budget of the next attempt of a stage; None without a limit."""
        limits = []
        if stage_usd is not None:
            limits.append(stage_usd - self.spent.get(stage, 0.0))
        if run_usd is not None:
            limits.append(run_usd - sum(self.spent.values()))
        return min(limits) if limits else None


@dataclass(frozen=True, slots=True)
class Clock:
    """Time as three functions, so that tests can use their own: seconds that only rise, wall time, waiting."""

    monotonic: Callable[[], float] = time.monotonic
    now: Callable[[], datetime] = lambda: datetime.now(UTC)
    sleep: Callable[[float], None] = time.sleep

    def stamp(self) -> str:
        """RFC 3339 in UTC, to the second."""
        return stamp(self.now())


@dataclass(frozen=True, slots=True)
class Context:
    """One run on one host.

    ``fingerprint`` and ``hardware`` are the host's digest and entries as they were when the run began; ``contract`` is
    the digest of the schemas and rules that accepted artifacts are held to. ``purse`` counts what the run has cost,
    ``donors`` gives the reusable outputs of other hosts (nothing, where reuse is off). ``steps`` are the privileged
    steps by the names of their nodes (``step.arm``), under which ``specs`` has their specs too.
    """

    layout: Layout
    manifest: Manifest
    graph: Graph
    specs: Mapping[str, Spec]
    schemas: Path
    profiles: tuple[Profile, ...]
    store: StateStore
    contract: str
    fingerprint: str
    hardware: tuple[str, ...]
    environ: Mapping[str, str]
    emit: EventSink
    clock: Clock
    checkpoint: Checkpoint = pass_by
    donors: Callable[[], Donors] = dict
    purse: Budget = field(default_factory=Budget)
    steps: Mapping[str, Step] = field(default_factory=dict)


# What one run has done so far, for its closing lines and its record.


@dataclass(slots=True)
class Tally:
    """Counts of nodes and of agent runs, what those used, the node that failed, and what was found.

    ``alike`` counts nodes that were made again and came out the same: they are not among ``changed``.
    """

    added: int = 0
    changed: int = 0
    alike: int = 0
    destroyed: int = 0
    agent_runs: int = 0
    usage: Usage = field(default_factory=Usage)
    failed: str | None = None
    diagnostics: list[Diagnostic] = field(default_factory=list)


# Accepted artifacts as values again, for the rules and the proofs of later stages.


def accepted(context: Context, stage: str) -> Any:
    """The value of an accepted artifact; ValueError when it is not there, which the order of the run prevents."""
    path = context.layout.output(stage)
    return marshal.loads(_parsed(stage, files.read(path), str(path)))


@lru_cache(maxsize=len(STAGES))
def _parsed(stage: str, data: bytes, path: str) -> bytes:
    """The value in a form that is read quickly: each caller gets one of its own, and a run asks some forty times."""
    value: Any
    value, found = parse(stage, data, path)
    if value is None:
        raise ValueError(f"{path} cannot be read any more: {found}")
    return marshal.dumps(value)


def predecessor(context: Context, stage: str) -> Path | None:
    """The accepted artifact that the stage may read; None for the first."""
    consumes = context.graph.node(stage).consumes
    return context.layout.output(consumes[0]) if consumes else None


def accepted_before(context: Context, stage: str) -> dict[str, Any]:
    """The values of all accepted artifacts of the stages before ``stage`` (or before a step), by stage."""
    names = context.graph.names()
    before = [name for name in names[: names.index(stage)] if name in STAGES]
    return {name: accepted(context, name) for name in before if context.layout.output(name).is_file()}
