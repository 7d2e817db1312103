"""Units on a bus that are read and driven by the values at their addresses: servos, drives, sensors of many makers.

The server brings the library that talks on the bus and holds the bus only for one exchange after the other, so that
readings and a stop come between the steps of a movement (`movement`). What is at which address, in which order it
is written and within which limits is data (`Map`), which comes from the product's profile.

    arm = runtime.units.Units(MAP, device, lambda: opened(device, actuate=True))
    arm.move("elbow_flex", 2048, speed=400)

A reply that is missing or broken is asked for once more, because a transient drop is no fault of the device. After that
it is a DeviceFault that names the unit and states what is not known. A reading of None was not taken.
"""

import termios
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

from .base.files import read_json
from .faults import DeviceFault, sentence

# The range of each unit as its owner calibrated it, from a file, and a position as percent of that range.
#
# A file of the format `lerobot` is JSON with one member for each unit by its name, an object with ``id``,
# ``drive_mode``, ``homing_offset``, ``range_min`` and ``range_max``. The ranges are in the counts that the unit itself
# reports; the offset was written into the unit when it was calibrated, so nothing is added here. One scale serves every
# unit, a gripper too: -100 is one end of the range, 100 the other, 0 the middle; a ``drive_mode`` other than 0 turns
# the direction around.

MAX_BYTES = 65536
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
    """The calibration that was found: the ranges by unit, or in ``note`` why there are none.

    ``wrong`` is a contradiction between file and profile: no one knows which unit is which, so none may be moved.
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
        names = ", ".join(_display(path) for path in found[:4])
        return Calibration({}, f"there are {len(found)} calibration files and nothing shows which is meant: {names}")
    try:
        return _read(found[0], units)
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as problem:
        why = problem.strerror if isinstance(problem, OSError) else f"{type(problem).__name__}: {problem}"
        return Calibration({}, f"{_display(found[0])} is no calibration file that can be used ({why})")


def _read(path: Path, units: Mapping[str, int]) -> Calibration:
    document: dict[str, Any] = read_json(path, MAX_BYTES, any_text=True)
    known = {name: document[name] for name in units if name in document}
    other = [
        f"{name} the id {entry['id']!a:.20} (the profile has {units[name]})"
        for name, entry in known.items()
        if entry["id"] != units[name]
    ]
    if other:
        return Calibration({}, f"{_display(path)} gives {', '.join(other)}", wrong=True)
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
    """The files that a pattern names, in the home of the user that this process runs as."""
    try:
        path = Path(pattern).expanduser()
    except RuntimeError:  # a user without a home has no files in it
        return []
    return list(Path(path.anchor).glob(str(path.relative_to(path.anchor))))


def _display(path: Path) -> str:
    """A path without the name of the user's home."""
    home = Path("~").expanduser()
    return f"~/{path.relative_to(home)}" if path.is_relative_to(home) else str(path)


T = TypeVar("T")
PAUSE = 0.1
"""Seconds before what failed is tried once more: a late reply has come by then, and is thrown away."""


class NoReply(Exception):
    """A reply to a port's request is missing or broken."""


class UnitFault(DeviceFault):
    """A unit that does not answer or that faults, while the others may be well."""


class Port(Protocol):
    """An open bus; both raise NoReply without a sound reply, and OSError when the line itself is gone."""

    def read(self, unit_id: int, address: int, size: int) -> int:
        """The unsigned value of ``size`` bytes at an address of a unit."""
        ...

    def write(self, unit_id: int, address: int, size: int, value: int) -> int:
        """Write it; the fault flags of the unit's own reply, 0 where it reports none."""
        ...


class Field(NamedTuple):
    """The register at an address; ``sign_bit`` marks a negative value, ``scale`` the size of a count."""

    address: int
    size: int = 1
    scale: float = 1
    sign_bit: int | None = None

    def value(self, raw: int) -> float:
        """The value of what is there, in the field's unit; an integer where a count is one."""
        if self.sign_bit is not None and raw >> self.sign_bit & 1:
            raw = -(raw & ~(1 << self.sign_bit))
        return raw if self.scale == 1 else round(raw * self.scale, 6)


class Motion(NamedTuple):
    """How a unit is moved. Names are those of fields; a word in ``before`` stands for the speed of the call."""

    goal: str
    present: str
    minimum: int
    maximum: int
    moved: int
    within: float
    before: tuple[tuple[str, int | str], ...] = ()
    lowest: str = ""
    highest: str = ""
    release: tuple[tuple[str, int], ...] = ()
    speeds: tuple[int, int] | None = None


class Protect(NamedTuple):
    """No unit is moved from ``refuse_at`` on, until it is below ``resume_below`` again."""

    field: str
    refuse_at: float
    resume_below: float
    unit: str = ""


