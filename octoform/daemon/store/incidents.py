"""Everything that happened to a deployment, a problem by a problem: one JSON line at each change, the last one counts.

A line is only ever added, so a kill costs at most its own half line; the file is written again when it has grown, and
keeps what is open and the newest of what is over. Light.
"""

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from itertools import takewhile
from typing import Any

from octoform.apply.repair_outcome import Cost, Reason, RepairOutcome, RepairVerdict
from octoform.base.escaping import escaped
from octoform.base.files import parse, private_folder, record
from octoform.base.health_status import Status
from octoform.daemon.model import Cause, Facts, FaultClass, Finding, Kind, Outcome, Repair
from octoform.daemon.store.json_store import FORMAT, LIMIT, Shelf, number
from octoform.diagnostics import warning
from octoform.records import dataclass, field
from octoform.state.files import display, read_regular, refused, write_atomic

FILE = "episodes.jsonl"
KEPT = 1000
"""Incidents that a file which has grown is cut down to."""
GROWN = 4_000_000
SUMMARY = 600
"""Characters of foreign words that an incident keeps."""
TRIES = 50
"""Outcomes that an incident keeps: of the tries the latest, and as many refusals."""


@dataclass(slots=True)
class Incident:
    """One problem from its first sign to its end. Stamps are RFC 3339, uptimes seconds of CLOCK_BOOTTIME.

    ``closed`` is None while it lasts; then ``outcome`` is ``open``, or ``frozen`` or ``surfaced`` when a person is
    needed. ``by`` shows who found it: ``triage`` or ``watch``. ``boot`` is what the uptimes count from, ``chain`` the
    repairs that there are, ``hint`` what a person can do. ``causes`` are those of the look that found it first.

    ``diagnosis`` is what an agent made of it, and whose repairs are tried since (None: no one did). ``until`` is set
    where an agent's word is all that there is of it: it holds until then (uptime).
    """

    id: str
    kind: Kind
    fault: FaultClass
    target: str
    key: str
    summary: str
    status: Status
    boot: str
    opened: str
    opened_uptime: float
    chain: tuple[str, ...] = ()
    evidence: tuple[str, ...] = ()
    by: str = "triage"
    causes: tuple[str, ...] = ()
    closed: str | None = None
    closed_uptime: float | None = None
    outcomes: list[RepairOutcome] = field(default_factory=list)
    """What came of each repair that was considered, in order; of equal refusals the first."""
    outcome: Outcome = Outcome.OPEN
    spent: Cost = field(default_factory=Cost)
    hint: str = ""
    diagnosis: Finding | None = None
    until: float | None = None

    @property
    def tries(self) -> list[RepairOutcome]:
        """The repairs that were begun."""
        return [each for each in self.outcomes if each.begun]

    @property
    def over(self) -> bool:
        """True when the problem is."""
        return self.closed is not None


