"""The counters of the limits, and the file that keeps them over a restart.

Each counted call appends one line before the call goes on: the sums and last values of its tool, and its own moment
alone, however many moments there are already. When the lines outgrow what they stand for, the file is written again
with one line for each tool, which holds all. (Replacing it for each call would cost a tenth of a millisecond.) A file
that is cut off, empty or not wholly understood is damaged: no one knows what it lost.

Times are those of the clock that only goes forward; they hold as they are while the machine has not been started again.
After that the wall clock states how much time went by, and where it went backwards, none did: a cooldown then lasts
once more, but not permanently.
"""

import json
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from octoform.base import files
from octoform.base.clock import boot_id
from octoform.base.files import private_folder

HEADER = {"format": 1}
_COMPACT_BYTES = 262_144
_LARGEST = 256_000_000
"""Bytes that are read: several times what the moments of a host's tools can come to."""
_APPEND = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK


class CountersUnwritable(OSError):
    """The file could not be replaced; what was to be counted is not counted."""


@dataclass(frozen=True, slots=True)
class Used:
    """The counters of one tool: sums and last values by parameter, moments of calls (seconds of the clock, ascending).

    A call that failed may have moved the device or not: by ``doubts`` a sum may really be (lower, higher) than counted.
    ``damaged``: it is not known, because the file could not be read.
    """

    sums: Mapping[str, Fraction] = field(default_factory=dict)
    last: Mapping[str, Fraction] = field(default_factory=dict)
    calls: tuple[float, ...] = ()
    damaged: bool = False
    doubts: Mapping[str, tuple[Fraction, Fraction]] = field(default_factory=dict)
    outside: Mapping[str, str] = field(default_factory=dict)
    """Units that the device reported outside of their range after a call, in words."""

    def shown(self, now: float) -> dict[str, Any]:
        """As plain values; calls as ages in seconds."""
        return {
            "sums": {name: _plain(value) for name, value in self.sums.items()},
            "last": {name: _plain(value) for name, value in self.last.items()},
            "calls": [round(max(0.0, now - moment), 1) for moment in self.calls],
            "damaged": self.damaged,
            **({"outside": dict(self.outside)} if self.outside else {}),
        }


