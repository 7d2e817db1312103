"""`octoform watch`: one daemon for the project's host, from its first look until it is instructed to end. Light."""

import json
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import octoform
from octoform.apply.repair_outcome import RepairOutcome
from octoform.base.files import write_all
from octoform.base.health_status import Status
from octoform.claims.ledger import Ledger
from octoform.claims.model import Channel, Reading, Signal
from octoform.claims.settings import Settings, settings_of
from octoform.daemon import metrics, notices
from octoform.daemon.model import Finding, Ports, Repair
from octoform.daemon.observe.clock_jumps import SystemClock
from octoform.daemon.observe.event_queue import EventSources, Timing, open_sources
from octoform.daemon.observe.observer import Looker, busy, open_look
from octoform.daemon.observe.samples import Frames, Sensors
from octoform.daemon.reconcile.bench import Beside
from octoform.daemon.reconcile.supervisor import Cycle, Supervisor, View
from octoform.daemon.repair.playbook import SETTLE, SETTLE_SECONDS, Means, carry_out
from octoform.daemon.repair.restart import restart
from octoform.daemon.repair.worker import Workers
from octoform.daemon.store import incidents, instance_lock
from octoform.daemon.store.memory import Memory
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.published_files import LAUNCHER, POLICY
from octoform.manifest.model import FILE_NAME, Daemon, Notify
from octoform.records import dataclass, replace
from octoform.state.files import foreign, refused
from octoform.state.layout import Layout, is_left
from octoform.state.store.lock import myself

# The daemon put together from its real parts: clocks, ears, looks, repairs, notifications. Light.

METRICS_SECONDS = 15.0
LOOK_SECONDS = 120.0
JOIN_SECONDS = 5.0
_PICTURE = frozenset({Signal(Channel.FRAME, "", "")})


