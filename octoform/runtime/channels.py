"""Channels of sensors as the kernel publishes them in sysfs: hwmon, thermal zones, industrial I/O, in plain units."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from .base.quantities import is_possible
from .devices import Device
from .sysfs import files, read_first, read_number, read_text

_IIO_UNITS = {  # quantity: (from the ABI's unit to this one, unit)
    **{"accel": (1, "m/s^2"), "anglvel": (1, "rad/s"), "magn": (1, "gauss"), "illuminance": (1, "lux")},
    **{"pressure": (1, "kPa"), "temp": (0.001, "degC"), "humidityrelative": (0.001, "%"), "voltage": (0.001, "V")},
    **{"current": (0.001, "A"), "power": (0.001, "W"), "resistance": (1, "ohm"), "angl": (1, "rad")},
    **{"incli": (1, "deg"), "gravity": (1, "m/s^2"), "distance": (1, "m"), "velocity": (1, "m/s"), "energy": (1, "J")},
    **{"concentration": (1, "%"), "massconcentration": (1, "ug/m^3"), "electricalconductivity": (1, "S/m")},
    **{"capacitance": (1, "nF")},
}


class Row(NamedTuple):
    """One channel; a value of None is one that did not answer, or with what cannot be measured (nothing connected)."""

    sensor: str
    channel: str
    label: str
    value: float | None
    unit: str

    @classmethod
    def of(cls, sensor: str, channel: str, label: str, value: float | None, unit: str) -> "Row":
        """A row; its value is None where nothing can have measured it."""
        return cls(sensor, channel, label, value if value is not None and is_possible(value, unit) else None, unit)


def hwmon(unit: Device, kind: str, scale: float, symbol: str) -> Iterator[Row]:
    """Channels of the hwmon class, in the units of the kernel's Documentation/hwmon/sysfs-interface.rst."""
    for folder in unit.paths("hwmon"):
        sensor = read_text(folder / "name") or folder.name
        found = files(folder, f"{kind}[0-9]*_average") + files(folder, f"{kind}[0-9]*_input")
        for channel, file in {file.name.rpartition("_")[0]: file for file in found}.items():
            label = read_text(folder / f"{channel}_label") or channel
            yield Row.of(sensor, channel, label, read_number(file, scale), symbol)


def thermal(unit: Device) -> Iterator[Row]:
    """Zones of the thermal class, in millidegrees (Documentation/ABI/testing/sysfs-class-thermal)."""
    for folder in unit.paths("thermal"):
        if (folder / "temp").exists():
            kind = read_text(folder / "type") or folder.name
            yield Row.of(kind, "temp", kind, read_number(folder / "temp", 0.001), "degC")


def iio(unit: Device, wanted: str = "") -> Iterator[Row]:
    """Channels of industrial I/O: (raw + offset) * scale, then to plain units (ABI/testing/sysfs-bus-iio)."""
    for folder in unit.paths("iio"):
        sensor = read_text(folder / "name") or folder.name
        found = files(folder, f"in_{wanted}*_raw") + files(folder, f"in_{wanted}*_input")
        for channel, file in {file.name.rpartition("_")[0]: file for file in found}.items():
            kind = (re.match(r"in_[a-z]+", channel) or [channel])[0].removeprefix("in_")
            if wanted in ("", kind):
                yield from _iio_rows(sensor, folder, channel, file, kind)


def _iio_rows(sensor: str, folder: Path, channel: str, file: Path, kind: str) -> Iterator[Row]:
    """A row of a channel; one for each part of a value that has several (a quaternion)."""
    factor, symbol = _IIO_UNITS.get(kind, (1, ""))
    label = channel.removeprefix("in_")
    offset, scale = 0.0, None
    if file.name.endswith("_raw"):
        offset = read_first(folder / f"{channel}_offset", folder / f"in_{kind}_offset") or 0
        scale = read_first(folder / f"{channel}_scale", folder / f"in_{kind}_scale")
    parts = (read_text(file) or "").split() if kind == "rot" else []
    values = [_number(part) for part in parts] if len(parts) > 1 else [read_number(file)]
    for index, value in enumerate(values):
        plain = None if value is None else round((value + offset) * (1 if scale is None else scale) * factor, 9)
        yield Row.of(sensor, channel, f"{label}[{index}]" if len(values) > 1 else label, plain, symbol)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
