"""The loop: look, judge, repair, look again. It decides when, never how; everything it touches is behind a port.

A check cycle is short whatever it begins: repairs and readings are made beside it (`bench`), one at a time for each
target, and their end is a reason for the next check cycle. Nothing is believed of a repair but what the next facts
show. Light.
"""

from collections.abc import Callable, Mapping

from octoform.apply.repair_outcome import RepairOutcome
from octoform.claims.ledger import Ledger
from octoform.claims.model import Signal
from octoform.daemon.evidence import Evidence
from octoform.daemon.health import Health
from octoform.daemon.model import Cause, Facts, Finding, Kind, Ports
from octoform.daemon.reconcile.bench import (
    PROCESS,
    Bench,
    Product,
    Task,
    busy_with_ours,
    concerns_process,
)
from octoform.daemon.reconcile.incidents import OpenIncidents
from octoform.daemon.reconcile.repairs import Trying, Waits
from octoform.daemon.repair.playbook import Lane
from octoform.daemon.status_file import FRESH_SECONDS, Bulletin
from octoform.daemon.store import instance_lock
from octoform.daemon.store.incidents import Incident
from octoform.daemon.store.memory import Memory
from octoform.daemon.triage import judge, remember
from octoform.daemon.triage.process import LEAST_FREE
from octoform.diagnostics import Diagnostic
from octoform.manifest.model import Daemon
from octoform.records import dataclass, field, replace
from octoform.state.files import refused

SAMPLING = frozenset({Cause.START, Cause.INTERVAL, Cause.RESUMED, Cause.ASKED})
"""When read tools are called: not at each event."""
AFTER = frozenset({Cause.RETRY, Cause.PROCESS, Cause.HARDWARE, Cause.FILES, Cause.PING, Cause.LOG})
"""The parts to observe after a repair: all that it may have changed."""
QUIET = frozenset({Cause.PING})
READ = QUIET | {Cause.LOG}
"""What is looked at after readings: a tool that could not be read has left a line in the log, and both are one problem.
"""
BACK = PROCESS | {Kind.DEVICE_GONE, Kind.DEVICE_BACK}
"""Problems at whose end something reports again that was silent: read once, or health would stay unknown for long."""
MAX_PASSES = 12
LEAST_WAIT = 0.05


@dataclass(frozen=True, slots=True)
class Cycle:
    """The observations and actions of one check cycle. ``due`` is when the next try is (uptime; None: none is timed).

    ``waits`` gives, by key, why a repair is not made now, ``refused`` those of which that is new. ``problems`` is what
    could not be read, written or believed.
    """

    causes: frozenset[Cause]
    facts: Facts
    findings: tuple[Finding, ...] = ()
    opened: tuple[Incident, ...] = ()
    ended: tuple[Incident, ...] = ()
    begun: tuple[Task, ...] = ()
    tried: tuple[tuple[Incident, RepairOutcome], ...] = ()
    refused: tuple[tuple[Incident, RepairOutcome], ...] = ()
    waits: dict[str, str] = field(default_factory=dict)
    due: float | None = None
    health: Health | None = None
    paused: str | None = None
    problems: tuple[Diagnostic, ...] = ()


View = Callable[[Cycle], None]
"""Anyone who shows what the daemon does; called at the end of each check cycle."""


def _no_view(_made: Cycle) -> None:
    """No one is shown anything."""


