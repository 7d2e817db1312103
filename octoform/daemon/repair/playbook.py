"""The playbook: one class for each kind of repair, with all that is particular to it. Light.

The loop (`octoform.daemon.reconcile.repairs`) decides when a repair is made, and facts show whether it helped. A kind
answers what the loop asks: what speaks against it now, what it may cost, how it is carried out, whether facts show that
it held, and how what it left behind is taken back.

Everything runs in a child of the daemon, also what is light: a child that hangs is ended, and the daemon is not. A
restart is the exception where the daemon makes it itself: it is bounded in all of its steps, and anyone who waits for
the endpoint does not wait for the start of a child as well.
"""

from collections.abc import Callable, Iterator, Mapping
from enum import StrEnum
from typing import Any

from octoform.apply.repair_outcome import Reason, RepairOutcome
from octoform.daemon.model import Facts, Finding, Kind, Repair
from octoform.records import dataclass
from octoform.state.layout import Layout

Run = Callable[[str, Mapping[str, Any], float], Mapping[str, Any]]
"""Does a job in a child: name, brief, seconds; `octoform.daemon.repair.worker.Workers.run`."""
SETTLE, SETTLE_SECONDS = "settle", 180.0


class Lane(StrEnum):
    """Works that do not wait for each other."""

    PROCESS = "process"
    """The endpoint's process."""
    ROOM = "room"
    """Short work on files of this machine: logs, room, where a device is."""
    STAND = "stand"
    """Repairs of the endpoint's files, and agents: under the state's lock, and long."""
    SENSES = "senses"
    """Readings."""


@dataclass(frozen=True, slots=True)
class Means:
    """What a repair of one host is carried out with. ``apply`` is the manifest's ``daemon.apply``: ``auto`` or ``ask``.

    ``restart`` starts the endpoint in the thread that asks for it (True: a process that hangs); None: in a child.
    """

    host: str
    run: Run
    apply: str = "auto"
    restart: Callable[[bool], RepairOutcome] | None = None


@dataclass(frozen=True, slots=True)
class Order:
    """What a child is asked: on which host, with which variables, and what `RepairKind.brief` gave."""

    layout: Layout
    environ: Mapping[str, str]
    brief: Mapping[str, Any]


class RepairKind:
    """One kind of repair; a kind states what is otherwise with it."""

    name: Repair
    seconds: float
    """What it may take: more than the manifest lets an agent take, so that the agent's own budget ends it first."""
    lane = Lane.STAND
    asks_agent = False
    """May call a model."""
    moves = False
    """May call what moves, and be at work as an apply: never while an emergency stop is engaged."""
    exchanges = True
    """Stops and starts the endpoint itself; a tool's former failures say nothing any more afterwards."""
    leaves = False
    """Exchanges what is served before it is proved."""

    @property
    def quick(self) -> bool:
        """Done in a moment, and cheap: the bound of an hour is that of what comes back again and again."""
        return self.lane is not Lane.STAND

    def preconditions(self, facts: Facts, *, paused: bool, ours: bool) -> Iterator[Reason]:
        """What speaks against it now. ``ours``: what keeps the state busy is a repair of this daemon.

        An emergency stop is no fault and a person's stop is none, an apply under way is waited for, and no one repairs
        what another repair is just changing.
        """
        if paused:
            yield Reason("loop.paused", "paused by a person")
        if facts.busy is not None and not ours:
            yield Reason("loop.busy", f"{facts.busy} is under way")
        if facts.stopped_by is not None and self.lane is not Lane.ROOM:
            yield Reason("loop.stopped", f"stopped by {facts.stopped_by}")
        if facts.latched and self.moves:
            yield Reason("loop.estop", "an emergency stop is engaged")

    def cost(self, attempts: int, calls_per_hour: int) -> int:
        """How many runs of agents it counts as until its end is known."""
        return (calls_per_hour if self.moves else attempts) if self.asks_agent else 0

    def brief(self, finding: Finding, _means: Means) -> Mapping[str, Any]:
        """What the child is given beside the host."""
        given = finding.data.get("brief")
        return given if isinstance(given, Mapping) else {}

    def run(self, finding: Finding, means: Means) -> RepairOutcome:
        """Carry it out once; blocking, bounded in time, and never raises for what the world does."""
        brief = {"host": means.host, **self.brief(finding, means)}
        outcome = RepairOutcome.from_json(means.run(self.name.value, brief, self.seconds))
        if outcome.cost is None:
            self.roll_back(means)
        return outcome

    def work(self, given: Order) -> RepairOutcome:
        """The work itself, in the child; what is heavy is imported here."""
        raise NotImplementedError

    def verify(self, *, present: bool, diagnosed: bool) -> Reason | None:  # noqa: ARG002 - of WATCH
        """Why it did not help: the problem is ``present`` in the next facts; ``diagnosed``: an agent has named it."""
        return Reason("check.still-there", "the problem is still there") if present else None

    def roll_back(self, means: Means) -> None:
        """Settle what a child that was killed has left in service, before anybody looks again."""
        if self.leaves:
            means.run(SETTLE, {"host": means.host}, SETTLE_SECONDS)

    def rediscovers(self, _outcome: RepairOutcome) -> bool:
        """True for a try that was a re-discovery, or that asked for one."""
        return False