@dataclass(slots=True)
class Incidents:
    """The host's incidents: those that last, by key, and a line for each change."""

    shelf: Shelf
    boot: str
    open: dict[str, Incident] = field(default_factory=dict)
    _count: int = 0

    def load(self) -> None:
        """Take up what lasted when the daemon before this one ended, and cut down a file that has grown."""
        known = read(self.shelf)
        self._count = max((_ordinal(item.id) for item in known), default=0)
        self.open = {item.key: item for item in known if not item.over}
        self.shelf.wrote(FILE)
        if self._size() > GROWN:
            self._cut(known)

    def begin(self, finding: Finding, facts: Facts, by: str = "triage", causes: Iterable[Cause] = ()) -> Incident:
        """A problem is seen for the first time, in these facts, which were looked at for these causes."""
        self._count += 1
        episode = Incident(
            id=f"e{self._count}",
            kind=finding.kind,
            fault=finding.fault,
            target=escaped(finding.target)[:SUMMARY],
            key=finding.key,
            boot=self.boot,
            opened=facts.stamp,
            opened_uptime=facts.uptime,
            by=by,
            causes=tuple(sorted(causes)),
            **described(finding),
        )
        self.open[finding.key] = episode
        self.note(episode)
        return episode

    def becomes(self, episode: Incident, finding: Finding) -> None:
        """The same problem is seen otherwise now: it goes on under another key, and keeps its kind and beginning."""
        self.open.pop(episode.key, None)
        episode.key, episode.diagnosis = finding.key, None
        for name, value in described(finding).items():
            setattr(episode, name, value)
        self.open[episode.key] = episode
        self.note(episode)

    def tried(self, episode: Incident, made: RepairOutcome) -> RepairOutcome:
        """A repair was made for it; as it is kept."""
        kept = made.plain()
        episode.outcomes = _bounded([*episode.outcomes, kept])
        episode.spent += made.spent
        self.note(episode)
        return kept

    def refused(self, episode: Incident, refusal: RepairOutcome) -> bool:
        """A repair was considered and not begun; False where that is known since the last try: each look asks again."""
        if any(_like(each, refusal) for each in takewhile(lambda each: not each.begun, reversed(episode.outcomes))):
            return False
        episode.outcomes = _bounded([*episode.outcomes, refusal.plain()])
        self.note(episode)
        return True

    def checked(self, identity: str, repair: str, reason: Reason, verdict: RepairVerdict) -> None:
        """Facts showed what the last repair of this name was worth, which had reported success.

        The incident may be over by then.
        """
        every = self.open.values() if any(each.id == identity for each in self.open.values()) else read(self.shelf)
        episode = next((each for each in every if each.id == identity), None)
        places = (
            [at for at, each in enumerate(episode.outcomes) if each.repair == repair and each.ok] if episode else []
        )
        if episode is None or not places:
            return
        judged = episode.outcomes[places[-1]].because(reason.rule, reason.text, verdict=verdict).plain()
        episode.outcomes = [*episode.outcomes[: places[-1]], judged, *episode.outcomes[places[-1] + 1 :]]
        self.note(episode)

    def end(self, episode: Incident, outcome: Outcome, stamp: str, uptime: float) -> None:
        """It is over."""
        episode.outcome, episode.closed, episode.closed_uptime = outcome, stamp, uptime
        self.open.pop(episode.key, None)
        self.note(episode)

    def set_outcome(self, episode: Incident, outcome: Outcome) -> bool:
        """It lasts, and how; True when that is new."""
        if episode.outcome is outcome:
            return False
        episode.outcome = outcome
        self.note(episode)
        return True

    def note(self, episode: Incident) -> None:
        """Write a line with what it is now; a disk that refuses is stated."""
        path = self.shelf.path(FILE)
        self.shelf.is_mine(FILE)
        line = json.dumps(to_json(episode), separators=(",", ":")).encode() + b"\n"
        try:
            private_folder(path.parent)
            flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
            with os.fdopen(os.open(path, flags, 0o600), "r+b", buffering=0) as file:
                if _torn(file.fileno()):
                    line = b"\n" + line
                file.write(line)
        except OSError as problem:
            self.shelf.said.append(refused(problem, path))
        self.shelf.wrote(FILE)

    def _size(self) -> int:
        try:
            return self.shelf.path(FILE).stat().st_size
        except OSError:
            return 0

    def _cut(self, known: Iterable[Incident]) -> None:
        kept = list(known)
        over = [item for item in kept if item.over][-KEPT:]
        wanted = {item.id for item in over} | {item.id for item in kept if not item.over}
        lines = [json.dumps(to_json(item), separators=(",", ":")) for item in kept if item.id in wanted]
        if problem := write_atomic(self.shelf.path(FILE), "".join(f"{line}\n" for line in lines).encode(), 0o600):
            self.shelf.said.append(problem)
        self.shelf.wrote(FILE)

    def save(self) -> None:
        """Write down once more what lasts; the last line of an incident counts, no matter who wrote one before it."""
        for episode in self.open.values():
            self.note(episode)


def read(shelf: Shelf) -> list[Incident]:
    """All incidents in the order in which they began; invalid lines are omitted, and reported."""
    path = shelf.path(FILE)
    data, problem = read_regular(path, 4 * LIMIT)
    if problem is not None:
        shelf.move_aside(path, problem.summary)
        return []
    found: dict[str, Incident] = {}
    bad = 0
    for line in filter(None, (data or b"").split(b"\n")):
        episode = _decoded(line)
        if episode is None:
            bad += 1
        else:
            found[episode.id] = episode
    if bad:
        detail = f"{bad} of its lines are none of this version, or half ones; they are skipped"
        shelf.said.append(warning("DAEMON-MEMORY-DAMAGED", "it is damaged", path=display(path), detail=detail))
    return list(found.values())


