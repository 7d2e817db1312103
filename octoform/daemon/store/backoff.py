"""No repair permanently: three tries for one problem, each later than the one before, and then a person.

A problem is known by its key (target, class, digest of the evidence). Tries are written down before they are made, so
that a repair which kills the daemon is counted too, and a freeze survives restarts and reboots. What stayed away long
enough is forgiven; what comes back sooner was not repaired, whatever it looked like. Words that change each time are
other evidence, so the tries of a target and class are counted for an hour as well, whatever they were made for. Light.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from octoform.daemon.model import Outcome, Repair
from octoform.daemon.store.incidents import Incident
from octoform.daemon.store.json_store import Shelf, number
from octoform.records import dataclass, field, replace

FILE = "breakers.json"
FIRST_SECONDS = 5.0
"""Seconds between the first try and the second."""
FACTOR = 4.0
MAX_SECONDS = 3600.0
HOLD_SECONDS = 30.0
"""How long a problem must stay away before its tries are forgiven; what returns sooner continues the count."""
FLAPS = 20
"""Repairs of one problem within `FLAP_SECONDS` that each seemed to help, before it is frozen all the same."""
FLAP_SECONDS = 3600.0
FORGIVE_SECONDS = 900.0
"""How long a problem must stay away before everything of it is forgotten: somebody has fixed it for good."""
HOUR_SECONDS = 3600.0
LIMIT = 500


@dataclass(frozen=True, slots=True)
class Backoff:
    """The tries for one problem. Times are seconds of uptime in the boot ``boot``.

    ``tries`` since it was last forgiven, ``step`` the place in its chain of repairs (beyond the end: the last one),
    ``next`` when it may be tried again, ``gone`` since when it is away (None while it is there), ``helped`` when
    repairs seemed to help.
    """

    key: str
    target: str
    boot: str
    tries: int = 0
    step: int = 0
    next: float = 0.0
    frozen: str | None = None
    """Why nothing is tried any more; None while it may be."""
    since: str = ""
    gone: float | None = None
    helped: tuple[float, ...] = ()
    hopeless: tuple[str, ...] = ()
    """Repairs whose result was that no further try can help."""
    terms: str = ""
    """The manifest's terms when a re-discovery ended in a question; empty: none did."""

    def next_of(self, chain: Sequence[Repair]) -> Repair:
        """The repair of its chain that is tried next: from its step on, and none that can help no more."""
        left = [repair for repair in chain if repair not in self.hopeless] or list(chain)
        return next((repair for repair in chain[self.step :] if repair in left), left[-1])


