"""No repair for ever: three tries for one trouble, each later than the one before, and then a person.

A trouble is known by its key (target, class, digest of the evidence). Tries are written down before they are made, so
that a repair which kills the daemon is counted too, and a freeze survives restarts and reboots. What stayed away long
enough is forgiven; what comes back sooner was not repaired, whatever it looked like. Light.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from octoform.daemon.records.shelf import Shelf, number

FILE = "breakers.json"
FIRST_SECONDS = 5.0
"""Between the first try and the second."""
FACTOR = 4.0
LONGEST_SECONDS = 3600.0
HOLD_SECONDS = 30.0
"""How long a trouble must stay away before its tries are forgiven; what returns sooner continues the count."""
FLAPS = 20
"""Repairs of one trouble within `FLAP_SECONDS` that each seemed to help, before it is frozen all the same."""
FLAP_SECONDS = 3600.0
FORGIVE_SECONDS = 900.0
"""How long a trouble must stay away before everything of it is forgotten: somebody has mended it for good."""
LIMIT = 500


@dataclass(frozen=True, slots=True)
class Breaker:
    """The tries for one trouble. Times are seconds of uptime in the boot ``boot``.

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


@dataclass(slots=True)
class Breakers:
    """All of a host's breakers; every change is on disk before the repair that it is about."""

    shelf: Shelf
    boot: str
    limit: int = 3
    hold: float = HOLD_SECONDS
    _all: dict[str, Breaker] = field(default_factory=dict)
    _troubled: frozenset[str] = frozenset()

    def load(self, now: float) -> None:
        """Take up what the daemon before this one knew; after a reboot nothing waits any more, and freezes stay."""
        for item in _entries(self.shelf.read(FILE)):
            same = item.boot == self.boot
            gone = item.gone if same else None if item.gone is None else now
            helped = item.helped if same else ()
            self._all[item.key] = replace(
                item, boot=self.boot, next=item.next if same else now, gone=gone, helped=helped
            )

    def of(self, key: str, target: str = "") -> Breaker:
        """The breaker of a trouble; a new one allows its first try at once."""
        return self._all.get(key) or Breaker(key, target, self.boot)

    def frozen(self) -> tuple[Breaker, ...]:
        """Those that wait for a person."""
        return tuple(item for item in self._all.values() if item.frozen is not None)

    def all(self) -> tuple[Breaker, ...]:
        """Every trouble that is remembered."""
        return tuple(self._all.values())

    def begin(self, key: str, target: str, now: float) -> Breaker:
        """Count a try that is about to be made, and set when the next one may be."""
        item = self.of(key, target)
        pause = min(LONGEST_SECONDS, FIRST_SECONDS * FACTOR**item.tries)
        item = replace(item, target=target, tries=item.tries + 1, next=now + pause, gone=None)
        self._put(item)
        return item

    def failed(self, key: str, now: float, *, again: bool, chain: int, limit: int, stamp: str) -> Breaker:
        """A try did not help: on to the next of ``chain`` repairs, or frozen after ``limit`` tries.

        ``again`` False: this repair can never help, so the next one is tried at once.
        """
        item = self.of(key)
        last = item.step >= chain - 1
        step = item.step if last else item.step + 1
        item = replace(item, step=step, next=now if not again and not last else max(item.next, now))
        if (last and not again) or item.tries >= limit:
            count = f"{item.tries} tries" if item.tries > 1 else "one try"
            item = replace(item, frozen=f"{count} did not help", since=stamp)
        self._put(item)
        return item

    def seen(self, key: str, target: str, now: float, stamp: str) -> Breaker:
        """The trouble is there: a freeze stays, and one that came back too soon goes on where it was."""
        item = self._all.get(key)
        if item is None or item.gone is None:
            return item or self.of(key, target)
        recent = tuple(at for at in item.helped if now - at < FLAP_SECONDS)
        if now - item.gone >= self.hold and item.frozen is None:
            item = replace(item, tries=0, step=0, next=now, gone=None, helped=recent)
        else:
            item = replace(item, step=item.step + 1, gone=None, helped=recent)
            if item.tries >= self.limit and item.frozen is None:
                item = replace(item, frozen=f"{item.tries} repairs did not hold", since=stamp)
        if len(recent) >= FLAPS and item.frozen is None:
            item = replace(item, frozen=f"it came back {len(recent)} times in an hour", since=stamp)
        self._put(item)
        return item

    def away(self, key: str, now: float, *, repaired: bool) -> None:
        """The trouble is not there any more."""
        item = self._all.get(key)
        if item is None or item.gone is not None:
            return
        helped = (*item.helped, now)[-FLAPS:] if repaired else item.helped
        self._put(replace(item, gone=now, helped=helped))

    def troubled(self, targets: frozenset[str], now: float) -> None:
        """These targets are in trouble now. What was in trouble until now has not held, whatever its trouble was."""
        for key, item in self._all.items():
            if item.gone is not None and item.target in self._troubled:
                self._all[key] = replace(item, gone=now)
        self._troubled = targets

    def forgive(self, now: float) -> None:
        """Forget what stayed away for long, freezes too: it is another trouble when it comes again."""
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
        if keys:
            self.save()
        return keys

    def freeze(self, key: str, target: str, why: str, stamp: str) -> None:
        """Nothing is tried any more for this trouble."""
        self._put(replace(self.of(key, target), target=target, frozen=why, since=stamp, gone=None))

    def _put(self, item: Breaker) -> None:
        self._all[item.key] = item
        if len(self._all) > LIMIT:
            spare = sorted((one for one in self._all.values() if one.frozen is None), key=lambda one: one.next)
            for one in spare[: len(self._all) - LIMIT]:
                del self._all[one.key]
        self.save()

    def save(self) -> None:
        """Write all of it down."""
        self.shelf.write(FILE, {"boot": self.boot, "breakers": [_encoded(item) for item in self._all.values()]})


def _encoded(item: Breaker) -> dict[str, Any]:
    return {
        "key": item.key,
        "target": item.target,
        "tries": item.tries,
        "step": item.step,
        "next": item.next,
        "frozen": item.frozen,
        "since": item.since,
        "gone": item.gone,
        "helped": list(item.helped),
    }


def _entries(document: Mapping[str, Any]) -> Iterable[Breaker]:
    boot = str(document.get("boot", ""))
    listed = document.get("breakers")
    for entry in listed if isinstance(listed, list) else ():
        if isinstance(entry, dict) and isinstance(entry.get("key"), str):
            yield _decoded(entry, boot)


def _decoded(entry: Mapping[str, Any], boot: str) -> Breaker:
    helped, gone, frozen = entry.get("helped"), entry.get("gone"), entry.get("frozen")
    return Breaker(
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
    )