class Restart(RepairKind):
    """Start the endpoint's process again."""

    name, seconds, lane, exchanges = Repair.RESTART, 150.0, Lane.PROCESS, False

    def brief(self, finding: Finding, _: Means) -> Mapping[str, Any]:
        """Whether the process hangs."""
        return {"hung": finding.kind is Kind.PROCESS_HUNG}

    def run(self, finding: Finding, means: Means) -> RepairOutcome:
        """In this thread where that is possible."""
        if means.restart is not None:
            return means.restart(finding.kind is Kind.PROCESS_HUNG)
        return super().run(finding, means)

    def work(self, given: Order) -> RepairOutcome:
        """See `octoform.daemon.repair.restart`."""
        from octoform.daemon.repair.restart import restart

        return restart(given.layout, hung=bool(given.brief.get("hung")))


class Restore(RepairKind):
    """Put the accepted artifacts back."""

    name, seconds = Repair.RESTORE, 90.0

    def work(self, given: Order) -> RepairOutcome:
        """See `octoform.engine.unattended.repairs`."""
        from octoform.engine.unattended.repairs import restore

        return restore(given.layout)


class Republish(RepairKind):
    """Write the endpoint's own files again, and check it."""

    name, seconds = Repair.REPUBLISH, 240.0

    def work(self, given: Order) -> RepairOutcome:
        """What a killed repair has left is settled instead, where there is any."""
        from octoform.engine.unattended.heal import settle
        from octoform.engine.unattended.repairs import republish

        return settle(given.layout, given.environ) or republish(given.layout)


class Rebuild(RepairKind):
    """Build the serving environment from its lock again."""

    name, seconds = Repair.REBUILD, 720.0

    def work(self, given: Order) -> RepairOutcome:
        """See `octoform.engine.unattended.repairs`."""
        from octoform.engine.unattended.repairs import rebuild

        return rebuild(given.layout)


class Rebind(RepairKind):
    """Write down where a device is now."""

    name, seconds, lane, exchanges = Repair.REBIND, 90.0, Lane.ROOM, False

    def brief(self, finding: Finding, _: Means) -> Mapping[str, Any]:
        """The device."""
        return {"device": finding.target.partition(":")[2]}

    def work(self, given: Order) -> RepairOutcome:
        """See `octoform.daemon.repair.upkeep`."""
        from octoform.daemon.repair.upkeep import rebind

        return rebind(given.layout, str(given.brief["device"]))


