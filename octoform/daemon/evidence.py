"""Readings and claims as the loop deals with them: facts are recorded, what agents say is only offered. Light."""

from collections.abc import Iterable, Mapping
from typing import Any

from octoform.claims.ledger import Ledger
from octoform.claims.model import Channel, Claim, Reading, Signal, State, Value
from octoform.claims.proposal import of_claim, of_declaration
from octoform.claims.readings import to_json as reading_json
from octoform.claims.storing import to_json as claim_json
from octoform.daemon.model import Cause, Facts, Finding
from octoform.daemon.triage.recall import Recall
from octoform.diagnostics import Diagnostic

MOST_GIVEN = 200
"""Readings that an agent is given; the newest ones."""
MOST_OFFERED = 20
_ENDPOINT = "endpoint"


class Evidence:
    """The ledger, and what was last recorded of facts, so that only what is new is written."""

    def __init__(self, ledger: Ledger) -> None:
        """``ledger`` of this host."""
        self.ledger = ledger
        self._known: dict[Signal, Value] = {}
        self._failed: dict[str, str] = {}
        self._first: dict[str, str] = {}
        self._last: dict[str, str] = {}
        self._summary: str | None = None
        self._since = self._from = ""

    def seen(self, facts: Facts) -> tuple[Claim, ...]:
        """Record what facts say; the claims that this ended come back."""
        fresh = [(signal, value) for signal, value in _standing(facts) if self._known.get(signal, ...) != value]
        self._known.update(fresh)
        made = [self.ledger.make(signal, value) for signal, value in fresh]
        for call in facts.failures:
            if call.ended and not call.ok:
                made.append(self.ledger.make(Signal(Channel.LOG, call.tool, "/ok"), False))
                self._failed[call.tool] = made[-1].id
                self._first.setdefault(call.tool, facts.stamp)
                self._last[call.tool] = facts.stamp
                made.append(self.ledger.make(Signal(Channel.LOG, call.tool, "/error"), call.error or "Error"))
        made += [self.ledger.make(Signal(Channel.LOG, tool, "/ok"), True) for tool in dict.fromkeys(facts.worked)]
        for tool in facts.worked:
            self._first.pop(tool, None)
        return self.ledger.record(made) if made else ()

    def take(self, readings: Iterable[Reading]) -> tuple[Claim, ...]:
        """Record fresh readings; the claims that they ended come back."""
        given = tuple(readings)
        return self.ledger.record(given) if given else ()

    def offer(self, report: Mapping[str, Any], by: str) -> tuple[tuple[Claim, ...], tuple[Diagnostic, ...]]:
        """Offer an agent's claims and declarations: (those that wait for a person, why others are not believed)."""
        proposals = [of_claim(item) for item in _listed(report, "claims")]
        proposals += [of_declaration(item) for item in _listed(report, "declarations")]
        pending, refused = [], []
        for proposal in proposals:
            found = proposal if isinstance(proposal, Diagnostic) else self.ledger.propose(proposal, by)
            if isinstance(found, Diagnostic):
                refused.append(found)
            elif found.state is State.PENDING:
                pending.append(found)
        if by == "watch":
            self._summary = str(report.get("summary") or "")[:600] or None
        return tuple(pending), tuple(refused)

    def due(self) -> float | None:
        """When the next claim expires (uptime)."""
        times = [claim.expires for claim in self.ledger.active() if claim.irreversible is None]
        return min(times, default=None)

    def brief(self, finding: Finding, causes: Iterable[Cause], recall: Recall, facts: Facts) -> dict[str, Any]:
        """What WATCH is asked with."""
        # Stamps of a clock that was set back since then cannot be compared: then the log counts as a whole.
        self._from, self._since = self._since if self._since <= facts.stamp else "", facts.stamp
        return {
            "causes": sorted(str(cause) for cause in causes),
            "readings": self._readings(),
            "failures": self._failures(recall, facts),
            "claims": [claim_json(claim) for claim in self.ledger.active()],
            "summary": self._summary,
            "since": self._from,
            "target": finding.target,
        }

    def healing(self, finding: Finding, episode: str, recall: Recall, facts: Facts) -> dict[str, Any]:
        """What HEAL is asked with: one error of WATCH's, or what triage made of it where WATCH was not asked."""
        error = finding.data.get("error")
        if not isinstance(error, Mapping):
            error = {
                "tool": finding.target.removeprefix("tool:") if finding.target.startswith("tool:") else None,
                "device": finding.data.get("device"),
                "class": finding.fault.value,
                "message": finding.summary[:300],
                "severity": "recoverable",
                "suggested_fix": finding.detail[:300],
                "cites": list(self._failed.values())[-MOST_OFFERED:],
            }
        return {
            "error": dict(error),
            "readings": self._readings(),
            "failures": self._failures(recall, facts),
            "target": finding.target,
            "episode": episode,
            "since": self._from,
        }

    def _failures(self, recall: Recall, facts: Facts) -> list[dict[str, Any]]:
        return [
            {
                "id": self._failed.get(tool, ""),
                "tool": tool,
                "error": failing.error,
                "message": failing.message,
                "count": failing.times,
                "first": self._first.get(tool, facts.stamp),
                "last": self._last.get(tool, facts.stamp),
            }
            for tool, failing in recall.failing.items()
        ]

    def _readings(self) -> list[dict[str, Any]]:
        newest = sorted(self.ledger.latest(), key=lambda each: each.uptime)[-MOST_GIVEN:]
        return [_flat(reading) for reading in newest]


def _flat(reading: Reading) -> dict[str, Any]:
    """A reading as agents are given it."""
    document = reading_json(reading)
    signal = reading.signal
    return {
        "id": reading.id,
        "at": reading.at,
        "channel": signal.channel.value,
        "source": signal.source,
        "path": signal.path,
        "value": document.get("value"),
        "why": reading.why,
    }


def _standing(facts: Facts) -> Iterable[tuple[Signal, Value]]:
    """What a look says of things that are so or otherwise; what it did not look at is left out."""
    if not facts.applied:
        return
    yield Signal(Channel.PROCESS, _ENDPOINT, "/running"), facts.process is not None
    if facts.answers is not None:
        yield Signal(Channel.PROCESS, _ENDPOINT, "/answers"), facts.answers
    for name, each in facts.devices.items():
        if each.there is not None:
            yield Signal(Channel.KERNEL, name, "/there"), each.there


def _listed(report: Mapping[str, Any], name: str) -> list[Any]:
    found = report.get(name)
    return found[:MOST_OFFERED] if isinstance(found, list) else []
