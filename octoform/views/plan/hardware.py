"""What the kernel announces, for people: one line a device instead of one a modalias, class counts as before -> now.

A modalias is made for a loader of drivers: a device has one for each of its parts, and its numbers stand among a dozen
others. The kernel documents the fields; only those that tell one product from another are kept here.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from octoform.plan.model import Action, Change

_CLASS = re.compile(r"class:([^:]+):(\d+)")
_NUMBERED = (
    ("USB device", re.compile(r"usb:v([0-9A-F]{4})p([0-9A-F]{4})")),
    ("PCI device", re.compile(r"pci:v0000([0-9A-F]{4})d0000([0-9A-F]{4})")),
    ("HID device", re.compile(r"hid:b[0-9A-F]{4}g[0-9A-F]{4}v0000([0-9A-F]{4})p0000([0-9A-F]{4})")),
)
_WORDS = {"acpi": "ACPI device", "scsi": "SCSI device", "mmc": "memory card", "i2c": "I2C device", "of": "board device"}
_SCSI = {"t-0x00": "disk", "t-0x01": "tape", "t-0x05": "optical drive", "t-0x0d": "enclosure"}
"""By the peripheral device type that the standard gives and the kernel prints."""


@dataclass(frozen=True, slots=True)
class Line:
    """One line: what happened to it, and its words."""

    action: Action
    text: str


def lines(changes: Iterable[Change]) -> list[Line]:
    """The hardware changes as lines, devices first; the parts of one device make one line."""
    devices: dict[Line, None] = {}
    classes: dict[str, dict[Action, str]] = {}
    for change in changes:
        if change.kind != "hardware":
            continue
        counted = _CLASS.fullmatch(change.name)
        if counted:
            classes.setdefault(counted[1], {})[change.action] = counted[2]
        else:
            devices.setdefault(Line(change.action, describe(change.name)))
    return [*devices, *(_counted(name, counts) for name, counts in sorted(classes.items()))]


def _counted(name: str, counts: dict[Action, str]) -> Line:
    text = f"class {name}: {counts.get(Action.DESTROY, '0')} -> {counts.get(Action.CREATE, '0')}"
    action = Action.UPDATE if len(counts) > 1 else next(iter(counts))
    return Line(action, text)


def describe(announced: str) -> str:
    """A device in words: bus and numbers where they are known, else the bus and what it says."""
    for word, pattern in _NUMBERED:
        found = pattern.match(announced)
        if found:
            return f"{word} {found[1].lower()}:{found[2].lower()}"
    bus, _, rest = announced.partition(":")
    if bus == "scsi" and rest in _SCSI:
        return f"SCSI {_SCSI[rest]}"
    return f"{_WORDS.get(bus, f'{bus} device')} {rest.strip(':') or '(unnamed)'}"
