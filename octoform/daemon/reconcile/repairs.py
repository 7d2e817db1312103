"""The loop of repairs: it decides, has them carried out, verifies them by facts, and has them rolled back. Light.

Breakers come before tries, and facts before words. What became of a repair is one `RepairOutcome` from the decision to
the incident's record; `octoform.daemon.repair.playbook` has what is particular to a kind of repair.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from octoform.apply.repair_outcome import Reason, RepairOutcome, RepairVerdict
from octoform.claims.ledger import Ledger
from octoform.claims.model import Reading
from octoform.daemon.evidence import Evidence
from octoform.daemon.health import HealthSnapshot, Probation, snapshot
from octoform.daemon.model import Cause, Facts, FaultClass, Finding, Kind, Outcome, Ports, Repair
from octoform.daemon.notices import hint
from octoform.daemon.reconcile.bench import (
    GRACE_SECONDS,
    Bench,
    Ended,
    Product,
    Task,
    Work,
    busy_with_ours,
    concerns_process,
    swaps,
)
from octoform.daemon.reconcile.incidents import OpenIncidents
from octoform.daemon.repair.playbook import PLAYBOOK, Lane, chain_of, limit_of
from octoform.daemon.store.agent_budget import ATTEMPTS, Entry
from octoform.daemon.store.backoff import FLAPS
from octoform.daemon.store.incidents import Incident
from octoform.daemon.store.memory import Memory
from octoform.daemon.triage.agent_report import findings_of, summary_of

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

    def end(self, outcome: RepairOutcome) -> RepairOutcome:
        """It has ended: its word, or that it counts for nothing."""
        self.ledger.expire()
        self.memory.reclaim()
        names = sorted(self.memory.shelf.strange) + ["the ledger of claims"] * bool(self.ledger.strange)
        self._at_work -= 1
        self.ledger.guarded = self._at_work > 0
        if not names:
            return outcome
        text = f"refused: while the agent was at work, somebody changed {', '.join(names)}"
        reasons = (Reason("loop.files-changed", text), *outcome.reasons)
        return replace(outcome, verdict=RepairVerdict.FAILED, report=None, reasons=reasons)


AUTO = "auto"
UNDER_WAY, LATER = "loop.under-way", "loop.later"
WAITING = (UNDER_WAY, LATER)
"""The rules of a repair that goes on by itself: no incident keeps them."""
EVIDENCES = 3
"""How many evidences of one target and class may have all of their tries within an hour."""
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
    awaiting: dict[str, tuple[Task, RepairOutcome]] = field(default_factory=dict)
    tried: list[tuple[Incident, RepairOutcome]] = field(default_factory=list)
    refused: list[tuple[Incident, RepairOutcome]] = field(default_factory=list)
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

    def taken(self) -> tuple[tuple[tuple[Incident, RepairOutcome], ...], tuple[tuple[Incident, RepairOutcome], ...]]:
        """What was tried, and what was refused for a new reason, since the last call."""
        found = tuple(self.tried), tuple(self.refused)
        self.tried, self.refused = [], []
        return found

    def begin(self, findings: Iterable[Finding], facts: Facts, causes: frozenset[Cause], paused: bool) -> Waits:
        """Decide on every problem, and begin every repair that is due and may be made."""
        waits = Waits()
        for finding in findings:
            decided = self._decided(finding, facts, waits, paused)
            if decided is not None and decided.verdict is RepairVerdict.UNDER_WAY:
                decided = self._start(finding, decided, facts, causes)
            if decided is not None and decided.verdict is RepairVerdict.REFUSED:
                waits.why[finding.key] = decided.reasons[0].text
                self._refused(finding, decided)
        return waits

    def conclude(self, ended: Iterable[Ended], facts: Facts) -> None:
        """Write down what ended works made; whether it helped is seen from the look after this."""
        for item in ended:
            task, outcome = item.task, item.product.outcome
            if task.repair is not None and task.decided is not None and outcome is not None:
                outcome = outcome.ended(task.decided, round(item.seconds, 3))
                if PLAYBOOK[task.repair].asks_agent:
                    outcome = self._heard(task, outcome, facts)
            self.evidence.take(item.product.readings)
            if outcome is not None and task.finding is not None and task.repair is not None:
                self._made(task, task.finding, task.repair, outcome, facts)

    def verdicts(self, findings: Iterable[Finding], facts: Facts, within: Callable[[Kind, str], bool]) -> None:
        """Whether the repairs that ended helped: the problem is gone, or it is not."""
        present = {finding.key: finding for finding in findings}
        for key, (task, outcome) in list(self.awaiting.items()):
            acting, repair = task.finding, task.repair
            assert acting is not None and repair is not None
            if not within(acting.kind, acting.target):
                continue
            del self.awaiting[key]
            if key in self.problems.reported and outcome.ok:
                del self.problems.reported[key]  # no look gives it again, so the word is all there is
                continue
            reason = PLAYBOOK[repair].verify(present=key in present, diagnosed=self.problems.diagnosed(key))
            if reason is None:
                continue
            if outcome.ok and (episode := self.memory.episodes.open.get(key)) is not None:
                self.memory.episodes.checked(episode.id, repair, reason, RepairVerdict.FAILED)
            self.memory.breakers.failed(
                acting.key,
                facts.uptime,
                chain=chain_of(acting),
                limit=self._limit(acting),
                stamp=facts.stamp,
                hopeless=None if outcome.again else repair,
            )
            if not outcome.again and PLAYBOOK[repair].rediscovers(outcome):
                self.memory.breakers.under(acting.key, self._terms(facts))
        self._prove(facts)

    def _decided(self, finding: Finding, facts: Facts, waits: Waits, paused: bool) -> RepairOutcome | None:
        """What is done about a problem now: a repair that may begin, or one that is refused; None: there is none."""
        acting = self.problems.acting(finding)
        if acting.repair is Repair.PERSON:
            text = acting.detail[:300] or "a person has to look at it"
            self.problems.set_outcome(finding, Outcome.SURFACED, facts, text)
            return _refusal(Repair.PERSON, facts, "loop.person", "waits for a person")
        if not chain_of(acting):
            return None
        repair = self._next(acting)
        if (frozen := self._given_up_for(finding, acting, facts)) is not None:
            return _refusal(repair, facts, "loop.given-up", f"given up: {frozen}")
        repair = self._next(acting)  # under other terms a problem that was given up begins again
        ours = busy_with_ours(facts, self.bench.under_way())
        reasons = tuple(PLAYBOOK[repair].preconditions(facts, paused=paused, ours=ours))
        if reasons:
            return RepairOutcome(RepairVerdict.REFUSED, reasons, repair.value, at=facts.stamp)
        return self._put_off(finding, acting, repair, facts, waits) or RepairOutcome(
            RepairVerdict.UNDER_WAY, repair=repair.value, at=facts.stamp
        )

    def _given_up_for(self, finding: Finding, acting: Finding, facts: Facts) -> str | None:
        """Why nothing is tried for it any more; None when something may be."""
        breaker = self.memory.breakers.of(acting.key)
        frozen = breaker.frozen or self.memory.breakers.of(finding.key).frozen
        if frozen and breaker.terms and self.apply == AUTO and self._allows_more(breaker.terms, facts):
            self.problems.goes_on(finding, acting)
            return None
        if frozen is None and finding.key not in self.held():
            frozen, finding = self._exhausted(finding, acting, facts)
        if frozen is not None:
            text = f"{frozen}; {hint(finding.kind, finding.target)}"
            self.problems.set_outcome(finding, Outcome.FROZEN, facts, text)
        return frozen

    def _exhausted(self, finding: Finding, acting: Finding, facts: Facts) -> tuple[str | None, Finding]:
        """Why its tries are used up (None: they are not), and the problem as it is known from then on."""
        tries = self.memory.breakers.of(acting.key).tries
        if tries >= self._limit(acting):
            why: str | None = f"{tries} tries did not help"  # one that ended with its daemon is one of them
        elif (why := self._too_often(acting, facts)) is not None and acting is finding:
            finding = acting = self.problems.broaden(finding)
        if why is not None:
            self.memory.breakers.freeze(acting.key, acting.target, why, facts.stamp)
        return why, finding

    def _put_off(
        self, finding: Finding, acting: Finding, repair: Repair, facts: Facts, waits: Waits
    ) -> RepairOutcome | None:
        """Why a repair that may be made is not made now; also notes in ``waits`` when it will be due."""
        tasks, kind = self.bench.under_way(), PLAYBOOK[repair]
        if finding.key in self.held() or any(_same(task, finding.target) for task in tasks):
            return _refusal(repair, facts, UNDER_WAY, "a repair of it is under way")
        if any(task.lane is kind.lane for task in tasks):
            return _refusal(repair, facts, "loop.lane", "another repair is under way")
        times = [self.memory.breakers.of(acting.key).next, self._grace(finding, tasks)]
        if kind.asks_agent:
            times.append(self.memory.purse.free_at(facts.uptime, facts.stamp) or 0.0)
        due = max(times)
        if facts.uptime >= due:
            return None
        waits.due.append(due)
        if kind.asks_agent and due == times[-1]:
            return _refusal(repair, facts, "loop.agent-calls", "the hour's agent calls are spent")
        return _refusal(repair, facts, LATER, f"{repair} is tried again later")

    def _refused(self, finding: Finding, refusal: RepairOutcome) -> None:
        """Note it with its incident, unless it only waits for its time, or the incident knows it."""
        open_ = self.memory.episodes.open
        episode = open_.get(finding.key) or open_.get(finding.broadly.key)
        waits = any(each.rule in WAITING for each in refusal.reasons)
        if episode is not None and not waits and self.memory.episodes.refused(episode, refusal):
            self.refused.append((episode, refusal))

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
        quick, breakers = PLAYBOOK[self._next(acting)].quick, self.memory.breakers
        made = len(breakers.in_hour(acting.key, facts.uptime, quick=quick))
        return f"{made} tries in an hour" if made >= (FLAPS if quick else EVIDENCES * breakers.limit) else None

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

    def _start(self, finding: Finding, decided: RepairOutcome, facts: Facts, causes: frozenset[Cause]) -> RepairOutcome:
        """Begin it; refused where it may not begin after all."""
        acting, repair, purse = self.problems.acting(finding), Repair(decided.repair), self.memory.purse
        kind = PLAYBOOK[repair]
        left = {"calls": purse.left(facts.uptime, facts.stamp), "usd": purse.usd_left(facts.uptime, facts.stamp)}
        if most := kind.cost(ATTEMPTS, purse.calls_per_hour):
            entry = purse.begin(facts.uptime, facts.stamp, most)
            if entry is None:
                text = "what agents are asked cannot be written down, so none is"
                return _refusal(repair, facts, "loop.not-written", text)
            self._entries[finding.key] = entry
        self.memory.breakers.begin(acting.key, acting.target, facts.uptime, quick=kind.quick)
        if kind.asks_agent:
            self.untouched.begin()
        if repair is Repair.HEAL:
            self._before[finding.key] = self._health(facts)
        data = self._brief(finding, acting, repair, facts, causes)
        if isinstance(brief := data.get("brief"), dict):
            data["brief"] = {**brief, **left}
        asked = replace(acting, data={**acting.data, **data})
        task = Task(kind.lane, asked, repair, finding.key, decided, facts.uptime)
        self.bench.begin(task, self._work(asked, repair))
        return decided

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
            outcome = ports.repair(finding, repair)
            readings: tuple[Reading, ...] = ()
            if outcome.ok and PLAYBOOK[repair].exchanges:
                readings = tuple(ports.sample())
            return Product(outcome, readings)

        return work

    def _made(self, task: Task, acting: Finding, repair: Repair, outcome: RepairOutcome, facts: Facts) -> None:
        key = task.key
        if (entry := self._entries.pop(key, None)) is not None and outcome.cost is not None:
            self.memory.purse.settle(entry, outcome.cost)
        episode = self.memory.episodes.open.get(key)
        if episode is not None:
            self.tried.append((episode, self.memory.episodes.tried(episode, outcome)))
        if outcome.report is not None and repair in (Repair.WATCH, Repair.HEAL):
            self._offer(outcome.report, repair, facts)
        if outcome.asked:
            self.problems.alert("asks", acting.target, outcome.detail[:600], facts, "octoform apply")
        if repair is Repair.WATCH and outcome.ok:
            self._diagnosed(key, acting, outcome, facts)
        if outcome.ok:
            self._forget(acting, repair)
        if repair is Repair.ROLL_BACK and outcome.ok:
            reason = Reason("check.rolled-back", outcome.detail)
            healed = acting.data.get("brief") or {}
            self.memory.episodes.checked(_incident(healed), Repair.HEAL, reason, RepairVerdict.ROLLED_BACK)
        self.awaiting[key] = (task, outcome)

    def _offer(self, report: Mapping[str, Any], repair: Repair, facts: Facts) -> None:
        pending, refused = self.evidence.offer(report, repair.value)
        if repair is Repair.WATCH:
            self.memory.keep_report(replace(self.memory.report, summary=summary_of(report)))
        self.memory.shelf.said.extend(refused)
        for claim in pending:
            hint = f"octoform confirm {claim.id}, or octoform confirm {claim.id} -reject"
            self.problems.alert("confirm", claim.target, f"{claim.kind} {claim.id}: {claim.statement}", facts, hint)

    def _diagnosed(self, key: str, asked: Finding, outcome: RepairOutcome, facts: Facts) -> None:
        """WATCH's report on the problem that it was asked about is its diagnosis; the rest are others."""
        found = list(findings_of(outcome.report, facts)) if outcome.report is not None else []
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
        if PLAYBOOK[repair].exchanges:
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

    def _heard(self, task: Task, said: RepairOutcome, facts: Facts) -> RepairOutcome:
        """The outcome of an agent's run; void when the daemon's own files were changed meanwhile."""
        outcome, before = self.untouched.end(said), self._before.pop(task.key, None)
        if task.finding is None or task.repair is not Repair.HEAL or not said.ok:
            return outcome
        if outcome.ok and before is not None:
            self.probation.begin(task.key, task.finding, before, facts)
        elif not outcome.ok and (said.report or {}).get("action") == "rewrite":
            self._take_back(task.finding, "the daemon's own files were changed while its agent was at work", facts)
        return outcome

    def _prove(self, facts: Facts) -> None:
        """Roll HEAL's change back when the readings after it are worse than those before."""
        if not self.probation.tried:
            return
        latest = self.evidence.ledger.latest()
        for finding, why in self.probation.judge(facts, self._health(facts), self.ports.promised, latest):
            reason = Reason("check.worse", f"it is worse than before: {why}")
            self.memory.episodes.checked(_incident(finding.data), Repair.HEAL, reason, RepairVerdict.FAILED)
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


def _incident(given: Mapping[str, Any]) -> str:
    """The id of the incident that HEAL was asked for."""
    return str(given.get("episode") or "")


def _refusal(repair: Repair, facts: Facts, rule: str, text: str) -> RepairOutcome:
    return RepairOutcome.refused(rule, text, repair=repair.value, at=facts.stamp)
