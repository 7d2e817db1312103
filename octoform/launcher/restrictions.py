"""What claims restrict for now: read from the file that octoform writes, let go of here at the moment each one names.

A claim is a conclusion, and whoever drew it may be gone or wrong. So nothing here lasts by itself: an entry counts in
the start of the machine that it names and until its moment, whether or not anybody lives to take it back. A file that
cannot be read restricts nothing, and that is said: a restriction that nobody can justify is none, and what the policy
says holds as before. Readings and tools that stop are never restricted, whatever the file says.
"""

import enum
import json
import os
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .saying import say

NAME = "restrictions.json"
FORMAT = 1
SIZE = 4 * 1024 * 1024
LONGEST = 25 * 3600.0
"""Seconds beyond which no end is believed: octoform lets no claim hold longer than a day without a new reading."""
SHOWN = 200
_BOOT = Path("/proc/sys/kernel/random/boot_id")

Tell = Callable[[str, Mapping[str, Any]], None]
"""Hears an event's name and its fields, for the audit log."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One restriction: of calls of ``tool`` whose ``arguments`` have one of these values each.

    ``effect`` is deny or confirm; ``expires`` in seconds of CLOCK_BOOTTIME, None until a person ends it.
    """

    claim: str
    tool: str
    arguments: tuple[tuple[str, tuple[Any, ...]], ...]
    effect: str
    statement: str
    expires: float | None
    expires_at: str

    def concerns(self, tool: str, arguments: Mapping[str, Any]) -> bool:
        """Whether a call with these effective arguments is restricted by it."""
        if tool != self.tool:
            return False
        return all(_names(arguments.get(name), values) for name, values in self.arguments)

    @property
    def words(self) -> str:
        """For whoever called, and for a person who is asked."""
        until = f"until {self.expires_at or 'its readings are clean'}" if self.expires is not None else "by a person"
        which = ", ".join(f"{name} {values[0]}" for name, values in self.arguments)
        what = f"{self.tool} ({which})" if which else self.tool
        text = f"{what} is restricted {until} by claim {self.claim}, which says {self.statement[:SHOWN]!a}"
        end = "It ends by itself once readings say otherwise" if self.expires is not None else "A person ends it"
        return f"{text}. {end}; octoform claims shows it"

    def shown(self, now: float) -> dict[str, Any]:
        """As plain values; ``seconds`` are left."""
        return {
            "claim": self.claim,
            "tool": self.tool,
            "arguments": {name: list(values) for name, values in self.arguments},
            "effect": self.effect,
            "statement": self.statement[:SHOWN],
            "expires_at": self.expires_at,
            "seconds": None if self.expires is None else round(max(0.0, self.expires - now), 1),
        }


def _untold(_event: str, _fields: Mapping[str, Any]) -> None:
    """Nobody hears of it."""