class Rotate(RepairKind):
    """Archive a log that has grown large; on a full disk, make room."""

    name, seconds, lane, exchanges = Repair.ROTATE, 120.0, Lane.ROOM, False

    def brief(self, finding: Finding, _: Means) -> Mapping[str, Any]:
        """The log; none where it is the disk that is full."""
        return {} if finding.kind is Kind.DISK_FULL else {"log": finding.target.partition(":")[2]}

    def work(self, given: Order) -> RepairOutcome:
        """See `octoform.daemon.repair.upkeep`."""
        from octoform.daemon.repair.upkeep import free, rotate

        log = given.brief.get("log")
        return free(given.layout) if log is None else rotate(given.layout, str(log))


class Rediscover(RepairKind):
    """PROBE and what depends on it again, all or nothing."""

    name, seconds, asks_agent, moves, leaves = Repair.REDISCOVER, 3600.0, True, True, True

    def brief(self, finding: Finding, means: Means) -> Mapping[str, Any]:
        """What is left of the hour, and whether it may be done unasked."""
        return {**super().brief(finding, means), "apply": means.apply}

    def work(self, given: Order) -> RepairOutcome:
        """See `octoform.engine.unattended.rediscover`."""
        from octoform.engine.unattended.rediscover import Left, rediscover

        apply = str(given.brief.get("apply") or "ask")
        return rediscover(given.layout, given.environ, apply=apply, left=Left.of(given.brief))

    def rediscovers(self, _outcome: RepairOutcome) -> bool:
        """It is one."""
        return True


class Watch(RepairKind):
    """Ask the agent of WATCH what is wrong."""

    name, seconds, asks_agent, exchanges = Repair.WATCH, 900.0, True, False

    def work(self, given: Order) -> RepairOutcome:
        """See `octoform.engine.unattended.session`."""
        from octoform.engine.unattended.session import diagnose

        return diagnose(given.layout.project, given.environ, given.brief)

    def verify(self, *, present: bool, diagnosed: bool) -> Reason | None:
        """A diagnosis is all that it is asked for."""
        return super().verify(present=present and not diagnosed, diagnosed=diagnosed)


class Heal(RepairKind):
    """Ask the agent of HEAL for a repair; it is on probation until everything has been read again."""

    name, seconds, asks_agent, moves, leaves = Repair.HEAL, 2400.0, True, True, True

    def work(self, given: Order) -> RepairOutcome:
        """See `octoform.engine.unattended.heal`."""
        from octoform.engine.unattended.heal import heal

        return heal(given.layout.project, given.environ, given.brief)

    def rediscovers(self, outcome: RepairOutcome) -> bool:
        """Where that is what the agent asked for."""
        return (outcome.report or {}).get("action") == Repair.REDISCOVER


class RollBack(RepairKind):
    """Take back what HEAL changed."""

    name, seconds, leaves = Repair.ROLL_BACK, 300.0, True

    def work(self, given: Order) -> RepairOutcome:
        """See `octoform.engine.unattended.heal`."""
        from octoform.engine.unattended.heal import roll_back

        return roll_back(given.layout.project, given.environ, given.brief)


_KINDS = (Restart, Restore, Republish, Rebuild, Rebind, Rotate, Rediscover, Watch, Heal, RollBack)
PLAYBOOK: Mapping[Repair, RepairKind] = {kind.name: kind() for kind in _KINDS}
"""Every repair that can be carried out; a name that is not here is waited for, or is a person's."""


def chain_of(finding: Finding) -> tuple[Repair, ...]:
    """The repairs that there are for a finding, in the order in which they are tried."""
    return tuple(repair for repair in (finding.repair, *finding.then) if repair in PLAYBOOK)


def limit_of(finding: Finding, most: int) -> int:
    """How many tries there are; fewer where the judge sends for a person after the last of its repairs."""
    return min(most, len(chain_of(finding))) if Repair.PERSON in finding.then else most


def carry_out(finding: Finding, repair: Repair, means: Means) -> RepairOutcome:
    """Do it once; what is no one's work is not done here."""
    kind = PLAYBOOK.get(repair)
    if kind is None:
        text = f"{repair} is no repair that can be carried out by itself"
        return RepairOutcome.refused("loop.no-repair", text, again=False)
    return kind.run(finding, means)