class Supervisor:
    """One deployment's daemon. `round` may be called by itself; `run` goes on until `stop`."""

    def __init__(
        self, ports: Ports, memory: Memory, settings: Daemon, ledger: Ledger, bench: Bench, view: View = _no_view
    ) -> None:
        """``bench`` states where repairs are made: `bench.Beside` in life, `bench.AtOnce` in virtual time."""
        self._ports = ports
        self._memory = memory
        self._bench = bench
        self._view = view
        self._evidence = Evidence(ledger, ports.promised)
        self._incidents = OpenIncidents(memory, ports.notify, ports.clock.uptime())
        word = float(settings.claim_seconds)
        self._trying = Trying(ports, memory, self._incidents, self._evidence, bench, word, settings.apply)
        self._post = Bulletin(memory, self._evidence, 3.0 * settings.interval)
        self._facts: Facts | None = None
        self._seen: Facts | None = None
        self._last: Cycle | None = None
        self._read: tuple[str, frozenset[Signal]] = ("", frozenset())
        self._waits = Waits()
        self._left_out = False
        self._stopping = False

    def stop(self) -> None:
        """Let `run` end; may be called by a signal's handler or another thread."""
        self._stopping = True
        self._ports.sources.rouse()

    def report(self, problem: Diagnostic) -> None:
        """Let the next check cycle report this."""
        self._memory.shelf.said.append(problem)

    def run(self, once: bool = False) -> None:
        """Check cycles until `stop`; with ``once`` until nothing is due and nothing is under way."""
        made: Cycle | None = self.round(frozenset({Cause.START}))
        while not self._stopping:
            if once and made is not None and not (self._bench.under_way() or self._bench.waiting() or self._soon(made)):
                return
            made = self.step()

    def step(self) -> Cycle | None:
        """Wait for the next reason for a check cycle, and make it; None when there was nothing to be done after all."""
        causes = self._next_causes()
        return self.round(causes) if causes and not self._stopping else None

    def round(self, causes: frozenset[Cause]) -> Cycle:
        """One check cycle; returns when what can be begun is begun, and what ended by then is judged."""
        if causes <= QUIET and (same := self._unchanged(causes)) is not None:
            return same
        paused = instance_lock.paused_since(self._memory.shelf.layout)
        self._asked()
        self._left_out = False
        begun: list[Task] = []
        sampled = False
        facts, findings = self._looked(causes)
        for _ in range(MAX_PASSES):
            before = {id(task) for task in self._bench.under_way()}
            self._waits = self._trying.begin(findings, facts, causes, paused is not None)
            if not sampled and (causes & SAMPLING or self._unread(facts)):
                sampled = self._sample(facts)
            begun += [task for task in self._bench.under_way() if id(task) not in before]
            ended = self._bench.ended()
            if not ended:
                break
            self._trying.conclude(ended, facts)
            repaired = any(item.task.finding is not None for item in ended)
            facts, findings = self._looked(AFTER if repaired else READ)
        if not sampled and any(each.kind in BACK for each in self._incidents.ended):
            self._sample(facts)
        return self._over(causes, facts, findings, begun, paused)

    def _unchanged(self, causes: frozenset[Cause]) -> Cycle | None:
        """A check cycle without work, where a question whether the endpoint answers gave what was known; else None.

        Most check cycles of a quiet night are such ones, so they have to cost nothing.
        """
        before, last = self._facts, self._last
        if before is None or last is None or self._bench.waiting() or self._trying.awaiting:
            return None
        facts = self._seen or self._ports.look(causes)
        self._seen = facts
        calm = not (facts.failures or facts.worked or facts.printed)
        due = self._due()
        quiet = due is None or facts.uptime < due
        fresh = facts.uptime - last.facts.uptime < FRESH_SECONDS
        if not (calm and quiet and fresh and _essence(facts) == _essence(before)):
            return None
        self._seen = None
        return replace(
            last, causes=causes, facts=facts, opened=(), ended=(), begun=(), tried=(), refused=(), problems=()
        )

    def _looked(self, causes: frozenset[Cause]) -> tuple[Facts, tuple[Finding, ...]]:
        """Look, judge, and let incidents begin and end."""
        if early := self._bench.ended():  # what ended between two cycles
            self._trying.conclude(early, self._facts or self._ports.look(causes))
            causes |= AFTER if any(item.task.finding is not None for item in early) else READ
        # Before the look: a repair that ends while it is made is judged by the next one, and not lost between the two.
        busy = frozenset(task.key for task in self._bench.under_way() if task.finding is not None)
        before, facts = self._facts, self._seen or self._ports.look(causes)
        self._facts, self._seen = facts, None
        self._left_out |= bool(facts.put_off)
        self._incidents.causes = causes
        self._ports.sources.follow(facts)
        self._evidence.seen(facts)
        self._evidence.ledger.expire()
        self._memory.keep(remember(self._memory.recall, facts))
        ours = busy_with_ours(facts, self._bench.under_way())
        within: Callable[[Kind, str], bool] = _everything
        # Without its manifest an endpoint that was there is damaged, and no host without one.
        served = facts.applied or self._memory.recall.applied
        if not served or (facts.busy is not None and not ours):
            within = _nothing
        elif ours:
            within = concerns_process
        readings = self._evidence.current(self._memory.shelf.layout)
        given_up = frozenset(each.key for each in self._memory.breakers.frozen())
        seen = replace(facts, busy=None) if ours else facts
        judged = judge(seen, before, self._memory.recall, readings, given_up)
        self._trying.verdicts(self._incidents.present(judged, facts.uptime), facts, within)
        findings = tuple(
            each
            for each in self._incidents.present(judged, facts.uptime)
            if within(each.kind, each.target) and not self._incidents.is_being_ended(each, busy | self._trying.held())
        )
        self._incidents.settle(findings, facts, busy | self._trying.held(), within)
        self._memory.breakers.forgive(facts.uptime)
        return facts, findings

    def _over(
        self,
        causes: frozenset[Cause],
        facts: Facts,
        findings: tuple[Finding, ...],
        begun: list[Task],
        paused: str | None,
    ) -> Cycle:
        health = self._post(facts, self._waits.why, paused, self._ports.promised())
        opened, ended = self._incidents.taken()
        tried, refused = self._trying.taken()
        problems = (*self._memory.shelf.new_diagnostics(), *self._evidence.ledger.new_diagnostics())
        due = min(self._waits.due, default=None)
        made = Cycle(
            causes,
            facts,
            findings,
            opened,
            ended,
            tuple(begun),
            tried,
            refused,
            self._waits.why,
            due,
            health,
            paused,
            problems,
        )
        self._last = made
        self._view(made)
        return made

    def _sample(self, facts: Facts) -> bool:
        """Begin to take readings; True when that is done with for this check cycle.

        Another run of octoform at work on the host: the endpoint is asked as by any client, and an agent may take an
        hour.
        """
        if facts.process is None or facts.answers is False:
            return True
        if any(task.lane is Lane.SENSES for task in self._bench.under_way()):
            return True
        ports = self._ports
        self._read = facts.process.instance, ports.promised()
        task = Task(Lane.SENSES, None, None, "", None, facts.uptime)
        self._bench.begin(task, lambda: Product(None, tuple(ports.sample())))
        return True

    def _unread(self, facts: Facts) -> bool:
        """Whether another process serves now than the one that was read, or tools that no one has read since."""
        if facts.process is None or not facts.answers:
            return False
        instance, promised = self._read
        return facts.process.instance != instance or not self._ports.promised() <= promised

    def _asked(self) -> None:
        """Take a person's requests to retry; a request that cannot be taken waits, and is reported."""
        layout = self._memory.shelf.layout
        try:
            targets = instance_lock.taken_up(layout)
        except OSError as problem:
            self.report(refused(problem, layout.daemon / instance_lock.ASKED))
            return
        for target in targets:
            self._incidents.reopen(target)

    def _next_causes(self) -> frozenset[Cause]:
        """Wait for the next reason for a check cycle; none when there is nothing to be done after all."""
        due = self._due()
        seconds = None if due is None else max(LEAST_WAIT, due - self._ports.clock.uptime())
        causes = self._ports.sources.wait(seconds)
        if causes:
            return causes
        if due is not None and due <= self._ports.clock.uptime():
            return frozenset({Cause.RETRY})
        return frozenset({Cause.PING}) if self._bench.waiting() else frozenset()

    def _due(self) -> float | None:
        """When something is to be done by time alone (uptime): a try, the end of a claim."""
        return min((time for time in (*self._waits.due, self._evidence.due()) if time is not None), default=None)

    def _soon(self, made: Cycle) -> bool:
        """Whether the next check cycle would make a try, or look at what this one omitted."""
        return self._left_out or (made.due is not None and made.due <= self._ports.clock.uptime())


def _essence(facts: Facts) -> Facts:
    """The facts without what is another at each look and states nothing by itself."""
    fields = facts.reported or {}
    gate = fields.get("gate")
    kept = {"tunnel": fields.get("tunnel"), "stuck": gate.get("stuck") if isinstance(gate, Mapping) else None}
    return replace(facts, uptime=0.0, stamp="", reported=kept, disk_free=min(1, (facts.disk_free or 0) // LEAST_FREE))


def _everything(_kind: Kind, _target: str) -> bool:
    return True


def _nothing(_kind: Kind, _target: str) -> bool:
    return False