class Restrictions:
    """What is restricted now. Safe to use from threads; asking costs one look at the file's status.

    ``tell`` hears what begins and ends to count. ``clock`` is CLOCK_BOOTTIME.
    """

    def __init__(
        self,
        path: Path | None = None,
        tell: Tell = _untold,
        clock: Callable[[], float] | None = None,
        boot: str | None = None,
    ) -> None:
        self._place = None if path is None else str(path)
        self._tell, self._clock = tell, clock or boottime
        self._boot = _boot() if boot is None else boot
        self._lock = threading.Lock()
        self._seen: tuple[int, int, int] | None = None
        self._entries: tuple[Entry, ...] = ()
        self.problem: str | None = None
        """Why the file cannot be used; None when it can, or is not there."""

    def against(self, tool: str, arguments: Mapping[str, Any]) -> Entry | None:
        """What stands against a call, the strictest first; None when nothing does."""
        found = [entry for entry in self.in_force() if entry.concerns(tool, arguments)]
        return min(found, key=lambda entry: entry.effect != "deny", default=None)

    def in_force(self) -> tuple[Entry, ...]:
        """What counts now; what begins or ends to count with this look is told."""
        if self._place is None:
            return ()
        with self._lock:
            before = self._entries
            self._refresh(self._place)
            now = self._clock()
            self._entries = tuple(entry for entry in self._entries if entry.expires is None or now < entry.expires)
            if self._entries is not before and self._entries != before:
                self._changed(before, self._entries)
            return self._entries

    def shown(self) -> dict[str, Any]:
        """For a person who asks: ``in_force`` as plain values, ``problem`` with the file or None."""
        entries, now = self.in_force(), self._clock()
        return {"in_force": [entry.shown(now) for entry in entries], "problem": self.problem}

    def _refresh(self, place: str) -> None:
        try:
            status = os.lstat(place)
            stamp = status.st_ino, status.st_mtime_ns, status.st_size
        except FileNotFoundError:
            self._seen, self._entries, self.problem = None, (), None
            return
        except OSError as problem:
            self._wrong(f"it cannot be looked at: {problem.strerror}")
            return
        if stamp == self._seen:
            return
        self._seen, self._entries = stamp, ()
        try:
            self._entries, self.problem = self._read(place), None
        except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as problem:
            self._wrong(f"it cannot be read: {type(problem).__name__}: {problem}")

    def _wrong(self, why: str) -> None:
        self._entries = ()
        text = f"{self._place}: {why[:SHOWN]}; nothing is restricted by it"
        if text != self.problem:
            self.problem = text
            say(text)
            self._tell("restrictions_unreadable", {"text": text})

    def _read(self, place: str) -> tuple[Entry, ...]:
        descriptor = os.open(place, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW | os.O_CLOEXEC)
        with os.fdopen(descriptor, "rb") as file:
            text = file.read(SIZE + 1)
        if len(text) > SIZE:
            raise ValueError(f"it has more than {SIZE} bytes")
        document = json.loads(text)
        if document["format"] != FORMAT:
            raise ValueError(f"format {document['format']!r} is not known; this launcher reads {FORMAT}")
        here, latest = document["boot"] == self._boot, self._clock() + LONGEST
        entries = [_entry(item) for item in document["restrictions"]]
        return tuple(entry for entry in entries if entry.expires is None or (here and entry.expires <= latest))

    def _changed(self, before: Iterable[Entry], after: Iterable[Entry]) -> None:
        known, now = {_same(entry) for entry in before}, {_same(entry) for entry in after}
        for event, entries, others in (("restriction_over", before, now), ("restriction", after, known)):
            for entry in entries:
                if _same(entry) not in others:
                    self._tell(event, {name: value for name, value in entry.shown(0).items() if name != "seconds"})


def boottime() -> float:
    """Seconds since the machine was started, those of its sleep counted."""
    clock = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if clock is None else time.clock_gettime(clock)


def _boot() -> str:
    try:
        return _BOOT.read_text().strip()
    except OSError:
        return ""


def _entry(item: Mapping[str, Any]) -> Entry:
    effect, expires = str(item["effect"]), item["expires"]
    if effect not in ("deny", "confirm"):
        raise ValueError(f"{effect!r} is no effect of a restriction")
    if expires is not None and (isinstance(expires, bool) or not isinstance(expires, int | float)):
        raise ValueError("an end is a number of seconds")
    arguments = tuple((str(name), tuple(values)) for name, values in sorted(item["arguments"].items()))
    if not all(values for _, values in arguments):
        raise ValueError("an argument has no value")
    return Entry(
        str(item["claim"]),
        str(item["tool"]),
        arguments,
        effect,
        str(item["statement"]),
        expires,
        str(item["expires_at"]),
    )


def _same(entry: Entry) -> tuple[Any, ...]:
    """What stays when only its end is put off."""
    return entry.claim, entry.tool, repr(entry.arguments), entry.effect


def _names(given: Any, values: tuple[Any, ...]) -> bool:
    """Whether an argument is one of these values, or holds one of them."""
    if isinstance(given, enum.Enum):
        given = given.value
    if isinstance(given, Mapping):
        return any(_names(name, values) for name in given)
    if isinstance(given, list | tuple | set | frozenset):
        return any(_names(each, values) for each in given)
    return any(given == value and isinstance(given, bool) is isinstance(value, bool) for value in values)
