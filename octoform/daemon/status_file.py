"""The daemon's status file: health, with what waits and what gave up. Light."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from octoform.base.health_status import FILE, basis
from octoform.claims.model import Channel, Reading, Signal
from octoform.daemon.evidence import Evidence
from octoform.daemon.health import Health, compose
from octoform.daemon.model import Facts
from octoform.daemon.signals import current, measured, unread
from octoform.daemon.store.memory import Memory

FRESH_SECONDS = 60.0
"""The longest between two writings of what has not changed: older health is not believed."""


def seen(facts: Facts) -> dict[str, Any]:
    """What these facts have of what any process can check."""
    instance = facts.process.instance if facts.process is not None else None
    return basis(instance, stopped=facts.stopped_by is not None, engaged=facts.latched)


@dataclass(slots=True)
class Bulletin:
    """Writes health when it is new, and from time to time when it is not."""

    memory: Memory
    evidence: Evidence
    stale: float
    """Seconds after which a sensor that was not read again counts as one that cannot report."""
    last: Health | None = None
    _written: Mapping[str, Any] | None = None
    _at: float = 0.0
    _measured: frozenset[Signal] = frozenset()

    def __call__(
        self, facts: Facts, waits: Mapping[str, str], paused: str | None, promised: Iterable[Signal] = ()
    ) -> Health:
        """Compose health of these facts, and write it down; ``promised`` is what ought to report (`ports.Promised`)."""
        ledger = self.evidence.ledger
        latest = ledger.latest()
        wanted = frozenset(promised)
        known = current(latest, self.memory.shelf.layout, wanted)
        readings = [self._aged(reading, facts.uptime) for reading in known]
        claims = [*ledger.active(), *ledger.pending()]
        silent = unread(wanted, latest, facts.uptime - self.stale) if facts.process is not None else []
        health = compose(facts, self.memory.episodes.open.values(), claims, readings, self._expected(known), silent)
        given_up = self.memory.breakers.given_up(self.memory.episodes.open.values())
        frozen = [{"target": each.target, "why": each.frozen} for each in given_up]
        beside = {"paused": paused, "waits": dict(waits), "frozen": frozen, "basis": seen(facts)}
        # The interval is a third of `stale`.
        until = facts.uptime + self.stale / 3 + FRESH_SECONDS
        document = {**health.as_json(), **beside, "until": until}
        same = {name: value for name, value in document.items() if name not in ("at", "uptime", "until")}
        there = self.memory.shelf.path(FILE).exists()
        if same != self._written or facts.uptime - self._at >= FRESH_SECONDS or not there:
            if self.memory.shelf.write(FILE, document):
                self._written, self._at = same, facts.uptime
            else:
                self._withdraw()
        self.last = health
        return health

    def _withdraw(self) -> None:
        """Remove a status file that cannot be replaced: no status is better than an old one."""
        with suppress(OSError):  # the next reader sees that the disk refuses this too
            self.memory.shelf.path(FILE).unlink(missing_ok=True)
        self.memory.shelf.wrote(FILE)

    def _expected(self, known: list[Reading]) -> frozenset[Signal]:
        """The signals with a value since this daemon began, or as far back as the ledger remembers each signal."""
        fresh = [reading for reading in known if reading.signal not in self._measured]
        self._measured |= measured(fresh, self.evidence.ledger.readings_of)
        return self._measured & {reading.signal for reading in known}

    def _aged(self, reading: Reading, now: float) -> Reading:
        sensed = reading.signal.channel in (Channel.SENSOR, Channel.FRAME)
        if not sensed or reading.value is None or now - reading.uptime <= self.stale:
            return reading
        return replace(reading, value=None, why="it was not read for a while")