_PLAIN = (
    *("id", "kind", "fault", "target", "key", "summary", "status", "boot", "by", "opened", "opened_uptime"),
    *("closed", "closed_uptime", "outcome", "hint", "until"),
)
_LISTS = ("chain", "evidence", "causes")


def to_json(episode: Incident) -> dict[str, Any]:
    """An incident as its line has it, and ``octoform incidents --json``."""
    return {
        "format": FORMAT,
        **{name: getattr(episode, name) for name in _PLAIN},
        **{name: list(getattr(episode, name)) for name in _LISTS},
        "tries": [made.to_json() for made in episode.tries],
        "refused": [refusal.to_json() for refusal in episode.outcomes if not refusal.begun],
        "spent": episode.spent.to_json(),
        "diagnosis": None if episode.diagnosis is None else asdict(episode.diagnosis),
    }


def described(finding: Finding) -> dict[str, Any]:
    """The members of an incident that its finding gives, and gives otherwise when the problem is seen otherwise."""
    return {
        "summary": escaped(finding.summary)[:SUMMARY],
        "status": finding.status,
        "chain": tuple(repair.value for repair in (finding.repair, *finding.then)),
        "evidence": tuple(escaped(item)[:SUMMARY] for item in finding.evidence[:20]),
    }


def _bounded(outcomes: list[RepairOutcome]) -> list[RepairOutcome]:
    """The latest tries, and as many refusals: neither takes the place of the other."""
    parts = [[each for each in outcomes if each.begun is begun][-TRIES:] for begun in (True, False)]
    left = {id(each) for part in parts for each in part}
    return [each for each in outcomes if id(each) in left]


def _like(one: RepairOutcome, other: RepairOutcome) -> bool:
    """The same repair, refused by the same rules; the words may count seconds."""
    return one.repair == other.repair and [each.rule for each in one.reasons] == [each.rule for each in other.reasons]


def _torn(descriptor: int) -> bool:
    """True when the last line is a half one, of a daemon that was killed while it wrote."""
    size = os.fstat(descriptor).st_size
    return size > 0 and os.pread(descriptor, 1, size - 1) != b"\n"


def _ordinal(name: str) -> int:
    return int(name[1:]) if name[1:].isdecimal() else 0


def _decoded(line: bytes) -> Incident | None:
    try:
        return _episode(record(parse(line), FORMAT))
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError):
        return None


def _episode(entry: Mapping[str, Any]) -> Incident:
    outcomes = [RepairOutcome.from_json(item) for item in (*entry["tries"], *entry.get("refused", ()))]
    closed_uptime = entry["closed_uptime"]
    return Incident(
        id=str(entry["id"]),
        kind=Kind(entry["kind"]),
        fault=FaultClass(entry["fault"]),
        target=str(entry["target"]),
        key=str(entry["key"]),
        summary=str(entry["summary"]),
        status=Status(entry["status"]),
        boot=str(entry["boot"]),
        chain=tuple(Repair(item).value for item in entry["chain"]),
        opened=str(entry["opened"]),
        opened_uptime=number(entry["opened_uptime"]),
        evidence=tuple(str(item) for item in entry["evidence"]),
        by=str(entry["by"]),
        causes=tuple(str(item) for item in entry["causes"]),
        closed=entry["closed"],
        closed_uptime=None if closed_uptime is None else number(closed_uptime),
        outcomes=sorted(outcomes, key=lambda each: each.at),
        outcome=Outcome(entry["outcome"]),
        spent=Cost.from_json(entry["spent"]),
        hint=str(entry["hint"]),
        diagnosis=_finding(entry["diagnosis"]) if entry.get("diagnosis") is not None else None,
        until=None if entry.get("until") is None else number(entry["until"]),
    )


def _finding(entry: Mapping[str, Any]) -> Finding:
    return Finding(
        kind=Kind(entry["kind"]),
        fault=FaultClass(entry["fault"]),
        target=str(entry["target"]),
        summary=str(entry["summary"]),
        evidence=tuple(str(item) for item in entry["evidence"]),
        repair=Repair(entry["repair"]),
        then=tuple(Repair(item) for item in entry["then"]),
        status=Status(entry["status"]),
        detail=str(entry["detail"]),
        data=dict(entry["data"]),
    )
