"""The agents' budget of an hour, over restarts of the daemon: calls as a count, and US dollars.

Calls are written down before they are made and again when their cost is known, so that a daemon which dies in between
has still counted them. What cannot be written down is not spent, and an unknown amount counts as spent. Light.
"""

from dataclasses import asdict, dataclass, field
from typing import Any

from octoform.apply.repair_outcome import Cost
from octoform.base.clock import parse_stamp
from octoform.daemon.store.json_store import Shelf, number

FILE = "spend.json"
WINDOW_SECONDS = 3600.0
LIMIT = 1000
ATTEMPTS = 3
"""What a run of an agent counts as until its end is known: the attempts that it has unless the manifest states more."""


@dataclass(slots=True)
class Entry:
    """One run of an agent: when (uptime in its boot, and the stamp), and what it cost (``usd`` None: no one knows)."""

    at: float
    stamp: str
    boot: str
    calls: int
    usd: float | None


@dataclass(slots=True)
class AgentBudget:
    """The hour's spending. ``calls_per_hour`` and ``usd_per_hour`` are the caps; None in dollars is none."""

    shelf: Shelf
    boot: str
    calls_per_hour: int
    usd_per_hour: float | None
    _entries: list[Entry] = field(default_factory=list)

    def load(self, now: float = 0.0, stamp: str = "") -> None:
        """Take up what was spent before. Of a file that is damaged no one knows: then the hour counts as spent."""
        found = len(self.shelf.said)
        listed = self.shelf.read(FILE).get("spent")
        self._entries = (
            [_decoded(item) for item in listed if isinstance(item, dict)] if isinstance(listed, list) else []
        )
        if len(self.shelf.said) != found:
            self._entries = [Entry(now, stamp, self.boot, self.calls_per_hour, None)]
            self.save()

    def spent(self, now: float, stamp: str) -> Cost:
        """The cost of the last hour."""
        recent = [entry for entry in self._entries if self._age(entry, now, stamp) < WINDOW_SECONDS]
        known = [entry.usd for entry in recent if entry.usd is not None]
        return Cost(calls=sum(entry.calls for entry in recent), usd=sum(known))

    def free_at(self, now: float, stamp: str) -> float | None:
        """When the next call may be made (uptime); None: now."""
        total = self.spent(now, stamp)
        over = total.calls >= self.calls_per_hour
        untold = any(entry.usd is None and self._age(entry, now, stamp) < WINDOW_SECONDS for entry in self._entries)
        # A limit that cannot be measured is no limit, so an unknown cost counts as all of it.
        dear = self.usd_per_hour is not None and (untold or (total.usd or 0.0) >= self.usd_per_hour)
        if not over and not dear:
            return None
        ages = sorted((self._age(entry, now, stamp) for entry in self._entries), reverse=True)
        counted = [age for age in ages if age < WINDOW_SECONDS]
        return now + (WINDOW_SECONDS - counted[0] if counted else WINDOW_SECONDS)

    def left(self, now: float, stamp: str) -> int:
        """How many calls may still be made in this hour."""
        return max(0, self.calls_per_hour - self.spent(now, stamp).calls)

    def usd_left(self, now: float, stamp: str) -> float | None:
        """How many US dollars may still be spent in this hour; None where there is no cap."""
        if self.usd_per_hour is None:
            return None
        return max(0.0, self.usd_per_hour - (self.spent(now, stamp).usd or 0.0))

    def begin(self, now: float, stamp: str, most: int = ATTEMPTS) -> Entry | None:
        """Count a run of an agent that is about to start; None when that cannot be written down: it may not start.

        ``most`` is how often it may ask: so much is gone when no one hears of its end.
        """
        entry = Entry(now, stamp, self.boot, max(1, min(most, self.left(now, stamp))), None)
        self._entries = [*(item for item in self._entries if self._age(item, now, stamp) < WINDOW_SECONDS), entry][
            -LIMIT:
        ]
        if self.save():
            return entry
        self._entries.remove(entry)
        return None

    def settle(self, entry: Entry, cost: Cost) -> None:
        """Record the final cost of that run; none when no agent was called."""
        entry.calls, entry.usd = cost.calls, cost.usd
        if cost.calls == 0 and not cost.usd and entry in self._entries:
            self._entries.remove(entry)
        self.save()

    def _age(self, entry: Entry, now: float, stamp: str) -> float:
        """Seconds since an entry. From before a reboot only wall time is known; never less than since the boot."""
        if entry.boot == self.boot:
            return now - entry.at
        present, then = parse_stamp(stamp), parse_stamp(entry.stamp)
        passed = (present - then).total_seconds() if present is not None and then is not None else 0.0
        return max(passed, now)

    def save(self) -> bool:
        """Write all of it down; False when the disk refuses."""
        return self.shelf.write(FILE, {"spent": [asdict(entry) for entry in self._entries]})


def _decoded(item: dict[str, Any]) -> Entry:
    usd = item.get("usd")
    return Entry(
        at=number(item.get("at")),
        stamp=str(item.get("stamp", "")),
        boot=str(item.get("boot", "")),
        calls=int(number(item.get("calls"))),
        usd=None if usd is None else number(usd),
    )
