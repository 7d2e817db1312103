"""`octoform watch`: one daemon for the project's host, from its first look until it is told to end. Light."""

import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import octoform
from octoform.daemon.notify.execution_log import append
from octoform.daemon.observe.clock import SystemClock
from octoform.daemon.observe.observer import busy
from octoform.daemon.reconcile.supervisor import Round, View
from octoform.daemon.repair.agents import SETTLE_SECONDS
from octoform.daemon.repair.worker_port import Workers
from octoform.daemon.store import instance_lock
from octoform.daemon.wiring import Composition, Wanted, compose, wanted
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.files import LAUNCHER
from octoform.manifest.model import FILE_NAME
from octoform.state.files import foreign, refused
from octoform.state.layout import is_left

SETTINGS_SECONDS = 60.0
STOPS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


@dataclass(frozen=True, slots=True)
class Watched:
    """How it ended: the last round (None: there was none), and the signal that ended it (None: it was done)."""

    host: str
    last: Round | None
    signal: int | None = None


def watch(
    project: Path, environ: Mapping[str, str], view: View, once: bool = False
) -> tuple[Watched | None, list[Diagnostic]]:
    """Keep the deployment alive until a signal comes; with ``once`` do what is due and come back.

    ``project`` is the folder of octopus.yaml; what changes there is taken up as soon as no repair is under way.
    ``view`` is called at the end of each round. DAEMON-RUNNING when the host has a daemon already;
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
            return _watched(found, environ, _Shown(view, folder, owned, found.layout.call_log), stopping, once)
    finally:
        owned.release()


class _Stopping:
    """What a signal says to the loop, whichever one runs."""

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


class _Shown:
    """The view, and behind it a look whether this is the host's daemon still, and the manifest the one that it was."""

    def __init__(self, view: View, project: Path, owned: instance_lock.Owned, log: Path) -> None:
        self._view = view
        self._log = log
        self._unwritten: OSError | None = None
        self._owned = owned
        self._path = project / FILE_NAME
        self._stamp = _stamp(self._path)
        self.last: Round | None = None
        self.running: Composition | None = None
        self.changed = False
        self._unwatched = 0
        self._unkept: Diagnostic | None = None
        self.replaced: Diagnostic | None = None
        """The daemon that took this one's place, when somebody deleted what said that there was one."""

    def __call__(self, made: Round) -> None:
        """Show a round; let the loop end when it has to begin anew."""
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

    def _record(self, made: Round) -> None:
        """Write what was done into the host's one execution log, among the calls; say once that it cannot be."""
        if self.running is None or not (lines := list(_doings(made))):
            return
        problem = append(self._log, lines)
        if problem is not None and self._unwritten is None:
            self.running.supervisor.say(refused(problem, self._log))
        self._unwritten = problem

    def _listens(self) -> None:
        """Let the next round say that folders are not watched, when that is another number than before."""
        if self.running is None:
            return
        unwatched = self.running.sources.unwatched
        problem = unwatched.told() if unwatched.folders != self._unwatched else None
        self._unwatched = unwatched.folders
        if problem is not None:
            self.running.supervisor.say(problem)

    def _unowned(self, problem: Diagnostic, running: Composition) -> None:
        if problem.code == instance_lock.TAKEN:
            self.replaced = problem
            running.supervisor.stop()
        else:
            running.supervisor.say(problem)


def _doings(made: Round) -> Iterator[dict[str, object]]:
    """What one round noticed, began, tried and saw the end of, as lines of the execution log."""
    told = {"time": made.facts.stamp, "from": "daemon"}
    for episode in made.opened:
        yield {"event": "noticed", **told, "target": episode.target, "summary": episode.summary}
    for episode, tried in made.tried:
        ended = {"repair": tried.repair, "ok": tried.ok, "detail": tried.detail[:300], "seconds": tried.seconds}
        yield {"event": "repair_end", **told, "target": episode.target, **ended}
    for task in made.begun:
        if task.finding is not None and task.repair is not None:
            yield {"event": "repair_start", **told, "target": task.finding.target, "repair": task.repair.value}
    for episode in made.ended:
        yield {"event": "over", **told, "target": episode.target, "outcome": str(episode.outcome)}


def _watched(
    found: Wanted, environ: Mapping[str, str], shown: _Shown, stopping: _Stopping, once: bool
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
        told = workers.run("settings", {}, SETTINGS_SECONDS)
    finally:
        workers.end()
    if told.get("ok") is not True:
        hint = "octoform validate tells all of it"
        summary = "what the manifest says of the daemon cannot be read"
        return None, error("DAEMON-NO-SETTINGS", summary, detail=str(told.get("detail") or "") or None, hint=hint)
    found = wanted(project, told)
    if problem := foreign(found.layout):
        return None, problem
    if not (found.layout.endpoint / LAUNCHER).is_file():
        hint = "run octoform apply, which builds it"
        return None, error("ENDPOINT-NOT-APPLIED", f"{found.layout.host} has no endpoint yet", hint=hint)
    return found, None


def _run(
    found: Wanted,
    environ: Mapping[str, str],
    shown: _Shown,
    stopping: _Stopping,
    how: tuple[bool, Diagnostic | None],
) -> Diagnostic | None:
    """One composition from its first look to its end; why there can be none. ``how``: once, and what is to be said."""
    once, said = how
    workers = Workers(found.layout.project, environ)
    try:
        composed = compose(found, environ, workers, shown)
    except OSError as problem:
        workers.end()
        summary = f"the system lets nobody watch files: {problem.strerror}"
        hint = "often too many watches are in use: sysctl fs.inotify.max_user_instances, fs.inotify.max_user_watches"
        return error("DAEMON-NO-EVENTS", summary, hint=hint)
    try:
        shown.running, stopping.stop = composed, composed.supervisor.stop
        if said is not None:
            composed.supervisor.say(said)
            composed.looker.manifest = f"cannot be read, so what it was before counts: {said.detail or said.summary}"
        if stopping.number is None and is_left(found.layout) and busy(found.layout) is None:
            workers.run("settle", {"host": found.layout.host}, SETTLE_SECONDS)
        if stopping.number is None:
            composed.supervisor.run(once)
    finally:
        shown.running = stopping.stop = None
        composed.close()
    return None


@contextmanager
def _stopping() -> Iterator[_Stopping]:
    """Signals as a word to the loop, for as long as it runs."""
    told = _Stopping()
    before = {number: signal.getsignal(number) for number in STOPS}
    taken = [number for number in STOPS if before[number] is not signal.SIG_IGN]
    for number in taken:
        signal.signal(number, told)
    try:
        yield told
    finally:
        for number in taken:
            signal.signal(number, before[number])


def _stamp(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size