@dataclass(frozen=True, slots=True)
class Wanted:
    """How the manifest wants a host's deployment kept alive; ``looks`` when a camera may be looked through.

    ``bounds`` are what profiles call clean, as `octoform.claims.settings.bound_documents` gives it.
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
        """End every child process, wait for their work, and deliver the alerts that wait."""
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
    means = Means(layout.host, workers.run, settings.apply, lambda hung: restart(layout, hung=hung))
    sensors = Sensors(layout, maker.make)
    ports = Ports(
        clock=clock,
        sources=sources,
        look=looker,
        repair=_repairing(means, looker),
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
    """The settings for the ledger; no other process may change it while work on the host goes on."""
    found = settings_of(wanted.layout, float(wanted.daemon.claim_seconds), wanted.bounds)
    return replace(found, shut=lambda: busy(wanted.layout) is not None)


def _repairing(means: Means, looker: Looker) -> Callable[[Finding, Repair], RepairOutcome]:
    """Repairs whose starts are known to anyone who looks: why the last one failed is a fact like any other."""

    def made(finding: Finding, repair: Repair) -> RepairOutcome:
        outcome = carry_out(finding, repair, means)
        if repair is Repair.RESTART:
            looker.start_failed = None if outcome.ok else outcome.detail
        return outcome

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
    """A view in front of which the ledger gets the new list of tools after an apply or a repair has changed it."""

    def __init__(self, ledger: Ledger, layout: Layout, settings: Callable[[], Settings], view: View) -> None:
        self._ledger = ledger
        self._path = layout.endpoint / POLICY
        self._settings = settings
        self._view = view
        self._stamp = self._now()

    def __call__(self, made: Cycle) -> None:
        """Update the ledger, then show the cycle."""
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

    def __call__(self, made: Cycle) -> None:
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
            if problem is not None and problem != self._problem:  # reported once, not every few seconds
                self._memory.shelf.said.append(problem)
            self._problem = problem
        self._view(made)


# The daemon's lines in the host's one execution log, beside those of the tools and of octoform's own runs. Light.


def append(path: Path, lines: Iterable[Mapping[str, Any]]) -> OSError | None:
    """Write each object as one line; what kept them from being written, None when they stand.

    All of them in one write to a file opened for appending, so that they never mix with lines of a tool.
    """
    data = b"".join(json.dumps(line, ensure_ascii=True).encode("ascii") + b"\n" for line in lines)
    try:
        # Not blocking: with a pipe in its place the daemon would wait for a reader.
        how = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NONBLOCK | os.O_CLOEXEC
        descriptor = os.open(path, how, 0o600)
        try:
            write_all(descriptor, data)
        finally:
            os.close(descriptor)
    except OSError as problem:
        return problem
    return None


SETTINGS_SECONDS = 60.0
STOPS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


@dataclass(frozen=True, slots=True)
class Watched:
    """How it ended: the last check cycle (None: there was none), and the signal that ended it (None: it was done)."""

    host: str
    last: Cycle | None
    signal: int | None = None


def watch(
    project: Path, environ: Mapping[str, str], view: View, once: bool = False
) -> tuple[Watched | None, list[Diagnostic]]:
    """Keep the deployment alive until a signal comes; with ``once`` do what is due and come back.

    ``project`` is the folder of octopus.yaml; what changes there is taken up as soon as no repair is under way.
    ``view`` is called at the end of each check cycle. DAEMON-RUNNING when the host has a daemon already;
    ENDPOINT-NOT-APPLIED before the first apply.
    """
    folder = project.absolute()
    found, problem = _wanted(folder, environ)
    if found is None:
        return None, [problem] if problem else []
    clock = SystemClock()
    owned, problem = instance_lock.take(found.layout, clock.stamp(), clock.uptime(), octoform.__version__)
    if owned is None:
        return None, [problem] if problem else []
    try:
        with _stopping() as stopping:
            return _watched(found, environ, _WatchedView(view, folder, owned, found.layout.call_log), stopping, once)
    finally:
        owned.release()


class _Stopping:
    """The effect of a signal on the running loop."""

    def __init__(self) -> None:
        self.number: int | None = None
        self.stop: Callable[[], None] | None = None

    def __call__(self, number: int, _frame: FrameType | None) -> None:
        """The first one ends the loop in order; a second one interrupts whatever it is doing."""
        if self.number is not None:
            raise KeyboardInterrupt
        self.number = number
        if self.stop is not None:
            self.stop()


class _WatchedView:
    """The view, and behind it a look whether this is the host's daemon still, and the manifest the one that it was."""

    def __init__(self, view: View, project: Path, owned: instance_lock.Owned, log: Path) -> None:
        self._view = view
        self._log = log
        self._unwritten: OSError | None = None
        self._owned = owned
        self._path = project / FILE_NAME
        self._stamp = _stamp(self._path)
        self.last: Cycle | None = None
        self.running: Composition | None = None
        self.changed = False
        self._unwatched = 0
        self._unkept: Diagnostic | None = None
        self.replaced: Diagnostic | None = None
        """The daemon that took this one's place, when somebody deleted the record of this one."""

    def __call__(self, made: Cycle) -> None:
        """Show a check cycle; let the loop end when it has to begin again."""
        self.last = made
        self._view(made)
        self._record(made)
        before, self._unkept = self._unkept, self._owned.keep()
        if self._unkept is not None and self._unkept != before and self.running is not None:
            self._unowned(self._unkept, self.running)
        self._listens()
        if self.running is None or self.running.bench.under_way():
            return
        now = _stamp(self._path)
        if now != self._stamp:
            self._stamp, self.changed = now, True
            self.running.supervisor.stop()

    def _record(self, made: Cycle) -> None:
        """Write what was done into the host's one execution log, among the calls; say once that it cannot be."""
        if self.running is None or not (lines := list(_log_entries(made))):
            return
        problem = append(self._log, lines)
        if problem is not None and self._unwritten is None:
            self.running.supervisor.report(refused(problem, self._log))
        self._unwritten = problem

    def _listens(self) -> None:
        """Let the next check cycle say that folders are not watched, when that is another number than before."""
        if self.running is None:
            return
        unwatched = self.running.sources.unwatched
        problem = unwatched.diagnostic() if unwatched.folders != self._unwatched else None
        self._unwatched = unwatched.folders
        if problem is not None:
            self.running.supervisor.report(problem)

    def _unowned(self, problem: Diagnostic, running: Composition) -> None:
        if problem.code == instance_lock.TAKEN:
            self.replaced = problem
            running.supervisor.stop()
        else:
            running.supervisor.report(problem)


