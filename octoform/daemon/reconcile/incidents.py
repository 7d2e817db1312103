"""From findings to incidents: what begins, what lasts and what is over, seen from facts alone. Light.

All that is known of a problem is kept with its incident, so that the next daemon goes on where this one was.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import InitVar, dataclass, field

from octoform.base.health_status import Status
from octoform.daemon.model import Alert, Cause, Facts, Finding, Kind, Notify, Outcome
from octoform.daemon.store.incidents import Incident
from octoform.daemon.store.memory import Memory
from octoform.engine.apply import approval

RETURNED = frozenset({Kind.DEVICE_MOVED, Kind.DEVICE_BACK})
"""A device that is in another place: its tools find it at their next call, so a person hears only that it is done."""
GOES_ON_AS: Mapping[Kind, Collection[Kind]] = {
    Kind.DEVICE_GONE: RETURNED,
    Kind.PROCESS_HUNG: (Kind.PROCESS_DEAD,),
    Kind.TOOL_FAILING: (Kind.PROCESS_HUNG,),
}
"""What the same problem of a target looks like later on, by what it was first."""


@dataclass(slots=True)
class Reported:
    """A finding that no look gives again: it holds until ``until`` (uptime), or until it is dealt with."""

    finding: Finding
    until: float


@dataclass(slots=True)
class OpenIncidents:
    """All problems that last, each with its incident; what an agent made of one is its diagnosis."""

    memory: Memory
    notify: Notify
    now: InitVar[float]
    reported: dict[str, Reported] = field(default_factory=dict)
    opened: list[Incident] = field(default_factory=list)
    ended: list[Incident] = field(default_factory=list)
    causes: frozenset[Cause] = frozenset()
    """Why the present look is made."""

    def __post_init__(self, now: float) -> None:
        """Load the agents' reports; after a reboot, with its own uptime, each holds as long as at first."""
        for key, episode in self.memory.episodes.open.items():
            if episode.until is not None and episode.diagnosis is not None:
                began = 0.0 if episode.boot == self.memory.boot else now - episode.opened_uptime
                self.reported[key] = Reported(episode.diagnosis, episode.until + began)

    def acting(self, finding: Finding) -> Finding:
        """The finding whose repairs are tried for a problem: its diagnosis, or the problem itself."""
        episode = self.memory.episodes.open.get(finding.key)
        return finding if episode is None or episode.diagnosis is None else episode.diagnosis

    def diagnosed(self, key: str) -> bool:
        """Whether an agent has made something of a problem."""
        episode = self.memory.episodes.open.get(key)
        return episode is not None and episode.diagnosis is not None

    def diagnose(self, key: str, diagnosis: Finding | None) -> Finding | None:
        """An agent has made this of a problem, or nothing that holds any more; what it was before."""
        if (episode := self.memory.episodes.open.get(key)) is None:
            return None
        before, episode.diagnosis = episode.diagnosis, diagnosis
        if before != diagnosis:
            self.memory.episodes.note(episode)
        return before

    def report(self, finding: Finding, until: float) -> None:
        """An agent's word is all that there is of a problem; it holds until then (uptime)."""
        self.reported[finding.key] = Reported(finding, until)

    def present(self, judged: Iterable[Finding], now: float) -> tuple[Finding, ...]:
        """Everything that is wrong: what was judged from facts, and what is known otherwise and still holds."""
        self.reported = {key: each for key, each in self.reported.items() if now < each.until}
        found = {each.finding.key: each.finding for each in self.reported.values()}
        return tuple((found | {finding.key: finding for finding in judged}).values())

    def settle(
        self, findings: Iterable[Finding], facts: Facts, held: Collection[str], within: Callable[[Kind, str], bool]
    ) -> None:
        """Begin the incidents of what is new, and end those of what is over.

        ``held`` are the keys whose repair has not come to its end, ``within`` shows which incidents these facts are
        about: of the others nothing is known now, and nothing is ended.
        """
        found = {finding.key: finding for finding in findings}
        self.memory.breakers.troubled(frozenset(each.target for each in found.values()), facts.uptime)
        for finding in found.values():
            self.memory.breakers.seen(finding.key, finding.target, facts.uptime, facts.stamp)
            if finding.key not in self.memory.episodes.open and not self._goes_on_as(finding, {*found, *held}, facts):
                self._begin(finding, facts)
        for key, episode in list(self.memory.episodes.open.items()):
            is_known = within(episode.kind, episode.target) and not (
                _is_undetermined(episode, facts) or self._hidden(episode, found)
            )
            if key not in found and key not in held and is_known:
                self._end(episode, facts)

    def is_being_ended(self, finding: Finding, held: Collection[str]) -> bool:
        """Whether a process is gone because the repair of its hang has just ended it, and brings another."""
        open_ = self.memory.episodes.open
        hung = (open_[key] for key in held if key in open_ and open_[key].kind is Kind.PROCESS_HUNG)
        return finding.kind is Kind.PROCESS_DEAD and any(each.target == finding.target for each in hung)

    def _goes_on_as(self, finding: Finding, kept: Collection[str], facts: Facts) -> bool:
        """Whether a problem that lasts is this one now.

        A device that goes away and comes back, a process that hangs and is ended for it, a tool that is late and holds
        its device, are one problem each. ``kept`` are keys of problems that are there as they were, or whose repair is
        under way.
        """
        for episode in list(self.memory.episodes.open.values()):
            same = episode.target == finding.target and episode.key not in kept
            if same and finding.kind in GOES_ON_AS.get(episode.kind, ()):
                self.memory.breakers.away(episode.key, facts.uptime, repaired=False)
                self.memory.episodes.becomes(episode, finding)
                return True
        return False

    def _hidden(self, episode: Incident, found: Mapping[str, Finding]) -> bool:
        """True for a tool that was given up, has not worked since, and of which nothing else is known now.

        What explains its failures for a while (a process that is down, a device that is away) does not fix it.
        """
        given_up = episode.outcome in (Outcome.FROZEN, Outcome.SURFACED)
        fails = any(episode.target == f"tool:{name}" for name in self.memory.recall.failing)
        return given_up and fails and all(each.target != episode.target for each in found.values())

    def set_outcome(self, finding: Finding, outcome: Outcome, facts: Facts, hint: str) -> None:
        """A problem lasts and nothing is tried any more; a person hears of it once."""
        episode = self.memory.episodes.open.get(finding.key)
        if episode is None or episode.outcome is outcome:
            return
        episode.hint = hint
        self.memory.episodes.set_outcome(episode, outcome)
        self.alert(outcome.value, episode.target, episode.summary, facts, hint)

    def broaden(self, finding: Finding) -> Finding:
        """From now on all problems of this target and class are this one, whatever they say."""
        broad, known = finding.broadly, self.memory.episodes
        self.diagnose(finding.key, None)
        if (episode := known.open.pop(finding.key, None)) is not None:
            episode.key, episode.evidence = broad.key, broad.evidence
            known.open[broad.key] = episode
            known.note(episode)
        return broad

    def goes_on(self, finding: Finding, acting: Finding) -> None:
        """Forget the retry budgets of a problem, so that its repairs are tried again."""
        for key in {finding.key, acting.key}:
            self.memory.breakers.forget(key)
        if (episode := self.memory.episodes.open.get(finding.key)) is not None:
            self.memory.episodes.set_outcome(episode, Outcome.OPEN)

    def reopen(self, target: str) -> tuple[str, ...]:
        """A person wants a target (``*``: every one) tried again; the targets that were given up."""
        self.memory.breakers.thaw(target)
        given_up = []
        for key, episode in self.memory.episodes.open.items():
            if target in ("*", episode.target):
                if key not in self.reported and (acting := self.diagnose(key, None)) is not None:
                    self.memory.breakers.thaw(acting.target)
                if self.memory.episodes.set_outcome(episode, Outcome.OPEN):
                    given_up.append(episode.target)
        return tuple(given_up)

    def alert(self, event: str, target: str, summary: str, facts: Facts, hint: str = "") -> None:
        """Let a person know."""
        self.notify(Alert(event, facts.host, target, summary, facts.stamp, hint))

    def taken(self) -> tuple[tuple[Incident, ...], tuple[Incident, ...]]:
        """The incidents that began and that ended since the last call."""
        found = tuple(self.opened), tuple(self.ended)
        self.opened, self.ended = [], []
        return found

    def _begin(self, finding: Finding, facts: Facts) -> None:
        by = "watch" if finding.data.get("by") == "watch" else "triage"
        episode = self.memory.episodes.begin(finding, facts, by, self.causes)
        if (word := self.reported.get(finding.key)) is not None:
            episode.diagnosis, episode.until = word.finding, word.until
            self.memory.episodes.note(episode)
        self.opened.append(episode)
        if finding.status is not Status.HEALTHY and finding.kind not in RETURNED:
            self.alert("opened", episode.target, episode.summary, facts)

    def _end(self, episode: Incident, facts: Facts) -> None:
        repaired = any(made.ok and made.repair != "watch" for made in episode.tries)
        outcome = Outcome.REPAIRED if repaired else Outcome.CLEARED
        for key in {episode.key, episode.diagnosis.key if episode.diagnosis is not None else episode.key}:
            self.memory.breakers.away(key, facts.uptime, repaired=repaired)
        self.memory.episodes.end(episode, outcome, facts.stamp, facts.uptime)
        if episode.kind is Kind.HARDWARE_CHANGED:
            approval.withdraw(self.memory.shelf.layout)  # the hardware is as it was, or an apply has taken it up
        self.ended.append(episode)
        if episode.status is not Status.HEALTHY:
            self.alert(outcome.value, episode.target, episode.summary, facts)


def _is_undetermined(episode: Incident, facts: Facts) -> bool:
    """True while the place of a problem's device is unknown: such a problem has not ended."""
    seen = facts.devices.get(episode.target.removeprefix("device:"))
    return seen is not None and seen.there is None
