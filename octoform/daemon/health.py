"""Health in one value: what is seen directly, what is wrong, what cannot report. (Light, pure.)

Direct observation comes first: a claim counts only while the newest reading of its signal does not speak against it,
and no agent's word makes anything healthy. What cannot report is ``unknown``, no matter who disabled it.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

from octoform.base.files import record
from octoform.base.health_status import ORDER, Status, worst
from octoform.claims.model import Claim, Reading, Signal, State, holds
from octoform.daemon.model import Facts, Finding, Outcome
from octoform.daemon.signals import Silence, answered, newest, reporting, silent, unread
from octoform.endpoint.drift import OTHER_TOOLS
from octoform.records import dataclass, field, replace

FORMAT = 1


class ProblemLike(Protocol):
    """An incident, as far as health is concerned."""

    @property
    def status(self) -> Status:
        """How bad it is while it lasts."""

    @property
    def target(self) -> str:
        """The device, tool or process that the problem is about."""

    @property
    def summary(self) -> str:
        """One sentence."""

    @property
    def outcome(self) -> Outcome:
        """How it stands."""


@dataclass(frozen=True, slots=True)
class Part:
    """One thing with a status of its own; ``target`` as in a finding, ``why`` one sentence."""

    target: str
    status: Status
    why: str


@dataclass(frozen=True, slots=True)
class Health:
    """``status`` is the worst of the parts; ``parts`` are those that are not healthy, worst first.

    ``uptime`` is in seconds (CLOCK_BOOTTIME), ``at`` RFC 3339. ``covered`` counts signals that report,
    ``uncovered`` names what should report and does not. ``claims`` are ids of those in force, ``pending`` of those that
    wait for a person.
    """

    host: str
    at: str
    uptime: float
    status: Status
    parts: tuple[Part, ...] = ()
    covered: int = 0
    uncovered: tuple[str, ...] = ()
    claims: tuple[str, ...] = ()
    pending: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """The content of daemon/health.json."""
        return {
            "format": FORMAT,
            "host": self.host,
            "at": self.at,
            "uptime": self.uptime,
            "status": str(self.status),
            "parts": [{"target": each.target, "status": str(each.status), "why": each.why} for each in self.parts],
            "covered": self.covered,
            "uncovered": list(self.uncovered),
            "claims": list(self.claims),
            "pending": list(self.pending),
        }


def from_json(value: Mapping[str, Any]) -> Health:
    """The opposite of `Health.as_json`; LookupError, TypeError or ValueError for what is none."""
    record(value, FORMAT)
    return Health(
        str(value["host"]),
        str(value["at"]),
        float(value["uptime"]),
        Status(value["status"]),
        tuple(Part(str(each["target"]), Status(each["status"]), str(each["why"])) for each in value["parts"]),
        int(value["covered"]),
        *(tuple(str(each) for each in value[name]) for name in ("uncovered", "claims", "pending")),
    )


def compose(
    facts: Facts,
    episodes: Iterable[ProblemLike] = (),
    claims: Iterable[Claim] = (),
    readings: Iterable[Reading] = (),
    expected: Iterable[Signal] = (),
    unread: Iterable[Silence] = (),
) -> Health:
    """Health as of these facts. ``episodes`` may hold ended ones; ``expected`` are signals that ought to report.

    ``unread`` is what is promised to report and was not asked (`octoform.daemon.signals.unread`).
    """
    latest, made = newest(readings), list(claims)
    quiet = silent(latest.values(), expected, unread)
    standing = [each for each in made if each.state is State.ACTIVE and _is_upheld(each, latest)]
    pending = [each for each in made if each.state is State.PENDING]
    parts = [*_process(facts), *_devices(facts)]
    parts += [Part(f"unit:{source}{path}", Status.UNKNOWN, f"does not report: {why}") for source, path, why in quiet]
    parts += _problem_parts(episodes)
    parts += [Part(each.target, Status.DEGRADED, f"{each.kind} {each.id}: {each.statement}") for each in standing]
    parts += [
        Part(each.target, Status.DEGRADED, f"{each.id} waits for a person as a {each.kind}: {each.statement}")
        for each in pending
    ]
    # What is seen directly comes first, and an episode of the same adds nothing to it.
    fields = {(each.target, each.status): each for each in reversed(parts) if each.status is not Status.HEALTHY}
    ill = sorted(fields.values(), key=_rank)
    return Health(
        facts.host,
        facts.stamp,
        facts.uptime,
        worst(each.status for each in ill),
        tuple(ill),
        len(reporting(latest.values())) if facts.applied else 0,  # what a destroyed endpoint read, no one reads now
        tuple(f"{source}{path}" for source, path, _ in quiet),
        tuple(each.id for each in standing),
        tuple(each.id for each in pending),
    )


def _rank(part: Part) -> tuple[int, str, str]:
    return -ORDER.index(part.status), part.target, part.why


def _process(facts: Facts) -> Iterable[Part]:
    if not facts.applied:
        yield Part("endpoint", Status.UNKNOWN, "nothing is applied yet")
    elif facts.stopped_by is not None:
        yield Part("endpoint", Status.DOWN, f"stopped by {facts.stopped_by}")
    elif facts.process is None:
        yield Part("endpoint", Status.DOWN, "its process does not run")
    elif facts.answers is None:
        yield Part("endpoint", Status.UNKNOWN, "it has not been checked yet")
    elif not facts.answers:
        yield Part("endpoint", Status.DOWN, "its process does not answer")
    else:
        if facts.latched:
            yield Part("endpoint", Status.DEGRADED, "the emergency stop is engaged: nothing that moves is called")
        for reason in facts.endpoint:
            if reason.startswith(OTHER_TOOLS):
                yield Part("endpoint:tools", Status.DEGRADED, reason)
    for name in facts.unproved:
        why = f"the hardware test of {name} failed when it was last applied: octoform state show {name} shows more"
        yield Part(name, Status.DEGRADED, why)


def _devices(facts: Facts) -> Iterable[Part]:
    for name, each in facts.devices.items():
        if each.there is None:
            yield Part(f"device:{name}", Status.UNKNOWN, "whether it is there is unknown")
        elif not each.there:
            yield Part(f"device:{name}", Status.DEGRADED, "it is not there")
        elif each.refused is not None:
            yield Part(f"device:{name}", Status.DEGRADED, each.refused)
        elif each.doubt is not None:
            yield Part(f"device:{name}", Status.DEGRADED, "several devices match")


def _problem_parts(episodes: Iterable[ProblemLike]) -> Iterable[Part]:
    for each in episodes:
        if each.outcome in (Outcome.OPEN, Outcome.FROZEN, Outcome.SURFACED):
            yield Part(each.target, each.status, each.summary)


def _is_upheld(claim: Claim, latest: Mapping[Signal, Reading]) -> bool:
    """A claim that the newest reading of its own signal contradicts has no say, no matter who made it."""
    reading = latest.get(claim.signal)
    return reading is None or reading.value is None or holds(claim.condition, reading.value) is not False


@dataclass(frozen=True, slots=True)
class HealthSnapshot:
    """The health of a deployment at one moment, for a comparison: before a repair and after it.

    ``reporting`` are signals as ``source + path``, ``there`` devices, ``failing`` how often each tool failed in a row.
    """

    running: bool
    answers: bool | None = None
    reporting: frozenset[str] = frozenset()
    there: frozenset[str] = frozenset()
    tools: frozenset[str] = frozenset()
    failing: Mapping[str, int] = field(default_factory=dict)


def snapshot(
    facts: Facts,
    readings: Iterable[Reading] = (),
    tools: Iterable[str] = (),
    failing: Mapping[str, int] | None = None,
) -> HealthSnapshot:
    """The health that `worse` compares. ``tools`` are the endpoint's; ``failing`` from `Recall.failing`."""
    given = list(readings)
    return HealthSnapshot(
        facts.process is not None,
        facts.answers,
        frozenset(f"{each.source}{each.path}" for each in reporting(given) | answered(given)),
        frozenset(name for name, each in facts.devices.items() if each.there),
        frozenset(tools),
        dict(failing or {}),
    )


def worse(before: HealthSnapshot, after: HealthSnapshot) -> str | None:
    """One sentence on what is worse than it was; None when nothing is. Only what reported before can be missed."""
    if before.running and not after.running:
        return "the endpoint's process does not run any more"
    if before.answers and after.answers is False:
        return "the endpoint does not answer any more"
    for what, gone in (
        ("listed", before.tools - after.tools),
        ("there", before.there - after.there),
        ("reporting", before.reporting - after.reporting),
    ):
        if gone:
            names = sorted(gone)
            more = f" and {len(names) - 3} more" if len(names) > 3 else ""
            return f"{', '.join(names[:3])}{more} {'is' if len(names) == 1 else 'are'} not {what} any more"
    for name, times in sorted(after.failing.items()):
        if times and not before.failing.get(name):
            return f"{name} fails, which it did not before"
    return None


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
        self.tried[key] = Tried(finding, before, facts.uptime + _AFTER, _instance(facts))

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
    process = _instance(facts)
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


def _instance(facts: Facts) -> str | None:
    return facts.process.instance if facts.process is not None else None
