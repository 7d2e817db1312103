"""Which repair is tried now, and what became of it: breakers before tries, facts before words. Light."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from octoform.claims.ledger import Ledger
from octoform.claims.model import Reading, Signal
from octoform.daemon.evidence import Evidence
from octoform.daemon.health import HealthSnapshot, snapshot, worse
from octoform.daemon.model import Cause, Done, Facts, FaultClass, Finding, Kind, Outcome, Ports, Repair
from octoform.daemon.notices import hint
from octoform.daemon.reconcile.incidents import OpenIncidents
from octoform.daemon.reconcile.repair_policy import (
    APPLYING,
    GRACE_SECONDS,
    QUICK,
    Bench,
    Ended,
    Lane,
    Product,
    Task,
    Work,
    barred,
    busy_with_ours,
    chain_of,
    concerns_process,
    lane_of,
    limit_of,
    most_in_hour,
    rediscovers,
    swaps,
)
from octoform.daemon.signals import unread
from octoform.daemon.store.agent_budget import ATTEMPTS, Entry
from octoform.daemon.store.incidents import Incident, Try
from octoform.daemon.store.memory import Memory
from octoform.daemon.triage.agent_report import findings_of, summary_of

# HEAL on probation: what it changed counts only once everything has been read again, and nothing reads worse. Light.
#
# The health before the repair is compared at each look, from the end of the repair until all that is promised to
# report has been read once more after it. The readings that the repair itself asks for are the first, and not enough. A
# device that somebody unplugs meanwhile, and a process that ends once, prove nothing against a rewritten function:
# they are waited for.

MAX_ENDS = 2
"""Ends of the endpoint's process during a probation at which the repair is taken for their cause."""
_AFTER = 0.001
"""Seconds: readings of the very moment in which the repair ended are its own."""


@dataclass(slots=True)
class Tried:
    """A repair on probation: its problem, the health before it, since when (uptime), in which process."""

    finding: Finding
    before: HealthSnapshot
    since: float
    process: str | None
    ends: int = 0


@dataclass(slots=True)
class Probation:
    """The repairs of HEAL that no one knows yet to hold, by the key of their problem."""

    tried: dict[str, Tried] = field(default_factory=dict)

    def begin(self, key: str, finding: Finding, before: HealthSnapshot, facts: Facts) -> None:
        """A repair has ended, by its own word well."""
        self.tried[key] = Tried(finding, before, facts.uptime + _AFTER, _process(facts))

    def judge(
        self, facts: Facts, now: HealthSnapshot, promised: Callable[[], Iterable[Signal]], readings: Iterable[Reading]
    ) -> list[tuple[Finding, str]]:
        """The repairs after which something is worse, and what; those that have held are on probation no more."""
        found, known = [], tuple(readings)
        for key, tried in list(self.tried.items()):
            why = _worse(tried, facts, now)
            if why is not None:
                found.append((tried.finding, why))
            elif not _settled(tried, facts) or unread(promised(), known, tried.since):
                continue
            del self.tried[key]
        return found


def _worse(tried: Tried, facts: Facts, now: HealthSnapshot) -> str | None:
    process = _process(facts)
    if process is not None and process != tried.process:
        tried.ends += tried.process is not None
        tried.process, tried.since = process, max(tried.since, facts.uptime + _AFTER)
    if tried.ends >= MAX_ENDS:
        return f"the endpoint's process ended {tried.ends} times"
    if not _settled(tried, facts):
        return None
    # A missing reading of an absent device is no evidence; a tool that fails for it is known by its error elsewhere.
    return worse(replace(tried.before, there=frozenset()), now)


def _settled(tried: Tried, facts: Facts) -> bool:
    """Whether the deployment can be compared now: the process is there, and so are the devices that were."""
    there = {name for name, each in facts.devices.items() if each.there}
    return facts.process is not None and facts.answers is not False and tried.before.there <= there


def _process(facts: Facts) -> str | None:
    return facts.process.instance if facts.process is not None else None


# While an agent works, only the daemon may change the daemon's own files: its memory, and the ledger of claims.
#
# An agent of the same account could write them. What the daemon knows is written again, and what the agent reports then
# counts for nothing. A person decides about claims before or afterwards (`octoform.daemon.requests`
# reports it). Light.


