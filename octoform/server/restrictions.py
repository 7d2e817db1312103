"""Restrictions by claims: read from octoform's file, and released here at the moment that each one names.

A claim is a conclusion, and anyone who drew it may be gone or wrong. So it does not last by itself: an entry counts in
the start of the machine that it names and until its moment, whether or not anybody lives to take it back. A permanent
restriction is a person's decision: it has no moment, and only a file that no longer names it ends it. A file that
cannot be read, or is gone, ends what is temporary, and that is stated: a restriction that no one can justify is none.
Where the ledger of claims cannot be read either, and never was the file, nothing moves: a person may have forbidden it.
Readings and tools that stop are never restricted, whatever the file states.
"""

import enum
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from octoform.base.clock import boot_id, boottime
from octoform.base.files import read_json, record
from octoform.policy.published import Units
from octoform.server.process.stderr_log import write_line

NAME = "restrictions.json"
FORMAT = 1
SIZE = 4 * 1024 * 1024
MAX_SECONDS = 25 * 3600.0
"""Seconds beyond which no end is believed: octoform lets no claim hold longer than a day without a new reading."""
SHOWN = 200

Notify = Callable[[str, Mapping[str, Any]], None]
"""Hears an event's name and its fields, for the audit log."""


@dataclass(frozen=True, slots=True)
class Subject:
    """A call, as far as a restriction is about it: ``devices`` are those that it may reach.

    ``units`` states which units of them it acts on, ``known`` each device's units, by every word of its tools for one.
    """

    tool: str
    arguments: Mapping[str, Any]
    devices: tuple[str, ...] = ()
    units: Units | None = None
    known: Mapping[str, AbstractSet[str]] = field(default_factory=dict)

    def reaches(self, device: str) -> bool:
        """Whether it may reach a device: the one that it names, else any of its tool's."""
        named = self.arguments.get("device")
        named = named.value if isinstance(named, enum.Enum) else named
        return device == named if named in self.devices else device in self.devices

    def acts_on(self, device: str, words: frozenset[str]) -> bool:
        """Whether it acts on the unit of a device that these words mean; True where that cannot be determined."""
        if self.units is None or words.isdisjoint(self.known.get(device, ())):
            return True
        return self.units.acts_on(words, self.arguments)


@dataclass(frozen=True, slots=True)
class Entry:
    """One restriction: of calls that act on a unit, on a device, or of calls of a tool.

    With ``device`` it concerns every call that reaches it and acts on one of ``units`` (words for one unit; none: the
    whole device). Else it concerns calls of ``tool`` (empty: all) whose ``arguments`` have one of these values each.
    ``effect`` is deny or confirm; ``expires`` in seconds of CLOCK_BOOTTIME, None until a person ends it; ``kind``
    states what a permanent one declares.
    """

    claim: str
    tool: str
    arguments: tuple[tuple[str, tuple[Any, ...]], ...]
    effect: str
    statement: str
    expires: float | None
    expires_at: str
    device: str = ""
    units: tuple[str, ...] = ()
    kind: str = ""

    def concerns(self, call: Subject) -> bool:
        """Whether a call is restricted by it."""
        if self.device:
            return call.reaches(self.device) and (not self.units or call.acts_on(self.device, frozenset(self.units)))
        if self.tool not in ("", call.tool):
            return False
        return all(_names(call.arguments.get(name), values) for name, values in self.arguments)

    @property
    def words(self) -> str:
        """For anyone who called, and for a person who is asked."""
        if not self.claim:
            return (
                "nothing moves: what a person has forbidden cannot be read, neither in the ledger of claims nor in "
                f"{NAME}. A person looks at octoform claims, which starts both again, and decides what goes on"
            )
        if self.expires is None:
            kind = f"the permanent restriction {self.kind}" if self.kind else "a permanent restriction"
            how, end = f"by {kind} (claim {self.claim})", f"A person ends it with octoform claims -retire {self.claim}"
        else:
            until = self.expires_at or "its readings are clean"
            how = f"until {until} by the temporary claim {self.claim}"
            end = "It ends by itself once readings refute it; octoform claims shows it"
        return f"{self._what()} is restricted {how}: {self.statement[:SHOWN]!a}. {end}"

    def _what(self) -> str:
        if self.device:
            return f"{self.units[0]} of {self.device}" if self.units else self.device
        which = ", ".join(f"{name} {values[0]}" for name, values in self.arguments)
        return (f"{self.tool} ({which})" if which else self.tool) or "all that moves"

    def shown(self, now: float) -> dict[str, Any]:
        """As plain values; ``seconds`` are left."""
        return {
            "claim": self.claim,
            "tool": self.tool,
            "arguments": {name: list(values) for name, values in self.arguments},
            **({"device": self.device, "units": list(self.units)} if self.device else {}),
            **({"kind": self.kind} if self.kind else {}),
            "effect": self.effect,
            "statement": self.statement[:SHOWN],
            "expires_at": self.expires_at,
            "seconds": None if self.expires is None else round(max(0.0, self.expires - now), 1),
        }