class Map(NamedTuple):
    """The units of a product; ``units`` is name to bus id, ``disabled`` name to reason."""

    unit: str
    units: Mapping[str, int]
    fields: Mapping[str, Field]
    disabled: Mapping[str, str] = {}
    motion: Motion | None = None
    protect: Protect | None = None
    calibration: tuple[str, ...] = ()


class _Known:
    """The state of a device between calls: how often it was stopped, and which units were too hot."""

    def __init__(self) -> None:
        self.stops = 0
        self.hot: set[str] = set()

    def stop(self) -> None:
        """Count one stop more."""
        with _guard:
            self.stops += 1


_known: dict[str, _Known] = {}
_guard = threading.Lock()


def known(device: str) -> _Known:
    """The memory of a device, the same for all threads of this process."""
    with _guard:
        return _known.setdefault(device, _Known())


class Bank:
    """The units of one device, as far as a single exchange goes. ``clock`` and ``sleep`` are in seconds."""

    def __init__(
        self,
        of: Map,
        device: str,
        opened: Callable[[], AbstractContextManager[Port]],
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """``opened`` gives the bus, locked and open, for as long as its ``with`` lasts."""
        self.map, self.device, self.clock, self.sleep = of, device, clock, sleep
        self._opened = opened
        self.known = known(device)

    def exchange(self, name: str, what: str, do: Callable[["Talk"], T]) -> T:
        """The result of ``do`` for one unit with the bus held. ``what`` names what is unknown if it fails.

        When the line breaks, the bus is opened again and all of ``do`` is done once more.
        """
        for last in (False, True):
            try:
                with self._opened() as port:
                    return do(Talk(self, port, name, what))
            except (OSError, termios.error) as problem:
                if last:
                    text = sentence(problem) if isinstance(problem, OSError) else "the line broke"
                    unknown = f"; not known: {what or 'its values'}"
                    raise DeviceFault(self.device, f"{self.device}: {name}: {text}{unknown}") from problem
            self.sleep(PAUSE)
        raise AssertionError("unreachable")

    def calibration(self) -> Calibration:
        """The owner's calibration as it is on the disk now."""
        return find(self.map.calibration, self.map.units)

    def named(self, name: str) -> str:
        """The unit's name, given that or its id as text; UnitFault for one that is no unit."""
        found = {str(number): of for of, number in self.map.units.items()}.get(name, name)
        if found not in self.map.units:
            raise self.fault(f"{name!a:.60} is no {self.map.unit}; there are {', '.join(self.map.units)}")
        return found

    def fault(self, text: str) -> UnitFault:
        """An error about a unit of this device."""
        return UnitFault(self.device, f"{self.device}: {text}")

    def describe(self, problem: DeviceFault) -> str:
        """The text of an error, without the device's name before it."""
        return str(problem).removeprefix(f"{self.device}: ")


class Talk:
    """The exchanges with one unit while the bus is held."""

    def __init__(self, bank: Bank, port: Port, name: str, what: str) -> None:
        """For `Bank.exchange`."""
        self._bank, self._port, self.name, self._what = bank, port, name, what
        self._id = bank.map.units[name]

    def read(self, field: str) -> float:
        """A field's value in its unit; UnitFault when there is no sound reply."""
        at = self._bank.map.fields[field]
        value = at.value(self._twice(f"its {field}", lambda: self._port.read(self._id, at.address, at.size)))
        self._judged(field, value)
        return value

    def count(self, field: str) -> int:
        """The same for a field that is an integer of counts."""
        return round(self.read(field))

    def write(self, field: str, value: int) -> int:
        """Write a field; the unit's own fault flags."""
        at = self._bank.map.fields[field]
        if not 0 <= value < 1 << 8 * at.size:
            raise self._bank.fault(f"{value} does not fit into the field {field}; nothing was written")
        what = f"whether it took {field} = {value}"
        return self._twice(what, lambda: self._port.write(self._id, at.address, at.size, value))

    def set(self, values: Iterable[tuple[str, int]]) -> None:
        """Write fields and read each of them back."""
        wanted = list(values)
        for field, value in wanted:
            self.write(field, value)
        for field, value in wanted:
            if (found := self.count(field)) != value:
                raise self._bank.fault(f"{self.name} was set to {field} = {value}, and its {field} is {found}")

    def _judged(self, field: str, value: float) -> None:
        """Each fresh reading of the protected field states whether the unit is too hot, and when it no longer is."""
        protect, hot = self._bank.map.protect, self._bank.known.hot
        if protect is None or field != protect.field:
            return
        if value >= protect.refuse_at:
            hot.add(self.name)
        elif value < protect.resume_below:
            hot.discard(self.name)

    def _twice(self, what: str, ask: Callable[[], T]) -> T:
        try:
            return ask()
        except NoReply:
            self._bank.sleep(PAUSE)
        try:
            return ask()
        except NoReply as problem:
            unknown = ", ".join(filter(None, (what, self._what)))
            text = f"{self.name} gave no sound reply, twice ({problem}); not known: {unknown}"
            raise self._bank.fault(text) from problem
