"""The range of each unit as its owner calibrated it, from a file, and a position as percent of that range.

A file of the format `lerobot` is JSON with one member for each unit by its name, an object with ``id``, ``drive_mode``,
``homing_offset``, ``range_min`` and ``range_max``. The ranges are in the counts that the unit itself reports; the
offset was written into the unit when it was calibrated, so nothing is added here. One scale serves every unit, a
gripper too: -100 is one end of the range, 100 the other, 0 the middle; a ``drive_mode`` other than 0 turns the
direction around.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from .plainfiles import read_json

MOST_BYTES = 65536
HIGHEST = 65535


class Range(NamedTuple):
    """From where to where a unit may go, in counts, and whether its direction is turned around."""

    low: int
    high: int
    inverted: bool = False

    def percent(self, position: float) -> float:
        """A position on the scale from -100 to 100; beyond it for one outside of the range."""
        share = (position - self.low) / (self.high - self.low) * 200 - 100
        return round(-share if self.inverted else share, 1)

    def counts(self, percent: float) -> int:
        """The position of a percentage."""
        share = -percent if self.inverted else percent
        return round(self.low + (share + 100) / 200 * (self.high - self.low))


class Calibration(NamedTuple):
    """What was found: the ranges by unit, or in ``note`` why there are none.

    ``wrong`` is a contradiction between file and profile: nobody knows which unit is which, so none may be moved.
    """

    ranges: Mapping[str, Range]
    note: str = ""
    wrong: bool = False


def find(patterns: Iterable[str], units: Mapping[str, int]) -> Calibration:
    """The calibration of these units (name to bus id) from the one file that these patterns name."""
    asked = list(patterns)
    found = sorted({path for pattern in asked for path in _files(pattern)})
    if not asked:
        return Calibration({}, "the profile names no calibration file")
    if not found:
        return Calibration({}, f"there is no calibration file; looked for {', '.join(asked)}")
    if len(found) > 1:
        names = ", ".join(_shown(path) for path in found[:4])
        return Calibration({}, f"there are {len(found)} calibration files and nothing tells which is meant: {names}")
    try:
        return _read(found[0], units)
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as problem:
        why = problem.strerror if isinstance(problem, OSError) else f"{type(problem).__name__}: {problem}"
        return Calibration({}, f"{_shown(found[0])} is no calibration file that can be used ({why})")


def _read(path: Path, units: Mapping[str, int]) -> Calibration:
    document: dict[str, Any] = read_json(path, MOST_BYTES, any_text=True)
    known = {name: document[name] for name in units if name in document}
    other = [
        f"{name} the id {entry['id']!a:.20} (the profile says {units[name]})"
        for name, entry in known.items()
        if entry["id"] != units[name]
    ]
    if other:
        return Calibration({}, f"{_shown(path)} gives {', '.join(other)}", wrong=True)
    ranges = {name: _range(name, entry) for name, entry in known.items()}
    if not ranges:
        raise ValueError("none of the units is in it")
    return Calibration(ranges)


def _range(name: str, entry: Mapping[str, Any]) -> Range:
    low, high, mode = entry["range_min"], entry["range_max"], entry["drive_mode"]
    if not all(type(value) is int for value in (low, high, mode)) or not 0 <= low < high <= HIGHEST:
        raise ValueError(f"the range of {name} is no range of counts")
    return Range(low, high, mode != 0)


def _files(pattern: str) -> list[Path]:
    """What a pattern names, in the home of the user that this process runs as."""
    try:
        path = Path(pattern).expanduser()
    except RuntimeError:  # a user without a home has no files in it
        return []
    return list(Path(path.anchor).glob(str(path.relative_to(path.anchor))))


def _shown(path: Path) -> str:
    """A path without the name of the user's home."""
    home = Path("~").expanduser()
    return f"~/{path.relative_to(home)}" if path.is_relative_to(home) else str(path)