NOBODY_KNOWS = Entry("", "", (), "deny", "", None, "")
"""What a ledger states that cannot be read: what a person has forbidden for good is not done for want of a list."""


def _no_listener(_event: str, _fields: Mapping[str, Any]) -> None:
    """No one hears of it."""


def _unknown() -> tuple[Entry, ...] | None:
    """There is no ledger."""
    return None


class Restrictions:
    """The present restrictions. Safe to use from threads; asking costs one look at the file's status.

    ``notify`` hears what begins and ends to count. ``clock`` is CLOCK_BOOTTIME. ``ledger`` states what must hold where
    the file does not; None: it does not know.
    """

    def __init__(
        self,
        path: Path | None = None,
        notify: Notify = _no_listener,
        clock: Callable[[], float] | None = None,
        boot: str | None = None,
        ledger: Callable[[], tuple[Entry, ...] | None] = _unknown,
    ) -> None:
        self._place = None if path is None else str(path)
        self._notify, self._clock, self._ledger = notify, clock or boottime, ledger
        self._boot = boot_id() if boot is None else boot
        self._lock = threading.Lock()
        self._seen: tuple[int, int, int] | None = None
        self._entries: tuple[Entry, ...] = ()
        self._read_before = False
        self.forbidden: Callable[[], AbstractSet[str]] = frozenset
        """The ids that a person's restrictions have; where one is missing, no one knows what it was."""
        self.problem: str | None = None
        """Why the file cannot be used; None when it can, or is not there."""

    def against(self, call: Subject) -> Entry | None:
        """The strictest restriction of a call; None when there is none."""
        found = [entry for entry in self.in_force() if entry.concerns(call)]
        return min(found, key=lambda entry: entry.effect != "deny", default=None)

    def in_force(self) -> tuple[Entry, ...]:
        """The restrictions in force; each begin and end since the last look is reported."""
        if self._place is None:
            return ()
        with self._lock:
            before = self._entries
            self._refresh(self._place)
            now = self._clock()
            self._entries = tuple(entry for entry in self._entries if entry.expires is None or now < entry.expires)
            if self._entries is not before and self._entries != before:
                self._changed(before, self._entries)
            missing = self.forbidden() - {entry.claim for entry in self._entries}
            return (*self._entries, NOBODY_KNOWS) if missing else self._entries

    def shown(self) -> dict[str, Any]:
        """For a person who asks: ``in_force`` as plain values, ``problem`` with the file or None."""
        entries, now = self.in_force(), self._clock()
        return {"in_force": [entry.shown(now) for entry in entries], "problem": self.problem}

    def _refresh(self, place: str) -> None:
        try:
            status = os.lstat(place)
            stamp = status.st_ino, status.st_mtime_ns, status.st_size
        except FileNotFoundError:
            self._seen, self._entries, self.problem = None, self._instead(), None
            return
        except OSError as problem:
            self._wrong(f"it cannot be looked at: {problem.strerror}")
            return
        if stamp == self._seen:
            self._entries = self._entries if self.problem is None else self._instead()
            return
        self._seen = stamp
        try:
            self._entries, self.problem, self._read_before = self._read(place), None, True
        except (OSError, ValueError, LookupError, TypeError, AttributeError) as problem:
            self._wrong(f"it cannot be read: {_words(problem)}")

    def _instead(self) -> tuple[Entry, ...]:
        """The restrictions without the file: those of the ledger, else those that only a person ends."""
        found = self._ledger()
        if found is None or (self._read_before and NOBODY_KNOWS in found):
            return tuple(entry for entry in self._entries if entry.expires is None)
        latest = self._clock() + MAX_SECONDS
        return tuple(entry for entry in found if entry.expires is None or entry.expires <= latest)

    def _wrong(self, why: str) -> None:
        self._entries = self._instead()
        kept = "only the permanent restrictions from before hold" if self._entries else "nothing is restricted by it"
        if NOBODY_KNOWS in self._entries:
            kept = "nothing moves, since the ledger of claims cannot be read either"
        elif (found := self._ledger()) is not None and NOBODY_KNOWS not in found:
            kept = "the ledger of claims is in force"
        text = f"{self._place}: {why[:SHOWN]}; {kept}"
        if text != self.problem:
            self.problem = text
            write_line(text)
            self._notify("restrictions_unreadable", {"text": text})

    def _read(self, place: str) -> tuple[Entry, ...]:
        document = record(read_json(Path(place), SIZE, follow=False, any_text=True), FORMAT)
        here, latest = document["boot"] == self._boot, self._clock() + MAX_SECONDS
        entries = [_entry(item) for item in document["restrictions"]]
        return tuple(entry for entry in entries if entry.expires is None or (here and entry.expires <= latest))

    def _changed(self, before: Iterable[Entry], after: Iterable[Entry]) -> None:
        known, now = {_same(entry) for entry in before}, {_same(entry) for entry in after}
        for event, entries, others in (("restriction_over", before, now), ("restriction", after, known)):
            for entry in entries:
                if _same(entry) not in others:
                    self._notify(event, {name: value for name, value in entry.shown(0).items() if name != "seconds"})


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
        str(item.get("device") or ""),
        tuple(str(word) for word in item.get("units") or ()),
        str(item.get("kind") or ""),
    )


