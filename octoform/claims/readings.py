"""The readings that the host remembers: a bounded number of each signal, on disk, so that a claim can cite them. Light.

Kept of each signal are its last readings and its extremes; the extremes show whether a signal has ever read otherwise.
Readings of an earlier start of the machine are no evidence any more and are not kept. They are appended without being
synced: what a power cut takes is of an earlier start afterwards anyway.
"""

import contextlib
import json
import math
import os
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from octoform.base.files import move, parse, record, write_all
from octoform.claims.model import Channel, Condition, Reading, Signal, holds
from octoform.conditions import is_number
from octoform.diagnostics import Diagnostic, warning
from octoform.state.files import display, read_regular, refused, write_atomic

FORMAT = 1
OF_ONE = 16
MAX_SIGNALS = 1000
MAX_TEXTS = 4
COMPACT_BYTES = 2_000_000
SIZE_LIMIT = 16 * 1024 * 1024


@dataclass(slots=True)
class _Series:
    last: deque[Reading] = field(default_factory=lambda: deque(maxlen=OF_ONE))
    extremes: dict[str, Reading] = field(default_factory=dict)

    def add(self, reading: Reading) -> None:
        if self.last and reading.uptime < self.last[-1].uptime:
            self.last = deque(sorted((*self.last, reading), key=lambda each: each.uptime), maxlen=OF_ONE)
        else:
            self.last.append(reading)
        value = reading.value
        if is_number(value):
            for name, beats in (("low", _below), ("high", _above)):
                if name not in self.extremes or beats(reading, self.extremes[name]):
                    self.extremes[name] = reading
        elif value is not None and len(self.extremes) < MAX_TEXTS:
            self.extremes.setdefault(f"={value}", reading)

    def all(self) -> Iterator[Reading]:
        yield from self.extremes.values()
        yield from self.last


def _below(one: Reading, other: Reading) -> bool:
    return float(one.value or 0) < float(other.value or 0)


def _above(one: Reading, other: Reading) -> bool:
    return float(one.value or 0) > float(other.value or 0)


