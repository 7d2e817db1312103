"""Where a device is attached, without the numbers that the kernel gives anew at each plug or each start.

The path of a folder in sysfs is the way to a device: controller, hubs, ports. Some of its parts are counted in the
order of discovery instead: they say nothing about the place, and the same number may be another device's tomorrow.
"""

import re
from pathlib import Path

from .sysfs import sysroot

# Counted each time that something is attached: HID devices, SCSI hosts, memory cards, devices of a class.
_ATTACHED = (
    (re.compile(r"([0-9A-F]{4}:[0-9A-F]{4}:[0-9A-F]{4})\.[0-9A-F]{4,}"), r"\1"),
    (re.compile(r"host\d+"), "host"),
    (re.compile(r"target\d+(:\d+:\d+)"), r"target\1"),
    (re.compile(r"\d+(:\d+:\d+:\d+)"), r"\1"),
    (re.compile(r"(mmc)\d+(?::[0-9a-f]+)?"), r"\1"),
    (re.compile(r"(hwmon|input|rtc|video|card|thermal_zone|cooling_device|iio:device|gpiochip|nvme)\d+"), r"\1"),
    (re.compile(r"input\d+(::.+)"), r"input\1"),
)
# Counted once at each start, in the order in which controllers are found.
_STARTED = (
    (re.compile(r"usb\d+"), "usb"),
    (re.compile(r"i2c-\d+"), "i2c"),
    (re.compile(r"\d+(-[0-9a-f.]+(?::[0-9.]+)?)"), r"\1"),
)


def path_of(folder: Path) -> str:
    """A folder as the host names it, without the system root."""
    root = sysroot().resolve()
    return "/" + str(folder.relative_to(root)) if folder.is_relative_to(root) else str(folder)


def place(path: str) -> str:
    """The way to a device: its path without the numbers that were given when it was attached."""
    return "/".join(_without(part, _ATTACHED) for part in path.split("/"))


def socket(path: str) -> str:
    """The same without the numbers of buses, which may be others after the next start."""
    return "/".join(_without(part, _STARTED) for part in place(path).split("/"))


def _without(part: str, numbers: tuple[tuple[re.Pattern[str], str], ...]) -> str:
    for pattern, rest in numbers:
        if pattern.fullmatch(part):
            return pattern.sub(rest, part)
    return part