@dataclass(slots=True)
class Backoffs:
    """All of a host's breakers; every change is on disk before the repair that it is about."""

    shelf: Shelf
    boot: str
    limit: int = 3
    hold: float = HOLD_SECONDS
    _all: dict[str, Backoff] = field(default_factory=dict)
    _tries: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """Uptimes of the tries of the last hour, by `_kin`."""
    _troubled: frozenset[str] = frozenset()

    def load(self, now: float) -> None:
        """Take up what the daemon before this one knew; after a reboot nothing waits any more, and freezes stay."""
        document = self.shelf.read(FILE)
        same = document.get("boot") == self.boot
        for name, times in _times(document).items():
            self._tries[name] = times if same else (now,) * len(times)
        for item in _entries(document):
            gone = item.gone if same else None if item.gone is None else now
            helped = item.helped if same else ()
            self._all[item.key] = replace(
                item, boot=self.boot, next=item.next if same else now, gone=gone, helped=helped
            )

    def of(self, key: str, target: str = "") -> Backoff:
        """The breaker of a problem; a new one allows its first try at once."""
        return self._all.get(key) or Backoff(key, target, self.boot)

    def frozen(self) -> tuple[Backoff, ...]:
        """Those that try no more; a problem of some of them may be over, and not forgotten yet."""
        return tuple(item for item in self._all.values() if item.frozen is not None)

    def given_up(self, lasting: Iterable[Incident]) -> tuple[Backoff, ...]:
        """Why nothing is tried any more for those of these problems that last and were given up, under their target."""
        found = []
        for episode in lasting:
            keys = [episode.key, *([episode.diagnosis.key] if episode.diagnosis is not None else [])]
            frozen = next((item for item in map(self.of, keys) if item.frozen is not None), None)
            if not episode.over and episode.outcome is Outcome.FROZEN and frozen is not None:
                found.append(replace(frozen, target=episode.target))
        return tuple(found)

    def all(self) -> tuple[Backoff, ...]:
        """Every problem that is remembered."""
        return tuple(self._all.values())

    def begin(self, key: str, target: str, now: float, *, quick: bool = False) -> Backoff:
        """Count a try that is about to be made, and set when the next one may be.

        Those of ``quick`` repairs have an hour's count of their own.
        """
        item = self.of(key, target)
        self._tries = {name: times for name, times in self._tries.items() if now - times[-1] < HOUR_SECONDS}
        self._tries[_kin(key, quick=quick)] = (*self.in_hour(key, now, quick=quick), now)
        pause = min(MAX_SECONDS, FIRST_SECONDS * FACTOR**item.tries)
        item = replace(item, target=target, tries=item.tries + 1, next=now + pause, gone=None)
        self._put(item)
        return item

    def in_hour(self, key: str, now: float, *, quick: bool = False) -> tuple[float, ...]:
        """When tries were made for this target and class in the last hour, whatever their evidence (uptimes)."""
        return tuple(at for at in self._tries.get(_kin(key, quick=quick), ()) if now - at < HOUR_SECONDS)

    def failed(
        self, key: str, now: float, *, chain: Sequence[str], limit: int, stamp: str, hopeless: str | None = None
    ) -> Backoff:
        """A try did not help: on to the next repair of ``chain``, or frozen after ``limit`` tries.

        ``hopeless`` is the repair that was made, where it can never help: then it is tried no more, wherever it is
        in the chain, and the next one is tried at once.
        """
        item = self._all.get(key)
        if item is None:
            return Backoff(key, "", self.boot)  # a person wants it tried again: what was tried before counts no more
        ruled = item.hopeless if hopeless is None else tuple(dict.fromkeys((*item.hopeless, hopeless)))
        later = [step for step in range(item.step + 1, len(chain)) if chain[step] not in ruled]
        at_once = hopeless is not None and bool(later)
        item = replace(item, step=later[0] if later else item.step, hopeless=ruled)
        item = replace(item, next=now if at_once else max(item.next, now))
        if (not later and hopeless is not None) or item.tries >= limit:
            count = f"{item.tries} tries" if item.tries > 1 else "one try"
            item = replace(item, frozen=f"{count} did not help", since=stamp)
        self._put(item)
        return item

    def seen(self, key: str, target: str, now: float, stamp: str) -> Backoff:
        """The problem is there: a freeze stays, and one that came back too soon goes on where it was."""
        item = self._all.get(key)
        if item is None or item.gone is None:
            return item or self.of(key, target)
        recent = tuple(at for at in item.helped if now - at < FLAP_SECONDS)
        if now - item.gone >= self.hold and item.frozen is None:
            item = replace(item, tries=0, step=0, next=now, gone=None, helped=recent, hopeless=())
        else:
            item = replace(item, step=item.step + 1, gone=None, helped=recent)
            if item.tries >= self.limit and item.frozen is None:
                item = replace(item, frozen=f"{item.tries} repairs did not hold", since=stamp)
        if len(recent) >= FLAPS and item.frozen is None:
            item = replace(item, frozen=f"it came back {len(recent)} times in an hour", since=stamp)
        self._put(item)
        return item

    def away(self, key: str, now: float, *, repaired: bool) -> None:
        """The problem is not there any more."""
        item = self._all.get(key)
        if item is None or item.gone is not None:
            return
        helped = (*item.helped, now)[-FLAPS:] if repaired else item.helped
        self._put(replace(item, gone=now, helped=helped))

    def troubled(self, targets: frozenset[str], now: float) -> None:
        """These targets are in a problem now.

        What was in a problem until now has not held, whatever its problem was.
        """
        for key, item in self._all.items():
            if item.gone is not None and item.target in self._troubled:
                self._all[key] = replace(item, gone=now)
        self._troubled = targets

    def forgive(self, now: float) -> None:
        """Forget what stayed away for long, freezes too: it is another problem when it comes again."""
        old = [item.key for item in self._all.values() if item.gone is not None and now - item.gone >= FORGIVE_SECONDS]
        for key in old:
            del self._all[key]
        if old:
            self.save()

    def thaw(self, target: str) -> tuple[str, ...]:
        """Let a target (``*``: every one) be tried again from the first repair on; the keys that were there."""
        keys = tuple(item.key for item in self._all.values() if target in ("*", item.target))
        for key in keys:
            del self._all[key]
        kept = {name: times for name, times in self._tries.items() if not _concerns(target, name)}
        if keys or kept != self._tries:
            self._tries = kept
            self.save()
        return keys

    def under(self, key: str, terms: str) -> None:
        """A re-discovery ended in a question that ``terms`` may have made."""
        if (item := self._all.get(key)) is not None:
            self._put(replace(item, terms=terms))

    def forget(self, key: str) -> None:
        """A problem may be tried as if it never was."""
        if self._all.pop(key, None) is not None:
            self.save()

    def freeze(self, key: str, target: str, why: str, stamp: str) -> None:
        """True when the repairs of this problem gave up."""
        self._put(replace(self.of(key, target), target=target, frozen=why, since=stamp, gone=None))

    def _put(self, item: Backoff) -> None:
        self._all[item.key] = item
        if len(self._all) > LIMIT:
            spare = sorted((one for one in self._all.values() if one.frozen is None), key=lambda one: one.next)
            for one in spare[: len(self._all) - LIMIT]:
                del self._all[one.key]
        self.save()

    def save(self) -> None:
        """Write all of it down."""
        listed = [
            {name: value for name, value in asdict(item).items() if name != "boot"} for item in self._all.values()
        ]
        self.shelf.write(FILE, {"boot": self.boot, "tries": self._tries, "breakers": listed})