def _same(entry: Entry) -> tuple[Any, ...]:
    """The identity of a restriction, which stays when only its end is put off."""
    return entry.claim, entry.tool, repr(entry.arguments), entry.device, entry.units, entry.effect


def _names(given: Any, values: tuple[Any, ...]) -> bool:
    """Whether an argument is one of these values, or holds one of them."""
    if isinstance(given, enum.Enum):
        given = given.value
    if isinstance(given, Mapping):
        return any(_names(name, values) for name in given)
    if isinstance(given, list | tuple | set | frozenset):
        return any(_names(each, values) for each in given)
    return any(given == value and isinstance(given, bool) is isinstance(value, bool) for value in values)


def _words(problem: Exception) -> str:
    if isinstance(problem, OSError):
        return problem.strerror or str(problem)
    return str(problem) if isinstance(problem, ValueError) else "it has another form than the ledger of claims writes"


# The restrictions of the ledger of claims: believed where the file that octoform makes of it is not there.
#
# That file knows every word for a unit; the ledger has the one of the claim alone. A word that no tool has means every
# unit, so what comes of this restricts as much or more until octoform writes the file again. Where neither can be read,
# nothing moves.

CLAIMS_NAME = "claims.json"
CLAIMS_SIZE = 8 * 1024 * 1024
WITNESS = "forbidden.json"
UNTOLD = "c0"


class Forbidden:
    """The ids of a person's restrictions at ``path``, read again when it changes. Not safe to use from threads."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seen: tuple[int, int, int] | None = None
        self._ids: frozenset[str] = frozenset()

    def __call__(self) -> frozenset[str]:
        """Those that must be in force; one that no restriction has where the file cannot be read."""
        try:
            status = os.lstat(self._path)
            stamp = status.st_ino, status.st_mtime_ns, status.st_size
            if stamp != self._seen:
                self._ids = frozenset(str(each) for each in read_json(self._path, CLAIMS_SIZE, follow=False)["claims"])
                self._seen = stamp
        except FileNotFoundError:
            self._seen, self._ids = None, frozenset()
        except (OSError, ValueError, LookupError, TypeError, AttributeError):
            self._seen, self._ids = None, frozenset((UNTOLD,))
        return self._ids


class Standing:
    """The restrictions of the ledger at ``path``, read again when it changes. Not safe to use from threads."""

    def __init__(self, path: Path, boot: str) -> None:
        self._path, self._boot = path, boot
        self._seen: tuple[int, int, int] | None = None
        self._entries: tuple[Entry, ...] | None = None

    def __call__(self) -> tuple[Entry, ...] | None:
        """The ledger's restrictions; None without a ledger. An unreadable one may hide a person's prohibition."""
        try:
            status = os.lstat(self._path)
            stamp = status.st_ino, status.st_mtime_ns, status.st_size
            if stamp != self._seen:
                self._seen, self._entries = stamp, (NOBODY_KNOWS,)
                self._entries = tuple(self._read())
        except FileNotFoundError:
            self._seen = self._entries = None
        except (OSError, ValueError, LookupError, TypeError, AttributeError):
            self._entries = (NOBODY_KNOWS,)
        return self._entries

    def _read(self) -> Iterator[Entry]:
        document = record(read_json(self._path, CLAIMS_SIZE, follow=False, any_text=True), FORMAT)
        here = document["boot"] == self._boot
        for claim in document["claims"]:
            if claim["state"] == "active" and (here or claim["expires"] is None):
                yield from _of(claim)


def _of(claim: Mapping[str, Any]) -> Iterator[Entry]:
    """Its declaration, and what it restricts for a time."""
    kind, _, name = str(claim["target"]).partition(":")
    device, _, unit = name.partition("/") if kind == "device" else ("", "", "")
    expires = None if claim["expires"] is None else float(claim["expires"])
    end = expires, str(claim["expires_at"])
    identity, statement, units = str(claim["id"]), str(claim["statement"]), (unit,) if unit else ()
    if claim["irreversible"] is not None:
        tool = name if kind == "tool" else ""
        yield Entry(identity, tool, (), "deny", statement, *end, device, units, str(claim["irreversible"]))
    for each in claim["restrictions"]:
        tool, effect = str(each["tool"]), str(each["effect"])
        if units:
            yield Entry(identity, tool, (), effect, statement, *end, device, units)
        else:
            arguments = tuple((str(key), (value,)) for key, value in sorted(each["arguments"].items()))
            yield Entry(identity, tool, arguments, effect, statement, *end)
