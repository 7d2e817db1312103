"""A deployment in virtual time: facts that change when repairs are made, a clock that jumps, a machine that sleeps.

`DaemonWorld` stands behind the ports of the daemon's loop. Nothing sleeps: waiting moves the clock to the next thing
that happens. What happens is set with `at`, `every` and the fields of `Truth`; what repairs do with `mends`.
"""

import heapq
import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from octoform.apply.repair_outcome import RepairOutcome
from octoform.claims.ledger import Ledger
from octoform.claims.model import Channel, Reading, Signal, Value
from octoform.claims.settings import Settings
from octoform.daemon.model import Alert, Cause, Facts, Finding, LastSeen, Ports, Repair
from octoform.daemon.reconcile.bench import AtOnce, Bench
from octoform.daemon.reconcile.supervisor import Cycle, Supervisor
from octoform.daemon.store.memory import Memory
from octoform.endpoint.logs import LoggedCall
from octoform.endpoint.process.record import Running
from octoform.manifest.model import Daemon
from octoform.state.layout import Layout

INTERVAL, PING = 300.0, 90.0
BOOT = "0f0e0d0c-0000-4000-8000-000000000001"
Mend = Callable[["DaemonWorld", Finding], RepairOutcome]


@dataclass
class Truth:
    """How the deployment really is."""

    pid: int | None = 100
    answers: bool = True
    applied: bool = True
    destroyed: bool = False
    busy: str | None = None
    stopped_by: str | None = None
    latched: bool = False
    damaged: dict[str, str] = field(default_factory=dict)
    environment: tuple[str, ...] = ()
    appeared: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()
    devices: dict[str, LastSeen] = field(default_factory=dict)
    log_bytes: dict[str, int] = field(default_factory=dict)
    disk_free: int | None = 10_000_000_000
    failures: list[LoggedCall] = field(default_factory=list)
    worked: list[str] = field(default_factory=list)
    sensors: dict[tuple[str, str], Value] = field(default_factory=dict)
    """Value by (tool, path)."""


