"""Readings and claims as the loop deals with them: facts are recorded, what agents say is only offered. Light.

What an agent is given is what triage knows: everything in it comes from records that outlive the daemon.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

from octoform.claims.admission import of_claim, of_declaration
from octoform.claims.codec import to_json as claim_json
from octoform.claims.ledger import Ledger
from octoform.claims.model import Channel, Claim, Reading, Signal, State, Value
from octoform.claims.readings import to_json as reading_json
from octoform.daemon.model import Cause, Facts, Finding
from octoform.daemon.signals import NO_VALUE, answered, current, measured
from octoform.daemon.store.memory import LastReport, Memory
from octoform.daemon.triage.failure_history import Recall
from octoform.diagnostics import Diagnostic
from octoform.records import replace
from octoform.state.layout import Layout

MAX_GIVEN = 200
"""Readings that an agent is given; the newest ones."""
MAX_OFFERED = 20
_ENDPOINT = "endpoint"


class Evidence:
    """The ledger, and what was last recorded of facts, so that only what is new is written."""

    def __init__(self, ledger: Ledger, promised: Callable[[], Collection[Signal]] = tuple) -> None:
        """``ledger`` of this host; ``promised`` is what ought to report (`octoform.daemon.model.Promised`)."""
        self.ledger = ledger
        self._promised = promised
        self._known: dict[Signal, Value] = {}

    def seen(self, facts: Facts) -> tuple[Claim, ...]:
        """Record what facts say; the claims that this ended come back."""
        fresh = [(signal, value) for signal, value in _standing(facts) if self._known.get(signal, ...) != value]
        self._known.update(fresh)
        made = [self.ledger.make(signal, value) for signal, value in fresh]
        for call in facts.failures:
            if call.ended and not call.ok:
                made.append(self.ledger.make(_success(call.tool), False))
                made.append(self.ledger.make(Signal(Channel.LOG, call.tool, "/error"), call.error or "Error"))
        made += [self.ledger.make(_success(tool), True) for tool in dict.fromkeys(facts.worked)]
        return self.ledger.record(made) if made else ()

    def current(self, layout: Layout) -> list[Reading]:
        """The newest reading of each signal that somebody still wants to know of."""
        return current(self.ledger.latest(), layout, self._promised())

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
        return tuple(pending), tuple(refused)

    def due(self) -> float | None:
        """When the next claim expires (uptime)."""
        times = [claim.expires for claim in self.ledger.active() if claim.irreversible is None]
        return min(times, default=None)

    def brief(self, finding: Finding, causes: Iterable[Cause], memory: Memory, facts: Facts) -> dict[str, Any]:
        """The input of WATCH; ``memory`` has what triage knows and the last report, and notes the question."""
        # Stamps of a clock that was set back since then cannot be compared: then the log counts as a whole.
        before = memory.report
        since = before.asked if before.asked <= facts.stamp else ""
        memory.keep_report(LastReport(before.summary, since, facts.stamp))
        failures = self._failures(memory.recall)  # first: what is missing among the readings is recorded with it
        return {
            "causes": sorted(str(cause) for cause in causes),
            "readings": self._readings(memory.shelf.layout),
            "failures": failures,
            "claims": [claim_json(claim) for claim in self.ledger.active()],
            "summary": before.summary,
            "since": since,
            "target": finding.target,
        }

    def healing(self, finding: Finding, episode: str, memory: Memory) -> dict[str, Any]:
        """The input of HEAL: one error of WATCH's, or triage's finding where WATCH did not run."""
        failures = self._failures(memory.recall)
        error = finding.data.get("error")
        if not isinstance(error, Mapping):
            error = {
                "tool": finding.target.removeprefix("tool:") if finding.target.startswith("tool:") else None,
                "device": finding.data.get("device"),
                "class": finding.fault.value,
                "message": finding.summary[:300],
                "severity": "recoverable",
                "suggested_fix": finding.detail[:300],
                "cites": [each["id"] for each in failures][-MAX_OFFERED:],
            }
        return {
            "error": dict(error),
            "readings": self._readings(memory.shelf.layout),
            "failures": failures,
            "target": finding.target,
            "episode": episode,
            "since": memory.report.since,
        }

    def _failures(self, recall: Recall) -> list[dict[str, Any]]:
        """A row for each tool that fails, under the reading that shows it; one is made where none is remembered."""
        known = {each.signal: each for each in self.ledger.latest()}
        shown = {tool: known.get(_success(tool)) for tool in recall.failing}
        made = {tool: self.ledger.make(_success(tool), False) for tool, each in shown.items() if _is_clean(each)}
        if made:
            self.take(made.values())
        cited = {**shown, **made}
        return [
            {
                "id": reading.id,
                "tool": tool,
                "error": failing.error,
                "message": failing.message,
                "count": failing.times,
                "first": failing.first or reading.at,
                "last": failing.last or reading.at,
            }
            for tool, failing in recall.failing.items()
            if (reading := cited[tool]) is not None
        ]

    def _readings(self, layout: Layout) -> list[dict[str, Any]]:
        """The newest of each signal; of a camera's also the one before, which vouches for the former picture."""
        newest = sorted(self.current(layout), key=lambda each: each.uptime)[-MAX_GIVEN:]
        seen = [each.signal for each in newest if each.signal.channel is Channel.FRAME]
        former = [each for signal in seen for each in self.ledger.readings_of(signal)[-2:-1]]
        lost = measured(newest, self.ledger.readings_of) - answered(newest)
        lines = [each if each.value is not None or each.why else _lost(each, lost) for each in newest]
        return [_flat(reading) for reading in sorted([*former, *lines], key=lambda each: each.uptime)]


def _success(tool: str) -> Signal:
    return Signal(Channel.LOG, tool, "/ok")


def _is_clean(reading: Reading | None) -> bool:
    """Whether a reading of a tool's success shows no failure: it is of an earlier boot, or the call never ended."""
    return reading is None or reading.value is not False


def _lost(reading: Reading, lost: Collection[Signal]) -> Reading:
    """A null of a signal that measured something before is one that cannot be read, as health counts it too."""
    return replace(reading, why=NO_VALUE) if reading.signal in lost else reading


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
    """The true-or-false readings of one look at the host; what the look skipped is omitted."""
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
    return found[:MAX_OFFERED] if isinstance(found, list) else []
