"""Everything that one run of apply works with, in one frozen value: passed down instead of a dozen parameters."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from octoform.apply.purse import Purse
from octoform.events import EventSink
from octoform.graph.model import Graph
from octoform.manifest.model import Manifest
from octoform.profiles import Profile
from octoform.protocol import Spec, Step
from octoform.state.artifacts.reusable import Donors
from octoform.state.files import Checkpoint, pass_by
from octoform.state.layout import Layout
from octoform.state.store.store import StateStore


@dataclass(frozen=True, slots=True)
class Clock:
    """Time as three functions, so that tests can use their own: seconds that only rise, wall time, waiting."""

    monotonic: Callable[[], float] = time.monotonic
    now: Callable[[], datetime] = lambda: datetime.now(UTC)
    sleep: Callable[[float], None] = time.sleep

    def stamp(self) -> str:
        """RFC 3339 in UTC, to the second."""
        return self.now().isoformat(timespec="seconds").replace("+00:00", "Z")


@dataclass(frozen=True, slots=True)
class Context:
    """One run on one host.

    ``fingerprint`` and ``hardware`` are the host's digest and entries as they were when the run began; ``contract`` is
    the digest of the schemas and rules that accepted artifacts are held to. ``purse`` counts what the run has cost,
    ``donors`` gives what other hosts can lend (nothing, where reuse is off). ``steps`` are the privileged steps by the
    names of their nodes (``step.arm``), under which ``specs`` has their specs too.
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
    purse: Purse = field(default_factory=Purse)
    steps: Mapping[str, Step] = field(default_factory=dict)
