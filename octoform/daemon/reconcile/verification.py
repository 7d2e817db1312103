"""HEAL on probation: what it changed counts only once everything has been read anew, and nothing reads worse. Light.

How the deployment stood before is compared at each look, from the end of the repair until all that is promised to
report has been read once more after it. The readings that the repair itself asks for are the first, and not enough.
A device that somebody unplugs meanwhile, and a process that ends once, are nobody's proof against a rewritten function:
they are waited for.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from octoform.claims.model import Reading, Signal
from octoform.daemon.health import Stand, worse
from octoform.daemon.model import Facts, Finding
from octoform.daemon.signals.expected import unread

MOST_ENDS = 2
"""Ends of the endpoint's process during a probation at which the repair is taken for their cause."""
_AFTER = 0.001
"""Seconds: readings of the very moment in which the repair ended are its own."""


@dataclass(slots=True)
class Tried:
    """A repair on probation: what it was made for, how things stood before, since when (uptime), in which process."""

    finding: Finding
    before: Stand
    since: float
    process: str | None
    ends: int = 0


@dataclass(slots=True)
class Probation:
    """The repairs of HEAL that nobody knows yet to hold, by the key of their trouble."""

    tried: dict[str, Tried] = field(default_factory=dict)

    def begin(self, key: str, finding: Finding, before: Stand, facts: Facts) -> None:
        """A repair has ended, by its own word well."""
        self.tried[key] = Tried(finding, before, facts.uptime + _AFTER, _process(facts))

    def judge(
        self, facts: Facts, now: Stand, promised: Callable[[], Iterable[Signal]], readings: Iterable[Reading]
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


def _worse(tried: Tried, facts: Facts, now: Stand) -> str | None:
    process = _process(facts)
    if process is not None and process != tried.process:
        tried.ends += tried.process is not None
        tried.process, tried.since = process, max(tried.since, facts.uptime + _AFTER)
    if tried.ends >= MOST_ENDS:
        return f"the endpoint's process ended {tried.ends} times"
    if not _settled(tried, facts):
        return None
    # What an absent device does not report says nothing; a tool that fails for it is known by its error elsewhere.
    return worse(replace(tried.before, there=frozenset()), now)


def _settled(tried: Tried, facts: Facts) -> bool:
    """Whether the deployment can be compared now: the process is there, and so are the devices that were."""
    there = {name for name, each in facts.devices.items() if each.there}
    return facts.process is not None and facts.answers is not False and tried.before.there <= there


def _process(facts: Facts) -> str | None:
    return facts.process.instance if facts.process is not None else None
