"""The daemon put together from its real parts: clocks, ears, looks, repairs, notifications. Light."""

import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from octoform.claims.ledger import Ledger
from octoform.claims.model import Channel, Reading, Signal
from octoform.claims.settings import Settings, settings_of
from octoform.daemon.model import Done, Finding, Repair, Status
from octoform.daemon.notify import metrics, notices
from octoform.daemon.observe.clock import SystemClock
from octoform.daemon.observe.event_queue import EventSources, Timing, open_sources
from octoform.daemon.observe.observer import Looker, busy, open_look
from octoform.daemon.observe.samples import Frames, Sensors
from octoform.daemon.ports import Ports
from octoform.daemon.reconcile.lanes import Beside
from octoform.daemon.reconcile.supervisor import Round, Supervisor, View
from octoform.daemon.repair.agents import Agents
from octoform.daemon.repair.dispatch import Repairs
from octoform.daemon.repair.restart import restart
from octoform.daemon.repair.worker_port import Workers
from octoform.daemon.store import incidents
from octoform.daemon.store.state import Memory
from octoform.diagnostics import Diagnostic
from octoform.endpoint.files import POLICY
from octoform.manifest.model import Daemon, Notify
from octoform.state.layout import Layout
from octoform.state.lock_holder import myself

METRICS_SECONDS = 15.0
LOOK_SECONDS = 120.0
JOIN_SECONDS = 5.0
_PICTURE = frozenset({Signal(Channel.FRAME, "", "")})


@dataclass(frozen=True, slots=True)
class Wanted:
    """How the manifest wants a host's deployment kept alive; ``looks`` when a camera may be looked through.

    ``bounds`` are what profiles call clean, as `octoform.claims.settings.bounds_told` gives it.
    """

    layout: Layout
    daemon: Daemon
    looks: bool
    bounds: tuple[Mapping[str, Any], ...] = ()


@dataclass(slots=True)
class Composition:
    """A daemon that can run; `close` lets go of everything, and leaves no child."""

    supervisor: Supervisor
    workers: Workers
    bench: Beside
    sources: EventSources
    looker: Looker
    notifier: notices.Notifier

    def close(self) -> None:
        """End every child, wait for what they were doing, tell what waits to be told."""
        self.workers.end()
        self.bench.join(JOIN_SECONDS)
        self.looker.remember()
        self.notifier.close()
        self.sources.close()


def wanted(project: Path, told: Mapping[str, Any]) -> Wanted:
    """The result of the job ``settings`` as values; LookupError, TypeError or ValueError when it is none."""
    daemon = dict(told["daemon"])
    notify = dict(daemon.pop("notify"))
    path = daemon.pop("metrics")
    notify["command"] = tuple(notify["command"])
    settings = Daemon(**daemon, notify=Notify(**notify), metrics=None if path is None else Path(path))
    bounds = tuple(told.get("bounds") or ())
    return Wanted(Layout(project, str(told["host"])), settings, bool(told["perception"]["enabled"]), bounds)


def compose(wanted: Wanted, environ: Mapping[str, str], workers: Workers, view: View) -> Composition:
    """Put a daemon together; OSError when the system has no way to watch files."""
    layout, settings = wanted.layout, wanted.daemon
    clock = SystemClock()
    sources = open_sources(layout, environ, Timing(float(settings.interval)), clock)
    looker = open_look(layout, environ, clock)
    memory = Memory.open(layout, myself().boot_id, clock.uptime(), settings)
    claims = _claims(wanted)
    ledger, maker = Ledger.open(layout, clock, claims), Ledger(layout, clock, claims)
    notifier = notices.open_notifier(layout, settings.notify, environ)
    plain = Repairs(layout.host, workers.run, settings.apply, lambda hung: restart(layout, hung=hung))
    sensors = Sensors(layout, maker.make)
    ports = Ports(
        clock=clock,
        sources=sources,
        look=looker,
        repair=_starting(Agents(layout.host, workers.run, plain), looker),
        sample=_sampling(wanted, sensors, maker, workers),
        promised=lambda: sensors.promised() | (_PICTURE if wanted.looks else frozenset()),
        notify=notifier,
    )
    bench = Beside(sources.rouse)
    shown: View = _Knowing(ledger, layout, lambda: _claims(wanted), view)
    if settings.metrics is not None:
        shown = _Counted(settings.metrics, memory, shown)
    supervisor = Supervisor(ports, memory, settings, ledger, bench, shown)
    return Composition(supervisor, workers, bench, sources, looker, notifier)


def _claims(wanted: Wanted) -> Settings:
    """What the ledger is told; while somebody works on the host no other process may change it."""
    found = settings_of(wanted.layout, float(wanted.daemon.claim_seconds), wanted.bounds)
    return replace(found, shut=lambda: busy(wanted.layout) is not None)


def _starting(repair: Callable[[Finding, Repair], Done], looker: Looker) -> Callable[[Finding, Repair], Done]:
    """Repairs whose starts are known to whoever looks: why the last one failed is a fact like any other."""

    def made(finding: Finding, wanted: Repair) -> Done:
        found = repair(finding, wanted)
        if wanted is Repair.RESTART:
            looker.start_failed = None if found.ok else found.detail
        return found

    return made


def _sampling(wanted: Wanted, sensors: Sensors, maker: Ledger, workers: Workers) -> Callable[[], Iterable[Reading]]:
    """Readings are made in threads beside the loop: one at a time, and with ids that the loop's own never are."""
    layout = wanted.layout
    frames = Frames(layout, maker.make, lambda: workers.run("look", {"host": layout.host}, LOOK_SECONDS))
    guard = threading.Lock()

    def sample() -> Iterable[Reading]:
        with guard:
            return (*sensors(), *(frames() if wanted.looks else ()))

    return sample


class _Knowing:
    """A view in front of which the ledger is told of other tools, once an apply or a repair has changed them."""

    def __init__(self, ledger: Ledger, layout: Layout, settings: Callable[[], Settings], view: View) -> None:
        self._ledger = ledger
        self._path = layout.endpoint / POLICY
        self._settings = settings
        self._view = view
        self._stamp = self._now()

    def __call__(self, made: Round) -> None:
        """Tell it, then show."""
        now = self._now()
        if now != self._stamp and made.facts.busy is None:
            self._stamp = now
            self._ledger.use(self._settings())
        self._view(made)

    def _now(self) -> int | None:
        try:
            return self._path.stat().st_mtime_ns
        except OSError:
            return None


class _Counted:
    """A view behind which the numbers are written for Prometheus: at a change of health, else every few seconds."""

    def __init__(self, path: Path, memory: Memory, view: View) -> None:
        self._path = path
        self._memory = memory
        self._view = view
        self._next = 0.0
        self._status: Status | None = None
        self._problem: Diagnostic | None = None

    def __call__(self, made: Round) -> None:
        """Write, then show."""
        status = made.health.status if made.health is not None else None
        if made.health is not None and (made.facts.uptime >= self._next or status is not self._status):
            self._status = status
            self._next = made.facts.uptime + METRICS_SECONDS
            picture = metrics.Picture(
                made.health,
                incidents.read(self._memory.shelf),
                time.time(),
                len(self._memory.breakers.given_up(self._memory.episodes.open.values())),
                made.paused is not None,
                sum(each.lost for each in notices.failing(self._memory.shelf.layout)),
            )
            problem = metrics.write(self._path, picture)
            if problem is not None and problem != self._problem:  # said once, not every few seconds of a night
                self._memory.shelf.said.append(problem)
            self._problem = problem
        self._view(made)
