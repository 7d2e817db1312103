"""What was counted for the limits, and the file that keeps it over a restart.

The file is replaced as a whole at every counted call, before the call goes on. Times in it are those of the clock that
only goes forward; they hold as they are while the machine has not been started anew. After that the wall clock says
how much time went by, and where it went backwards, none did: a cooldown then lasts once more, but not for ever.
"""

import json
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from .owner import boot

FORMAT = 1
_SIZE = 4_000_000


class CountersUnwritable(OSError):
    """The file could not be replaced; what was to be counted is not counted."""


@dataclass(frozen=True, slots=True)
class Used:
    """What one tool has used: sums and last values by parameter, moments of calls (seconds of the clock, ascending).

    ``damaged``: it is not known, because the file could not be read.
    """

    sums: Mapping[str, Fraction] = field(default_factory=dict)
    last: Mapping[str, Fraction] = field(default_factory=dict)
    calls: tuple[float, ...] = ()
    damaged: bool = False

    def shown(self, now: float) -> dict[str, Any]:
        """As plain values; calls as ages in seconds."""
        return {
            "sums": {name: _plain(value) for name, value in self.sums.items()},
            "last": {name: _plain(value) for name, value in self.last.items()},
            "calls": [round(max(0.0, now - moment), 1) for moment in self.calls],
            "damaged": self.damaged,
        }


class Counters:
    """The counters of the tools ``names``, read from ``path`` once. Not safe to use from threads by itself."""

    def __init__(self, path: Path, names: set[str], clock: Callable[[], float], wall: Callable[[], float]) -> None:
        self.names = frozenset(names)
        self.damage = ""
        self._path, self._clock, self._wall, self._boot = path, clock, wall, boot()
        self._used: dict[str, Used] = {}
        try:
            self._used = self._read()
        except (
            OSError,
            ValueError,
            LookupError,
            TypeError,
            AttributeError,
            ArithmeticError,
            RecursionError,
        ) as problem:
            self.damage = f"{path} cannot be read ({problem})"
            self._used = {name: Used(damaged=True) for name in names}
            with suppress(OSError):  # for whoever wants to look; the file itself is replaced by the first reset
                path.with_suffix(".damaged").unlink(missing_ok=True)
                path.with_suffix(".damaged").hardlink_to(path)

    def of(self, tool: str) -> Used:
        """What the tool has used."""
        return self._used.get(tool) or Used()

    def put(self, tool: str, used: Used) -> None:
        """Keep what a tool has used now; CountersUnwritable, and nothing changed, when the file cannot be replaced."""
        self._keep({**self._used, tool: used})

    def reset(self, tool: str | None) -> None:
        """Nothing used, for one tool or for all."""
        self._keep({} if tool is None else {name: used for name, used in self._used.items() if name != tool})
        if not any(used.damaged for used in self._used.values()):
            self.damage = ""

    def _keep(self, used: dict[str, Used]) -> None:
        tools = {
            name: {
                "sums": {key: str(value) for key, value in item.sums.items()},
                "last": {key: str(value) for key, value in item.last.items()},
                "calls": item.calls,
                "damaged": item.damaged,
            }
            for name, item in used.items()
        }
        document = {"format": FORMAT, "boot": self._boot, "wall": self._wall(), "clock": self._clock(), "tools": tools}
        self._replace(json.dumps(document).encode("ascii"))
        self._used = used

    def _replace(self, data: bytes) -> None:
        temporary = self._path.with_suffix(".new")
        try:
            self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
            try:
                written = os.write(descriptor, data)
            finally:
                os.close(descriptor)
            if written != len(data):
                raise CountersUnwritable(f"{self._path} cannot be written: the disk is full")
            temporary.replace(self._path)
        except CountersUnwritable:
            raise
        except OSError as problem:
            raise CountersUnwritable(f"{self._path} cannot be written: {problem.strerror or problem}") from problem

    def _read(self) -> dict[str, Used]:
        try:
            descriptor = os.open(self._path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOFOLLOW)
        except FileNotFoundError:
            return {}
        with os.fdopen(descriptor, "rb") as file:
            document = json.loads(file.read(_SIZE))
        if document["format"] != FORMAT:
            raise ValueError(f"format {document['format']!r} is not known")
        shift = self._shift(str(document["boot"]), float(document["wall"]), float(document["clock"]))
        used = {str(name): _used(item, shift, self._clock()) for name, item in document["tools"].items()}
        if any(item.damaged for item in used.values()):
            self.damage = f"{self._path} had been damaged"
        return used

    def _shift(self, boot: str, wall: float, clock: float) -> float:
        """What to add to the file's moments, so that they are moments of the clock as it goes now."""
        if boot and boot == self._boot and clock <= self._clock():
            return 0.0
        return self._clock() - max(0.0, self._wall() - wall) - clock


def _used(item: Mapping[str, Any], shift: float, now: float) -> Used:
    calls = tuple(sorted(min(now, float(moment) + shift) for moment in item["calls"]))
    sums, last = ({key: Fraction(value) for key, value in item[name].items()} for name in ("sums", "last"))
    return Used(sums, last, calls, bool(item["damaged"]))


def _plain(value: Fraction) -> float:
    """A float, or an int for a whole number."""
    return value.numerator if value.denominator == 1 else float(value)