@dataclass(slots=True)
class Untouched:
    """Watches the files of one daemon; one agent works at a time, or several under one guard."""

    memory: Memory
    ledger: Ledger
    _at_work: int = 0

    def begin(self) -> None:
        """An agent is about to be asked: what changed until now was changed by others."""
        if not self._at_work:
            self.ledger.expire()  # takes up what a person decided
            self.memory.reclaim()
            self.memory.shelf.strange.clear()
            self.ledger.strange = 0
            self.ledger.guarded = True
        self._at_work += 1

    def end(self, done: Done) -> Done:
        """It has ended: its word, or that it is refused."""
        self.ledger.expire()
        self.memory.reclaim()
        names = sorted(self.memory.shelf.strange) + ["the ledger of claims"] * bool(self.ledger.strange)
        self._at_work -= 1
        self.ledger.guarded = self._at_work > 0
        if not names:
            return done
        text = f"refused: while the agent was at work, somebody changed {', '.join(names)} ({done.detail})"
        return replace(done, ok=False, report=None, findings=(), detail=text)


AUTO = "auto"
AGENTS = frozenset({Repair.WATCH, Repair.HEAL, Repair.REDISCOVER})
"""Repairs that may call a model."""
CHANGING = frozenset(
    {Repair.HEAL, Repair.REBUILD, Repair.RESTORE, Repair.REPUBLISH, Repair.REDISCOVER, Repair.ROLL_BACK}
)
"""Repairs after which a tool's former failures say nothing any more, and after which fresh readings are taken."""

_WHOLE = " whole"


@dataclass(slots=True)
class Waits:
    """The repairs that wait: why, by key; and when the next try is due (uptime)."""

    why: dict[str, str] = field(default_factory=dict)
    due: list[float] = field(default_factory=list)