def _kin(key: str, *, quick: bool) -> str:
    """The common key of a target and class: a key without its evidence."""
    return f"{key.rpartition(' ')[0]}{' quick' if quick else ''}"


def _concerns(target: str, name: str) -> bool:
    return target == "*" or name.removesuffix(" quick").rpartition(" ")[0] == target


def _times(document: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    found = document.get("tries")
    listed = found.items() if isinstance(found, dict) else ()
    return {name: tuple(number(at) for at in times) for name, times in listed if isinstance(times, list) and times}


def _entries(document: Mapping[str, Any]) -> Iterable[Backoff]:
    boot = str(document.get("boot", ""))
    listed = document.get("breakers")
    for entry in listed if isinstance(listed, list) else ():
        if isinstance(entry, dict) and isinstance(entry.get("key"), str):
            yield _decoded(entry, boot)


def _decoded(entry: Mapping[str, Any], boot: str) -> Backoff:
    helped, gone, frozen = entry.get("helped"), entry.get("gone"), entry.get("frozen")
    hopeless = entry.get("hopeless")
    return Backoff(
        key=entry["key"],
        target=str(entry.get("target", "")),
        boot=boot,
        tries=int(number(entry.get("tries"))),
        step=int(number(entry.get("step"))),
        next=number(entry.get("next")),
        frozen=None if frozen is None else str(frozen),
        since=str(entry.get("since", "")),
        gone=None if gone is None else number(gone),
        helped=tuple(number(at) for at in helped) if isinstance(helped, list) else (),
        hopeless=tuple(str(name) for name in hopeless) if isinstance(hopeless, list) else (),
        terms=str(entry.get("terms") or ""),
    )
