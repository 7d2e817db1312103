"""Everything that happened to a deployment, a problem by a problem: one JSON line at each change, the last one counts.

A line is only ever added, so a kill costs at most its own half line; the file is written again when it has grown, and
keeps what is open and the newest of what is over. Light.
"""

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, field
from typing import Any

from octoform.base.escaping import escaped
from octoform.base.files import parse, private_folder, record
from octoform.daemon.model import Cause, Facts, FaultClass, Finding, Kind, Outcome, Repair, Spent, Status
from octoform.daemon.store.json_store import FORMAT, LIMIT, Shelf, number
from octoform.diagnostics import warning
from octoform.records import dataclass
from octoform.state.files import display, read_regular, refused, write_atomic

FILE = "episodes.jsonl"
KEPT = 1000
"""Incidents that a file which has grown is cut down to."""
GROWN = 4_000_000
SUMMARY, DETAIL = 600, 1500
"""Characters of foreign words that an incident keeps."""
TRIES = 50


@dataclass(frozen=True, slots=True)
class Try:
    """One repair that was made: ``at`` RFC 3339, ``seconds`` it took, ``ok`` its own word."""

    repair: str
    at: str
    ok: bool
    detail: str
    seconds: float


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
    tries: list[Try] = field(default_factory=list)
    outcome: Outcome = Outcome.OPEN
    spent: Spent = field(default_factory=Spent)
    hint: str = ""
    diagnosis: Finding | None = None
    until: float | None = None

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
            summary=escaped(finding.summary)[:SUMMARY],
            status=finding.status,
            boot=self.boot,
            opened=facts.stamp,
            opened_uptime=facts.uptime,
            chain=tuple(repair.value for repair in (finding.repair, *finding.then)),
            evidence=tuple(escaped(item)[:SUMMARY] for item in finding.evidence[:20]),
            by=by,
            causes=tuple(sorted(causes)),
        )
        self.open[finding.key] = episode
        self.note(episode)
        return episode

    def becomes(self, episode: Incident, finding: Finding) -> None:
        """The same problem is seen otherwise now: it goes on under another key, and keeps its kind and beginning."""
        self.open.pop(episode.key, None)
        episode.key, episode.status, episode.diagnosis = finding.key, finding.status, None
        episode.summary = escaped(finding.summary)[:SUMMARY]
        episode.chain = tuple(repair.value for repair in (finding.repair, *finding.then))
        episode.evidence = tuple(escaped(item)[:SUMMARY] for item in finding.evidence[:20])
        self.open[episode.key] = episode
        self.note(episode)

    def tried(self, episode: Incident, made: Try, spent: Spent) -> None:
        """A repair was made for it."""
        detail = escaped(made.detail)[:DETAIL]
        episode.tries = [*episode.tries, Try(made.repair, made.at, made.ok, detail, made.seconds)][-TRIES:]
        episode.spent = added(episode.spent, spent)
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


def to_json(episode: Incident) -> dict[str, Any]:
    """An incident as its line has it, and ``octoform incidents --json``."""
    return {
        "format": FORMAT,
        "id": episode.id,
        "kind": episode.kind,
        "fault": episode.fault,
        "target": episode.target,
        "key": episode.key,
        "summary": episode.summary,
        "status": episode.status,
        "boot": episode.boot,
        "chain": list(episode.chain),
        "evidence": list(episode.evidence),
        "by": episode.by,
        "causes": list(episode.causes),
        "opened": episode.opened,
        "opened_uptime": episode.opened_uptime,
        "closed": episode.closed,
        "closed_uptime": episode.closed_uptime,
        "tries": [
            {"repair": made.repair, "at": made.at, "ok": made.ok, "detail": made.detail, "seconds": made.seconds}
            for made in episode.tries
        ],
        "outcome": episode.outcome,
        "spent": {
            "calls": episode.spent.calls,
            "input_tokens": episode.spent.input_tokens,
            "output_tokens": episode.spent.output_tokens,
            "usd": episode.spent.usd,
        },
        "hint": episode.hint,
        "diagnosis": None if episode.diagnosis is None else _of_finding(episode.diagnosis),
        "until": episode.until,
    }


def _of_finding(finding: Finding) -> dict[str, Any]:
    return {**asdict(finding), "data": dict(finding.data)}


def added(one: Spent, other: Spent) -> Spent:
    """The sum; dollars are unknown when one of them is."""
    usd = None if one.usd is None or other.usd is None else one.usd + other.usd
    return Spent(
        one.calls + other.calls,
        one.input_tokens + other.input_tokens,
        one.output_tokens + other.output_tokens,
        usd,
    )


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
    tries = [
        Try(str(item["repair"]), str(item["at"]), bool(item["ok"]), str(item["detail"]), number(item["seconds"]))
        for item in entry["tries"]
    ]
    spent = entry["spent"]
    usd = spent["usd"]
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
        tries=tries,
        outcome=Outcome(entry["outcome"]),
        spent=Spent(
            int(spent["calls"]),
            int(spent["input_tokens"]),
            int(spent["output_tokens"]),
            None if usd is None else number(usd),
        ),
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