class DaemonWorld:
    """The ports, the memory on disk below ``folder``, and the `Supervisor` over them (``world.supervisor``)."""

    def __init__(
        self, folder: Path, settings: Daemon | None = None, bench: Bench | None = None, claims: Settings | None = None
    ) -> None:
        """``claims`` are the ledger's settings (tools, bounds); its boot is this world's."""
        self.layout = Layout(folder, "bench")
        self.layout.daemon.mkdir(mode=0o700, parents=True, exist_ok=True)
        self.settings = settings or Daemon()
        self.claims = claims or Settings(float(self.settings.claim_seconds))
        self.bench = bench
        self.boot = BOOT
        self.now = 1000.0
        self.wall = datetime(2026, 11, 22, 12, 0, tzinfo=UTC)
        self.truth = Truth()
        self.mends: dict[Repair, Mend] = dict(MENDS)
        self.made: list[tuple[float, Repair, str]] = []
        self.alerts: list[Alert] = []
        self.rounds: list[Cycle] = []
        self._due: list[tuple[float, int, Callable[[], frozenset[Cause]]]] = []
        self._count = itertools.count()
        self._pids = itertools.count(101)
        self._interval, self._ping = self.now + INTERVAL, self.now + PING
        self.end = self.now
        self.supervisor = self.begun()

    # The daemon

    def begun(self) -> Supervisor:
        """A daemon that takes up what the one before it left: as after a restart."""
        ports = Ports(
            self,
            self,
            self.look,
            self.repair,
            self.sample,
            self.promised,
            self.alerts.append,
        )
        memory = Memory.open(self.layout, self.boot, self.now, self.settings)
        self.ledger = Ledger.open(self.layout, self, replace(self.claims, boot=self.boot))
        self.memory = memory
        bench = self.bench or AtOnce(self.uptime)
        self.supervisor = Supervisor(ports, memory, self.settings, self.ledger, bench, self._shown)
        return self.supervisor

    def reboot(self) -> None:
        """The machine starts again: another boot, an uptime that begins anew, no process."""
        self.boot = self.boot[:-1] + str(int(self.boot[-1]) + 1)
        self.wall += timedelta(seconds=self.now)  # the wall clock goes on
        self.now = 20.0
        self.end = self.now
        self._interval, self._ping, self._due = self.now + INTERVAL, self.now + PING, []
        self.truth.pid = None
        self.begun()

    def start(self) -> Cycle:
        """The first round."""
        return self.supervisor.round(frozenset({Cause.START}))

    def advance(self, seconds: float) -> list[Cycle]:
        """Let so much time pass; the rounds that were made."""
        before = len(self.rounds)
        self.end = self.now + seconds
        while self.now < self.end:
            self.supervisor.step()
        return self.rounds[before:]

    def happens(self, *causes: Cause) -> Cycle:
        """Something happens now."""
        return self.supervisor.round(frozenset(causes))

    # What happens in the world

    def at(self, seconds: float, what: Callable[[], object], *causes: Cause) -> None:
        """``what`` happens so many seconds from now, and is noticed by ``causes``."""

        def happen() -> frozenset[Cause]:
            what()
            return frozenset(causes)

        heapq.heappush(self._due, (self.now + seconds, next(self._count), happen))

    def every(self, seconds: float, what: Callable[[], object], *causes: Cause) -> None:
        """``what`` happens again and again."""

        def again() -> None:
            what()
            self.at(seconds, again, *causes)

        self.at(seconds, again, *causes)

    def die(self) -> None:
        """The endpoint's process ends."""
        self.truth.pid = None

    def live(self) -> None:
        """A new process serves the endpoint."""
        self.truth.pid, self.truth.answers = next(self._pids), True

    def fail(self, tool: str, error: str = "NameError", message: str = "name 'x' is not defined") -> None:
        """A call fails."""
        self.truth.failures.append(LoggedCall(tool, ended=True, ok=False, error=error, message=message))

    def suspend(self, seconds: float) -> frozenset[Cause]:
        """The machine sleeps: uptime and wall clock go on, no process runs."""
        self.now += seconds
        return frozenset({Cause.RESUMED})

    def set_wall(self, seconds: float) -> None:
        """The wall clock is set by so much, to and fro; uptime goes on as before."""
        self.wall += timedelta(seconds=seconds)

    # The ports

    def uptime(self) -> float:
        """Seconds since the machine was started."""
        return self.now

    def stamp(self) -> str:
        """RFC 3339."""
        return (self.wall + timedelta(seconds=self.now)).isoformat(timespec="milliseconds").replace("+00:00", "Z")

    def wait(self, seconds: float | None) -> frozenset[Cause]:
        """To the next thing that happens, the next timer, the end of the test, or the end of the time."""
        times = [self.end, self._interval]
        times += [self._ping] if self.truth.pid is not None else []
        times += [self._due[0][0]] if self._due else []
        times += [] if seconds is None else [self.now + seconds]
        self.now = max(self.now, min(times))
        found: set[Cause] = set()
        while self._due and self._due[0][0] <= self.now:
            found |= heapq.heappop(self._due)[2]()
        if self.now >= self._interval:
            self._interval = self.now + INTERVAL
            found.add(Cause.INTERVAL)
        if self.now >= self._ping:
            self._ping = self.now + PING
            found |= {Cause.PING} if self.truth.pid is not None else set()
        return frozenset(found)

    def rouse(self) -> None:
        """No one waits here."""

    def follow(self, facts: Facts) -> None:
        """Everything is heard."""

    def close(self) -> None:
        """There is nothing to let go of."""

    def look(self, causes: frozenset[Cause]) -> Facts:
        """The facts, which are all seen at each look; of the log only what is new."""
        truth = self.truth
        failures, worked = tuple(truth.failures), tuple(truth.worked)
        truth.failures, truth.worked = [], []
        return Facts(
            uptime=self.now,
            stamp=self.stamp(),
            host="bench",
            applied=truth.applied,
            destroyed=truth.destroyed,
            busy=truth.busy,
            stopped_by=truth.stopped_by,
            process=None if truth.pid is None else _process(truth.pid),
            answers=None if truth.pid is None else truth.answers,
            latched=truth.latched,
            damaged=dict(truth.damaged),
            environment=truth.environment,
            disk_free=truth.disk_free,
            log_bytes=dict(truth.log_bytes),
            appeared=truth.appeared,
            gone=truth.gone,
            devices=dict(truth.devices),
            failures=failures,
            worked=worked,
        )

    def repair(self, finding: Finding, repair: Repair) -> RepairOutcome:
        """Carry it out, as ``mends`` has it."""
        self.made.append((self.now, repair, finding.target))
        mend = self.mends.get(repair)
        return failed("no one can do that here", again=False) if mend is None else mend(self, finding)

    def sample(self) -> Iterable[Reading]:
        """The sensors; nothing where no process runs."""
        if self.truth.pid is None:
            return ()
        return [
            self.ledger.make(Signal(Channel.SENSOR, tool, path), value, "" if value is not None else "not read")
            for (tool, path), value in self.truth.sensors.items()
        ]

    def promised(self) -> frozenset[Signal]:
        """Each tool that has a sensor."""
        return frozenset(Signal(Channel.SENSOR, tool, "") for tool, _ in self.truth.sensors)

    # What was done

    def repairs(self, target: str | None = None) -> list[Repair]:
        """The repairs that were made, in order."""
        return [repair for _, repair, name in self.made if target in (None, name)]

    def _shown(self, made: Cycle) -> None:
        self.rounds.append(made)


def worked(text: str, **more: Any) -> RepairOutcome:
    """A repair that reports success."""
    return RepairOutcome.done("repair.made", text, **more)


def failed(text: str, **more: Any) -> RepairOutcome:
    """A repair that reports failure."""
    return RepairOutcome.failed("repair.not-made", text, **more)


def _restart(world: DaemonWorld, finding: Finding) -> RepairOutcome:
    world.live()
    return worked("started")


def _restore(world: DaemonWorld, finding: Finding) -> RepairOutcome:
    world.truth.damaged.clear()
    return worked("restored")


def _rebuild(world: DaemonWorld, finding: Finding) -> RepairOutcome:
    world.truth.environment = ()
    world.live()
    return worked("rebuilt")


def _rotate(world: DaemonWorld, finding: Finding) -> RepairOutcome:
    world.truth.log_bytes.clear()
    return worked("rotated")


def first(happens: Callable[["DaemonWorld"], None], done: RepairOutcome) -> Mend:
    """A repair during which this happens, whatever it reports."""

    def mend(world: "DaemonWorld", _: Finding) -> RepairOutcome:
        happens(world)
        return done

    return mend


MENDS: dict[Repair, Mend] = {
    Repair.RESTART: _restart,
    Repair.RESTORE: _restore,
    Repair.REBUILD: _rebuild,
    Repair.ROTATE: _rotate,
}


def _process(pid: int) -> Running:
    return Running(pid, pid * 10, ("python", "endpoint"), f"i{pid}", "2026-11-22T12:00:00Z", "local", None)