def _log_entries(made: Cycle) -> Iterator[dict[str, object]]:
    """The events of one check cycle as lines of the execution log."""
    fields = {"time": made.facts.stamp, "from": "daemon"}
    for episode in made.opened:
        yield {"event": "noticed", **fields, "target": episode.target, "summary": episode.summary}
    for episode, refusal in made.refused:
        yield {"event": "repair_refused", **fields, "target": episode.target, **refusal.summary()}
    for episode, tried in made.tried:
        yield {"event": "repair_end", **fields, "target": episode.target, **tried.summary()}
    for task in made.begun:
        if task.finding is not None and task.repair is not None:
            yield {"event": "repair_start", **fields, "target": task.finding.target, "repair": task.repair.value}
    for episode in made.ended:
        yield {"event": "over", **fields, "target": episode.target, "outcome": str(episode.outcome)}


def _watched(
    found: Wanted, environ: Mapping[str, str], shown: _WatchedView, stopping: _Stopping, once: bool
) -> tuple[Watched | None, list[Diagnostic]]:
    problem: Diagnostic | None = None
    while True:
        shown.changed = False
        refused = _run(found, environ, shown, stopping, (once, problem))
        if refused := refused or shown.replaced:
            return None, [refused]
        if stopping.number is not None or not shown.changed:
            return Watched(found.layout.host, shown.last, stopping.number), []
        again, problem = _wanted(found.layout.project, environ)
        if again is not None and again.layout != found.layout:
            summary = f"octopus.yaml names another host now: {again.layout.host}, not {found.layout.host}"
            return None, [error("DAEMON-NO-SETTINGS", summary, hint="start octoform watch again")]
        found = again or found


def _wanted(project: Path, environ: Mapping[str, str]) -> tuple[Wanted | None, Diagnostic | None]:
    workers = Workers(project, environ)
    try:
        result = workers.run("settings", {}, SETTINGS_SECONDS)
    finally:
        workers.end()
    if result.get("ok") is not True:
        hint = "octoform validate shows all problems"
        summary = "the manifest's settings of the daemon cannot be read"
        return None, error("DAEMON-NO-SETTINGS", summary, detail=str(result.get("detail") or "") or None, hint=hint)
    found = wanted(project, result)
    if problem := foreign(found.layout):
        return None, problem
    if not (found.layout.endpoint / LAUNCHER).is_file():
        hint = "run octoform apply, which builds it"
        return None, error("ENDPOINT-NOT-APPLIED", f"{found.layout.host} has no endpoint yet", hint=hint)
    return found, None


def _run(
    found: Wanted,
    environ: Mapping[str, str],
    shown: _WatchedView,
    stopping: _Stopping,
    how: tuple[bool, Diagnostic | None],
) -> Diagnostic | None:
    """One composition from its first look to its end; why there can be none.

    ``how``: once, and what is to be stated.
    """
    once, result = how
    workers = Workers(found.layout.project, environ)
    try:
        composed = compose(found, environ, workers, shown)
    except OSError as problem:
        workers.end()
        summary = f"the system lets no one watch files: {problem.strerror}"
        hint = "often too many watches are in use: sysctl fs.inotify.max_user_instances, fs.inotify.max_user_watches"
        return error("DAEMON-NO-EVENTS", summary, hint=hint)
    try:
        shown.running, stopping.stop = composed, composed.supervisor.stop
        if result is not None:
            composed.supervisor.report(result)
            composed.looker.manifest = (
                f"cannot be read, so what it was before counts: {result.detail or result.summary}"
            )
        if stopping.number is None and is_left(found.layout) and busy(found.layout) is None:
            workers.run(SETTLE, {"host": found.layout.host}, SETTLE_SECONDS)
        if stopping.number is None:
            composed.supervisor.run(once)
    finally:
        shown.running = stopping.stop = None
        composed.close()
    return None


@contextmanager
def _stopping() -> Iterator[_Stopping]:
    """Signals as a word to the loop, for as long as it runs."""
    found = _Stopping()
    before = {number: signal.getsignal(number) for number in STOPS}
    taken = [number for number in STOPS if before[number] is not signal.SIG_IGN]
    for number in taken:
        signal.signal(number, found)
    try:
        yield found
    finally:
        for number in taken:
            signal.signal(number, before[number])


def _stamp(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size
