"""From findings to episodes: what begins, what lasts and what is over, seen from facts alone. Light."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field

from octoform.daemon.model import Alert, Cause, Facts, Finding, Kind, Outcome, Status
from octoform.daemon.ports import Notify
from octoform.daemon.records.episodes import Episode
from octoform.daemon.records.memory import Memory
from octoform.engine import onboarding


@dataclass(slots=True)
class Reported:
    """A finding that no look gives again: it holds until ``until`` (uptime), or until it is dealt with."""

    finding: Finding
    until: float


@dataclass(slots=True)
class Troubles:
    """All troubles that last, each with its episode.

    ``continued`` is what an agent made of a trouble: from then on its repairs are the playbook's.
    """

    memory: Memory
    notify: Notify
    continued: dict[str, Finding] = field(default_factory=dict)
    reported: dict[str, Reported] = field(default_factory=dict)
    opened: list[Episode] = field(default_factory=list)
    ended: list[Episode] = field(default_factory=list)
    causes: frozenset[Cause] = frozenset()
    """Why the present look is made."""

    def present(self, judged: Iterable[Finding], now: float) -> tuple[Finding, ...]:
        """Everything that is wrong: what was judged from facts, and what is known otherwise and still holds."""
        self.reported = {key: each for key, each in self.reported.items() if now < each.until}
        found = {each.finding.key: each.finding for each in self.reported.values()}
        return tuple((found | {finding.key: finding for finding in judged}).values())

    def settle(
        self, findings: Iterable[Finding], facts: Facts, held: Collection[str], within: Callable[[Kind, str], bool]
    ) -> None:
        """Begin the episodes of what is new, and end those of what is over.

        ``held`` are the keys whose repair has not come to its end, ``within`` tells which episodes these facts are
        about: of the others nothing is known now, and nothing is ended.
        """
        found = {finding.key: finding for finding in findings}
        self.memory.breakers.troubled(frozenset(each.target for each in found.values()), facts.uptime)
        for finding in found.values():
            self.memory.breakers.seen(finding.key, finding.target, facts.uptime, facts.stamp)
            if finding.key not in self.memory.episodes.open:
                self._begin(finding, facts)
        for key, episode in list(self.memory.episodes.open.items()):
            told = within(episode.kind, episode.target) and not _untold(episode, facts)
            if key not in found and key not in held and told:
                self._end(episode, facts)

    def stands(self, finding: Finding, outcome: Outcome, facts: Facts, hint: str) -> None:
        """A trouble lasts and nothing is tried any more; a person hears of it once."""
        episode = self.memory.episodes.open.get(finding.key)
        if episode is None or episode.outcome is outcome:
            return
        episode.hint = hint
        self.memory.episodes.stands(episode, outcome)
        self.tell(outcome.value, episode.target, episode.summary, facts, hint)

    def broaden(self, finding: Finding) -> Finding:
        """From now on all troubles of this target and class are this one, whatever they say."""
        broad, known = finding.broadly, self.memory.episodes
        self.continued.pop(finding.key, None)
        if (episode := known.open.pop(finding.key, None)) is not None:
            episode.key, episode.evidence = broad.key, broad.evidence
            known.open[broad.key] = episode
            known.note(episode)
        return broad

    def goes_on(self, finding: Finding, acting: Finding) -> None:
        """What was given up may be tried again."""
        for key in {finding.key, acting.key}:
            self.memory.breakers.forget(key)
        if (episode := self.memory.episodes.open.get(finding.key)) is not None:
            self.memory.episodes.stands(episode, Outcome.OPEN)

    def reopen(self, target: str) -> tuple[str, ...]:
        """A person wants a target (``*``: every one) tried again; the targets that were given up."""
        self.memory.breakers.thaw(target)
        given_up = []
        for key, episode in self.memory.episodes.open.items():
            if target in ("*", episode.target):
                if (acting := self.continued.pop(key, None)) is not None:
                    self.memory.breakers.thaw(acting.target)
                if self.memory.episodes.stands(episode, Outcome.OPEN):
                    given_up.append(episode.target)
        return tuple(given_up)

    def tell(self, event: str, target: str, summary: str, facts: Facts, hint: str = "") -> None:
        """Let a person know."""
        self.notify(Alert(event, facts.host, target, summary, facts.stamp, hint))

    def taken(self) -> tuple[tuple[Episode, ...], tuple[Episode, ...]]:
        """What began and what ended since the last time."""
        found = tuple(self.opened), tuple(self.ended)
        self.opened, self.ended = [], []
        return found

    def _begin(self, finding: Finding, facts: Facts) -> None:
        by = "watch" if finding.data.get("by") == "watch" else "triage"
        episode = self.memory.episodes.begin(finding, facts, by, self.causes)
        self.opened.append(episode)
        if finding.status is not Status.HEALTHY:
            self.tell("opened", episode.target, episode.summary, facts)

    def _end(self, episode: Episode, facts: Facts) -> None:
        repaired = any(made.ok and made.repair != "watch" for made in episode.tries)
        outcome = Outcome.REPAIRED if repaired else Outcome.CLEARED
        acting = self.continued.pop(episode.key, None)
        for key in {episode.key, acting.key if acting is not None else episode.key}:
            self.memory.breakers.away(key, facts.uptime, repaired=repaired)
        self.memory.episodes.end(episode, outcome, facts.stamp, facts.uptime)
        if episode.kind is Kind.HARDWARE_CHANGED:
            onboarding.withdraw(self.memory.shelf.layout)  # the hardware is as it was, or an apply has taken it up
        self.ended.append(episode)
        if episode.status is not Status.HEALTHY:
            self.tell(outcome.value, episode.target, episode.summary, facts)


def _untold(episode: Episode, facts: Facts) -> bool:
    """True while nobody can tell where the device of a trouble is: what is not known has not ended."""
    sighting = facts.devices.get(episode.target.removeprefix("device:"))
    return sighting is not None and sighting.there is None