@dataclass(slots=True)
class Trying:
    """Begins repairs and draws the conclusions."""

    ports: Ports
    memory: Memory
    problems: OpenIncidents
    evidence: Evidence
    bench: Bench
    word_seconds: float
    """How long an agent's word holds without evidence of our own."""
    apply: str = AUTO
    """The manifest's ``daemon.apply``: ``auto`` or ``ask``."""
    awaiting: dict[str, tuple[Task, Done]] = field(default_factory=dict)
    tried: list[tuple[Incident, Try]] = field(default_factory=list)
    untouched: Untouched = field(init=False)
    probation: Probation = field(default_factory=Probation)
    _before: dict[str, HealthSnapshot] = field(default_factory=dict)
    _entries: dict[str, Entry] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Set up the guard of the daemon's own files for the time an agent works."""
        self.untouched = Untouched(self.memory, self.evidence.ledger)

    def held(self) -> frozenset[str]:
        """Keys of problems whose repair is under way, or ended and not judged by facts yet."""
        under_way = {task.key for task in self.bench.under_way() if task.finding is not None}
        return frozenset(under_way | set(self.awaiting))

    def begin(self, findings: Iterable[Finding], facts: Facts, causes: frozenset[Cause], paused: bool) -> Waits:
        """Begin every repair that is due and may be made."""
        waits = Waits()
        for finding in findings:
            acting = self.problems.acting(finding)
            why = self._standing(finding, acting, facts)
            why = self._bar(finding, acting, facts, waits, paused) if why is None else why
            why = self._start(finding, acting, facts, causes) if why is None else why
            if why:
                waits.why[finding.key] = why
        return waits

    def conclude(self, ended: Iterable[Ended], facts: Facts) -> None:
        """Write down what ended works made; whether it helped is seen from the look after this."""
        for item in ended:
            done = item.product.done
            if done is not None and item.task.repair in AGENTS:
                done = self._heard(item.task, done, facts)
            self.evidence.take(item.product.readings)
            if done is not None and item.task.finding is not None and item.task.repair is not None:
                self._made(item, item.task.finding, item.task.repair, done, facts)

    def verdicts(self, findings: Iterable[Finding], facts: Facts, within: Callable[[Kind, str], bool]) -> None:
        """Whether the repairs that ended helped: the problem is gone, or it is not."""
        present = {finding.key: finding for finding in findings}
        for key, (task, done) in list(self.awaiting.items()):
            acting = task.finding
            assert acting is not None
            if not within(acting.kind, acting.target):
                continue
            del self.awaiting[key]
            diagnosed = task.repair is Repair.WATCH and self.problems.diagnosed(key)
            if key in self.problems.reported and done.ok:
                del self.problems.reported[key]  # no look gives it again, so the word is all there is
            elif key in present and not diagnosed:
                self.memory.breakers.failed(
                    acting.key,
                    facts.uptime,
                    chain=chain_of(acting),
                    limit=self._limit(acting),
                    stamp=facts.stamp,
                    hopeless=None if done.again else task.repair,
                )
                if not done.again and rediscovers(task.repair, done):
                    self.memory.breakers.under(acting.key, self._terms(facts))
        self._prove(facts)

    def _standing(self, finding: Finding, acting: Finding, facts: Facts) -> str | None:
        """Empty or a reason when there is nothing to try for it; None when there is."""
        if acting.repair is Repair.PERSON:
            self.problems.set_outcome(
                finding, Outcome.SURFACED, facts, acting.detail[:300] or "a person has to look at it"
            )
            return "waits for a person"
        if not chain_of(acting):
            return ""
        breaker = self.memory.breakers.of(acting.key)
        frozen = breaker.frozen or self.memory.breakers.of(finding.key).frozen
        if frozen and breaker.terms and self.apply == AUTO and self._allows_more(breaker.terms, facts):
            self.problems.goes_on(finding, acting)
            return None
        if frozen is None and finding.key in self.held():
            return None
        if frozen is None and breaker.tries >= self._limit(acting):
            frozen = f"{breaker.tries} tries did not help"  # one that ended with its daemon is one of them
            self.memory.breakers.freeze(acting.key, acting.target, frozen, facts.stamp)
        if frozen is None and (frozen := self._too_often(acting, facts)) is not None:
            if acting is finding:
                finding = acting = self.problems.broaden(finding)
            self.memory.breakers.freeze(acting.key, acting.target, frozen, facts.stamp)
        if frozen is None:
            return None
        text = f"{frozen}; {hint(finding.kind, finding.target)}"
        self.problems.set_outcome(finding, Outcome.FROZEN, facts, text)
        return f"given up: {frozen}"

    def _bar(self, finding: Finding, acting: Finding, facts: Facts, waits: Waits, paused: bool) -> str | None:
        """Why the next repair is not made now; None when it is. Also notes in ``waits`` when it will be due."""
        repair = self._next(acting)
        tasks = self.bench.under_way()
        if why := barred(repair, facts, paused, ours=busy_with_ours(facts, tasks)):
            return why
        if finding.key in self.held() or any(_same(task, finding.target) for task in tasks):
            return "a repair of it is under way"
        if any(task.lane is lane_of(repair) for task in tasks):
            return "another repair is under way"
        times = [self.memory.breakers.of(acting.key).next, self._grace(finding, tasks)]
        if repair in AGENTS:
            times.append(self.memory.purse.free_at(facts.uptime, facts.stamp) or 0.0)
        due = max(times)
        if facts.uptime >= due:
            return None
        waits.due.append(due)
        spent = repair in AGENTS and due == times[-1]
        return "the hour's agent calls are spent" if spent else f"{repair} is tried again later"

    def _grace(self, finding: Finding, tasks: tuple[Task, ...]) -> float:
        """A repair of ours that exchanges the endpoint may have it away for a moment."""
        missed = self.memory.episodes.open[finding.key].opened_uptime
        if not concerns_process(finding.kind, finding.target) or not any(swaps(task, missed) for task in tasks):
            return 0.0
        return missed + GRACE_SECONDS

    def _next(self, acting: Finding) -> Repair:
        return self.memory.breakers.of(acting.key).next_of(chain_of(acting))

    def _limit(self, acting: Finding) -> int:
        return limit_of(acting, self.memory.breakers.limit)

    def _too_often(self, acting: Finding, facts: Facts) -> str | None:
        """Why a target and class have had enough tries for an hour, whatever their evidence; None: they have not."""
        repair, breakers = self._next(acting), self.memory.breakers
        made = len(breakers.in_hour(acting.key, facts.uptime, quick=repair in QUICK))
        return f"{made} tries in an hour" if made >= most_in_hour(repair, breakers.limit) else None

    def _terms(self, facts: Facts) -> str:
        """The manifest's budget for a re-discovery, and whether all of it is left of this hour."""
        purse = self.memory.purse
        now, stamp = facts.uptime, facts.stamp
        whole = (purse.left(now, stamp), purse.usd_left(now, stamp)) == (purse.calls_per_hour, purse.usd_per_hour)
        return f"{self.apply} {purse.calls_per_hour} {purse.usd_per_hour}{_WHOLE if whole else ''}"

    def _allows_more(self, before: str, facts: Facts) -> bool:
        """Whether what made a question does so no more: the manifest is another, or the hour is as good as new."""
        now = self._terms(facts)
        return before.removesuffix(_WHOLE) != now.removesuffix(_WHOLE) or len(before) < len(now)

    def _start(self, finding: Finding, acting: Finding, facts: Facts, causes: frozenset[Cause]) -> str:
        """Begin it; empty, or why it may not begin after all."""
        repair, purse = self._next(acting), self.memory.purse
        left = {"calls": purse.left(facts.uptime, facts.stamp), "usd": purse.usd_left(facts.uptime, facts.stamp)}
        if repair in AGENTS:
            most = purse.calls_per_hour if repair in APPLYING else ATTEMPTS
            entry = purse.begin(facts.uptime, facts.stamp, most)
            if entry is None:
                return "what agents are asked cannot be written down, so none is"
            self._entries[finding.key] = entry
        self.memory.breakers.begin(acting.key, acting.target, facts.uptime, quick=repair in QUICK)
        if repair in AGENTS:
            self.untouched.begin()
        if repair is Repair.HEAL:
            self._before[finding.key] = self._health(facts)
        data = self._brief(finding, acting, repair, facts, causes)
        if isinstance(brief := data.get("brief"), dict):
            data["brief"] = {**brief, **left}
        asked = replace(acting, data={**acting.data, **data})
        task = Task(lane_of(repair), asked, repair, finding.key, facts.stamp, facts.uptime)
        self.bench.begin(task, self._work(asked, repair))
        return ""

    def _brief(
        self, finding: Finding, acting: Finding, repair: Repair, facts: Facts, causes: frozenset[Cause]
    ) -> dict[str, object]:
        episode = self.memory.episodes.open[finding.key].id
        if repair is Repair.WATCH:
            return {"episode": episode, "brief": self.evidence.brief(acting, causes, self.memory, facts)}
        if repair is Repair.HEAL:
            return {"episode": episode, "brief": self.evidence.healing(acting, episode, self.memory)}
        return {"episode": episode, **({"brief": {}} if repair is Repair.REDISCOVER else {})}

    def _work(self, finding: Finding, repair: Repair) -> Work:
        ports = self.ports

        def work() -> Product:
            done = ports.repair(finding, repair)
            readings: tuple[Reading, ...] = ()
            if done.ok and repair in CHANGING:
                readings = tuple(ports.sample())
            return Product(done, readings)

        return work

    def _made(self, item: Ended, acting: Finding, repair: Repair, done: Done, facts: Facts) -> None:
        key = item.task.key
        spent = done.spent
        if (entry := self._entries.pop(key, None)) is not None and not done.untold:
            self.memory.purse.settle(entry, spent)
        made = Try(repair.value, item.task.stamp, done.ok, done.detail, round(item.seconds, 3))
        episode = self.memory.episodes.open.get(key)
        if episode is not None:
            self.memory.episodes.tried(episode, made, spent)
            self.tried.append((episode, made))
        if done.report is not None and repair in (Repair.WATCH, Repair.HEAL):
            self._offer(done, repair, facts)
        if done.asked:
            self.problems.alert("asks", acting.target, done.detail[:600], facts, "octoform apply")
        if repair is Repair.WATCH and done.ok:
            self._diagnosed(key, acting, done, facts)
        if done.ok:
            self._forget(acting, repair)
        self.awaiting[key] = (item.task, done)

    def _offer(self, done: Done, repair: Repair, facts: Facts) -> None:
        pending, refused = self.evidence.offer(done.report or {}, repair.value)
        if repair is Repair.WATCH:
            self.memory.keep_report(replace(self.memory.report, summary=summary_of(done.report)))
        self.memory.shelf.said.extend(refused)
        for claim in pending:
            hint = f"octoform confirm {claim.id}, or octoform confirm {claim.id} -reject"
            self.problems.alert("confirm", claim.target, f"{claim.kind} {claim.id}: {claim.statement}", facts, hint)

    def _diagnosed(self, key: str, asked: Finding, done: Done, facts: Facts) -> None:
        """WATCH's report on the problem that it was asked about is its diagnosis; the rest are others."""
        found = list(done.findings or (findings_of(done.report, facts) if done.report is not None else ()))
        own = next((each for each in found if each.target == asked.target), found[0] if found else None)
        if own is None:
            return
        self.problems.diagnose(key, own)
        self.memory.breakers.seen(own.key, own.target, facts.uptime, facts.stamp)
        for each in found:
            if each is not own and each.key not in self.memory.episodes.open:
                self.problems.report(each, facts.uptime + self.word_seconds)

    def _forget(self, acting: Finding, repair: Repair) -> None:
        """Failures of code that is exchanged now are no evidence against what took its place.

        What was given up before stays: it was another problem, and only a call that works shows that it is over.
        """
        recall = self.memory.recall
        if repair in CHANGING:
            given_up = set() if repair is Repair.REDISCOVER else self._given_up() - {acting.target}
            kept = {name: each for name, each in recall.failing.items() if f"tool:{name}" in given_up}
            self.memory.keep(replace(recall, failing=kept))
        elif repair is Repair.RESTART and acting.data.get("tool") in recall.failing:
            tool = acting.data["tool"]
            self.memory.keep(
                replace(recall, failing={name: each for name, each in recall.failing.items() if name != tool})
            )

    def _given_up(self) -> set[str]:
        """Targets of problems that wait for a person."""
        waiting = (Outcome.FROZEN, Outcome.SURFACED)
        return {each.target for each in self.memory.episodes.open.values() if each.outcome in waiting}

    def _health(self, facts: Facts) -> HealthSnapshot:
        failing = {name: each.times for name, each in self.memory.recall.failing.items()}
        return snapshot(facts, self.evidence.ledger.latest(), failing=failing)

    def _heard(self, task: Task, said: Done, facts: Facts) -> Done:
        """The result of an agent's run; void when the daemon's own files were changed meanwhile."""
        done, before = self.untouched.end(said), self._before.pop(task.key, None)
        if task.finding is None or task.repair is not Repair.HEAL or not said.ok:
            return done
        if done.ok and before is not None:
            self.probation.begin(task.key, task.finding, before, facts)
        elif not done.ok and (said.report or {}).get("action") == "rewrite":
            self._take_back(task.finding, "the daemon's own files were changed while its agent was at work", facts)
        return done

    def _prove(self, facts: Facts) -> None:
        """Roll HEAL's change back when the readings after it are worse than those before."""
        if not self.probation.tried:
            return
        latest = self.evidence.ledger.latest()
        for finding, why in self.probation.judge(facts, self._health(facts), self.ports.promised, latest):
            self._take_back(finding, why, facts)

    def _take_back(self, acting: Finding, why: str, facts: Facts) -> None:
        episode = acting.data.get("episode")
        finding = Finding(
            kind=Kind.TOOL_FAILING,
            fault=FaultClass.BROKEN_TOOL,
            target=acting.target,
            summary=f"after HEAL it is worse than before: {why}",
            evidence=("worse after heal", str(episode)),
            repair=Repair.ROLL_BACK,
            then=(Repair.ROLL_BACK, Repair.PERSON),
            data={"brief": {"episode": episode, "reason": why}, "episode": episode},
        )
        self.problems.report(finding, facts.uptime + self.word_seconds)
        self.memory.breakers.freeze(acting.key, acting.target, f"HEAL made it worse: {why}", facts.stamp)


def _same(task: Task, target: str) -> bool:
    return task.lane is not Lane.SENSES and task.finding is not None and task.finding.target == target