class Counters:
    """The counters of the tools ``names``, read from ``path`` once. Not safe to use from threads by itself."""

    def __init__(self, path: Path, names: set[str], clock: Callable[[], float], wall: Callable[[], float]) -> None:
        self.names = frozenset(names)
        self.damage = ""
        self._path, self._clock, self._wall, self._boot = path, clock, wall, boot_id()
        self._used: dict[str, Used] = {}
        self._compacted = 0
        """Bytes of the file when it was last written as a whole."""
        self._whole = True
        """Whether the next change writes the whole file: there is none, or it cannot be added to."""
        try:
            self._used = self._read()
        except (
            OSError,
            ValueError,
            LookupError,
            TypeError,
            AttributeError,
            ArithmeticError,
        ) as problem:
            self.damage = f"{path} cannot be read ({problem})"
            self._used = {name: Used(damaged=True) for name in names}
            with suppress(OSError):  # for inspection; the file itself is replaced by the first reset
                path.with_suffix(".damaged").unlink(missing_ok=True)
                files.publish_new(path, path.with_suffix(".damaged"))

    def of(self, tool: str) -> Used:
        """The counters of a tool."""
        return self._used.get(tool) or Used()

    def put(self, tool: str, used: Used) -> None:
        """Keep what a tool has used now; CountersUnwritable, and nothing changed, when it cannot be written."""
        if self._whole:
            self._replace({**self._used, tool: used})
        else:
            size = self._append(self._line(tool, used, self._used.get(tool)))
            self._whole = size > max(_COMPACT_BYTES, 2 * self._compacted)
        self._used[tool] = used

    def reset(self, tool: str | None) -> None:
        """Reset the counters of one tool or of all; CountersUnwritable when the file cannot be replaced."""
        used = {} if tool is None else {name: item for name, item in self._used.items() if name != tool}
        self._replace(used)
        self._used = used
        if not any(item.damaged for item in used.values()):
            self.damage = ""

    def _line(self, tool: str, used: Used, before: Used | None = None) -> bytes:
        """All that a tool has used; after a line with ``before``, the moments only as far as they are new.

        ``kept`` is how many of the moments count, the latest ones.
        """
        kept = len(used.calls)
        calls, more = used.calls, {}
        if before is not None and kept and used.calls[:-1] == before.calls[len(before.calls) - kept + 1 :]:
            calls, more = used.calls[-1:], {"kept": kept}
        document = {
            "tool": tool,
            "boot": self._boot,
            "wall": self._wall(),
            "clock": self._clock(),
            "sums": {name: str(value) for name, value in used.sums.items()},
            "last": {name: str(value) for name, value in used.last.items()},
            "calls": calls,
            "damaged": used.damaged,
            **(
                {"doubts": {name: [str(low), str(high)] for name, (low, high) in used.doubts.items()}}
                if used.doubts
                else {}
            ),
            **({"outside": dict(used.outside)} if used.outside else {}),
            **more,
        }
        return _encoded(document)

    def _append(self, line: bytes) -> int:
        """Add a line and give back the file's size; a line that the disk took only in part is taken back."""
        try:
            descriptor = os.open(self._path, _APPEND, 0o600)
            try:
                written = os.write(descriptor, line)
                size = os.lseek(descriptor, 0, os.SEEK_END)
                if written != len(line):
                    self._whole = True
                    os.ftruncate(descriptor, size - written)
                    raise CountersUnwritable(f"{self._path} cannot be written: the disk is full")
            finally:
                os.close(descriptor)
        except OSError as problem:
            raise self._unwritable(problem) from problem
        return size

    def _replace(self, used: Mapping[str, Used]) -> None:
        data = b"".join([_encoded(HEADER), *(self._line(name, item) for name, item in used.items())])
        try:
            private_folder(self._path.parent)
            files.replace(self._path, data, synced=False)
        except OSError as problem:
            raise self._unwritable(problem) from problem
        self._whole, self._compacted = False, len(data)

    def _unwritable(self, problem: OSError) -> CountersUnwritable:
        if isinstance(problem, CountersUnwritable):
            return problem
        return CountersUnwritable(f"{self._path} cannot be written: {problem.strerror or problem}")

    def _read(self) -> dict[str, Used]:
        try:
            lines = files.read(self._path, _LARGEST, follow=False).split(b"\n")
        except FileNotFoundError:
            return {}
        if lines.pop() or not lines or files.parse(lines[0]) != HEADER:
            raise ValueError("it is cut off, or of another format")
        latest: dict[str, Mapping[str, Any]] = {}
        moments: dict[str, list[float]] = {}
        for item in map(files.parse, lines[1:]):
            name = str(item["tool"])
            shift = self._shift(str(item["boot"]), float(item["wall"]), float(item["clock"]))
            calls = [float(moment) + shift for moment in item["calls"]]
            if "kept" in item:
                moments[name] += calls
            else:
                moments[name] = calls
            latest[name] = item
        used = {name: self._of(item, moments[name]) for name, item in latest.items()}
        self._whole = False
        if any(item.damaged for item in used.values()):
            self.damage = f"{self._path} had been damaged"
        return used

    def _of(self, item: Mapping[str, Any], moments: list[float]) -> Used:
        """The counters in the last line of a tool, with the moments of all its lines."""
        kept, now = int(item.get("kept", len(moments))), self._clock()
        if not 0 <= kept <= len(moments):
            raise ValueError("it has lost moments of calls")
        calls = tuple(sorted(min(now, moment) for moment in moments[len(moments) - kept :]))
        sums, last = ({key: Fraction(value) for key, value in item[name].items()} for name in ("sums", "last"))
        doubts = {key: (Fraction(low), Fraction(high)) for key, (low, high) in item.get("doubts", {}).items()}
        outside = {str(unit): str(text) for unit, text in item.get("outside", {}).items()}
        return Used(sums, last, calls, bool(item["damaged"]), doubts, outside)

    def _shift(self, boot: str, wall: float, clock: float) -> float:
        """The offset from the file's moments to those of the present clock, in seconds."""
        if boot and boot == self._boot and clock <= self._clock():
            return 0.0
        return self._clock() - max(0.0, self._wall() - wall) - clock


def _encoded(document: Mapping[str, Any]) -> bytes:
    return json.dumps(document).encode("ascii") + b"\n"


def _plain(value: Fraction) -> float:
    """A float, or an int for an integer."""
    return value.numerator if value.denominator == 1 else float(value)