class Readings:
    """Readings of one start of the machine at ``path``. The caller holds the ledger's lock while it writes."""

    def __init__(self, path: Path, boot: str) -> None:
        self._path, self._boot = path, boot
        self._series: dict[Signal, _Series] = {}
        self._kept: dict[str, Reading] = {}
        self._seen: tuple[int, int, int] | None = None

    def find(self, identity: str) -> Reading | None:
        """A reading by its id; None when it is not remembered."""
        return self._kept.get(identity)

    def latest(self, signal: Signal) -> Reading | None:
        """The newest one of a signal, readable or not."""
        series = self._series.get(signal)
        return series.last[-1] if series is not None and series.last else None

    def of(self, signal: Signal) -> tuple[Reading, ...]:
        """The last readings of a signal, oldest first."""
        series = self._series.get(signal)
        return tuple(series.last) if series is not None else ()

    def newest(self) -> tuple[Reading, ...]:
        """The newest reading of every signal."""
        return tuple(series.last[-1] for series in self._series.values() if series.last)

    def ever_otherwise(self, signal: Signal, condition: Condition) -> bool:
        """Whether the signal has ever read a value at which the condition does not hold."""
        series = self._series.get(signal)
        return series is not None and any(holds(condition, each.value) is False for each in series.all())

    def refresh(self, *, shut: bool = False) -> list[Diagnostic]:
        """Read what another process wrote; what is damaged is reported and omitted.

        With ``shut`` no one else may have written: then what is known here is written again, and nothing is read.
        """
        seen = _stamp(self._path)
        if seen == self._seen and seen is not None:
            return []
        if shut:
            return self._start(self._kept.values())
        self._seen = seen
        data, problem = read_regular(self._path, SIZE_LIMIT)
        if problem is not None:
            return [*self._move_aside(), problem]
        if data is None:
            return []
        return self._load(data)

    def is_mine(self) -> bool:
        """Whether the file is as this process left or read it."""
        return _stamp(self._path) == self._seen

    def add(self, readings: Iterable[Reading], cited: Collection[str]) -> list[Diagnostic]:
        """Remember these, on disk too; ``cited`` are ids that must not be forgotten."""
        fresh = [each for each in readings if each.id not in self._kept]
        for each in fresh:
            self._put(each)
        found = self._append(fresh)
        if self._seen is not None and self._seen[1] > COMPACT_BYTES:
            found.extend(self._compact(cited))
        if len(self._kept) > 2 * sum(1 for _ in self._alive()) + 64:
            self._forget(cited)
        return found

    def _put(self, reading: Reading) -> None:
        series = self._series.pop(reading.signal, None) or _Series()
        self._series[reading.signal] = series  # the one that was written last stands last
        series.add(reading)
        self._kept[reading.id] = reading
        while len(self._series) > MAX_SIGNALS:
            self._series.pop(next(iter(self._series)))

    def _alive(self) -> Iterator[Reading]:
        for series in self._series.values():
            yield from series.all()

    def _forget(self, cited: Collection[str]) -> None:
        alive = {each.id: each for each in self._alive()}
        alive.update({name: self._kept[name] for name in cited if name in self._kept})
        self._kept = alive

    def _load(self, data: bytes) -> list[Diagnostic]:
        lines = data.decode("utf-8", "replace").splitlines()
        try:
            header = record(parse(lines[0] if lines else b""), FORMAT)
        except ValueError:
            return self._move_aside()
        if header.get("boot") != self._boot:
            return self._start(())
        damaged = 0
        for line in lines[1:]:
            reading = of_json(_object(line))
            if reading is None:
                damaged += 1
            elif reading.id not in self._kept:
                self._put(reading)
        # What comes next must not stand on the line of one that was cut off.
        items = [] if data.endswith(b"\n") else self._start(self._kept.values())
        if not damaged:
            return items
        text = f"{damaged} of {len(lines) - 1} remembered readings cannot be read and are skipped"
        return [*items, self._damaged(text)]

    def _append(self, readings: Iterable[Reading]) -> list[Diagnostic]:
        text = "".join(json.dumps(to_json(each), separators=(",", ":")) + "\n" for each in readings)
        if not text:
            return []
        if self._seen is None:
            return self._start(self._alive())
        try:
            descriptor = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
            try:
                write_all(descriptor, text.encode("ascii"))
            finally:
                os.close(descriptor)
        except OSError as problem:
            self._seen = None
            return [refused(problem, self._path)]
        self._seen = _stamp(self._path)
        return []

    def _compact(self, cited: Collection[str]) -> list[Diagnostic]:
        self._forget(cited)
        return self._start(self._kept.values())

    def _start(self, readings: Iterable[Reading]) -> list[Diagnostic]:
        """A new file with these."""
        unique = {each.id: each for each in readings}
        ordered = sorted(unique.values(), key=lambda each: each.uptime)
        lines = [{"format": FORMAT, "boot": self._boot}, *(to_json(each) for each in ordered)]
        text = "".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines)
        problem = write_atomic(self._path, text.encode("ascii"), 0o600)
        self._seen = None if problem is not None else _stamp(self._path)
        return [] if problem is None else [problem]

    def _move_aside(self) -> list[Diagnostic]:
        """Move a foreign file away and go on without what it held."""
        aside = self._path.with_name(f"{self._path.name}.aside")
        with contextlib.suppress(OSError):  # the next write replaces it or reports why not
            move(self._path, aside)
        self._seen = None
        return [self._damaged("the remembered readings cannot be read, so none of them is evidence any more")]

    def _damaged(self, text: str) -> Diagnostic:
        return warning("CLAIM-READINGS-DAMAGED", text, path=display(self._path))


def to_json(reading: Reading) -> dict[str, Any]:
    """A reading as JSON, as it is remembered and as an agent is shown it."""
    signal = reading.signal
    fields = {
        "id": reading.id,
        "at": reading.at,
        "uptime": math.floor(reading.uptime * 1000) / 1000,  # never later than it was
        "channel": signal.channel.value,
        "source": signal.source,
        "path": signal.path,
        "value": reading.value,
    }
    return {**fields, "why": reading.why} if reading.why else fields


def of_json(document: Mapping[str, Any] | None) -> Reading | None:
    """The reading in an object; None when it is none."""
    if document is None:
        return None
    try:
        signal = Signal(Channel(document["channel"]), str(document["source"]), str(document["path"]))
        value = document["value"]
        if not isinstance(value, bool | int | float | str | None) or not is_number(document["uptime"]):
            return None
        uptime = float(document["uptime"])
        return Reading(str(document["id"]), str(document["at"]), uptime, signal, value, str(document.get("why", "")))
    except (KeyError, ValueError, TypeError):
        return None


def _object(line: str) -> dict[str, Any] | None:
    try:
        found = parse(line)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def _stamp(path: Path) -> tuple[int, int, int] | None:
    try:
        status = path.lstat()
    except OSError:
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns
