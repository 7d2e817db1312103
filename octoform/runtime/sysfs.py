"""Small bounded reads below the system root, and what sysfs links say about a folder.

Attributes vanish, refuse and stall in everyday life, so a read that fails gives None and the caller decides what that
means. The layout is that of the kernel's Documentation/admin-guide/sysfs-rules.rst: devices are found below
/sys/class and /sys/bus, and `subsystem` links say what they are.
"""

import os
import re
import struct
from pathlib import Path

from . import calllog

ATTRIBUTE_BYTES = 4096
_OCTAL = re.compile(r"\\([0-7]{3})")
_DIGITS = re.compile(r"(\d+)")


def sysroot() -> Path:
    """The folder that holds sys, proc and dev: ``/``, or what OCTOFORM_SYSROOT names."""
    return Path(os.environ.get("OCTOFORM_SYSROOT") or "/")


def read_bytes(path: Path, limit: int = ATTRIBUTE_BYTES) -> bytes | None:
    """Up to ``limit`` bytes of a file, None when it cannot be read. Never waits for a writer (O_NONBLOCK)."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return None
    parts = []
    try:
        while limit > 0 and (part := os.read(descriptor, limit)):
            parts.append(part)
            limit -= len(part)
    except OSError:
        return None
    finally:
        os.close(descriptor)
    data = b"".join(parts)
    calllog.read(Path(path), data)
    return data


def read_text(path: Path, limit: int = ATTRIBUTE_BYTES) -> str | None:
    """The same as text without surrounding white space; bytes that are no UTF-8 are replaced."""
    found = read_bytes(path, limit)
    return None if found is None else found.decode("utf-8", "replace").strip().strip("\0")


def read_number(path: Path, scale: float = 1.0) -> float | None:
    """A number from an attribute times ``scale``; None when it cannot be read or is no number."""
    text = read_text(path, 64)
    try:
        return None if text is None else round(float(text) * scale, 9)
    except ValueError:
        return None


def read_integer(path: Path) -> int | None:
    """An integer from an attribute, decimal or with 0x; None when it cannot be read or is none."""
    try:
        return int(read_text(path, 64) or "", 0)
    except ValueError:
        return None


def read_first(*paths: Path, scale: float = 1.0) -> float | None:
    """The number in the first of these attributes that can be read, times ``scale``; None when none can."""
    return next((found for found in (read_number(path, scale) for path in paths) if found is not None), None)


def natural(text: str) -> tuple[tuple[int, str], ...]:
    """Sort key by which ``hwmon2`` comes before ``hwmon10``."""
    return tuple((int(part), "") if part.isdigit() else (-1, part) for part in _DIGITS.split(text))


def files(folder: Path, *patterns: str) -> list[Path]:
    """The entries of a folder whose names match one of some shell patterns, in natural order."""
    return sorted({path for pattern in patterns for path in folder.glob(pattern)}, key=lambda path: natural(path.name))


def subsystem(path: Path) -> tuple[str, str]:
    """("bus" or "class", name) of a device folder; two empty strings where the folder is no device."""
    try:
        target = (path / "subsystem").readlink()
    except OSError:
        return "", ""
    return target.parent.name, target.name


def uevent(path: Path) -> dict[str, str]:
    """The KEY=value lines that the kernel announces for a device folder."""
    text = read_text(path / "uevent", 16 * ATTRIBUTE_BYTES) or ""
    return dict(line.split("=", 1) for line in text.splitlines() if "=" in line)


def members(name: str) -> list[Path]:
    """The real folders of all devices of a class or bus, in natural order."""
    root = sysroot()
    found: set[Path] = set()
    folders = [root / "sys/class" / name, root / "sys/bus" / name / "devices"]
    for folder in [*folders, root / "sys/block"] if name == "block" else folders:
        try:
            found.update(entry.resolve() for entry in folder.iterdir() if entry.is_symlink() or entry.is_dir())
        except OSError:
            continue
    return sorted((path for path in found if path.is_dir()), key=lambda path: natural(str(path)))


def read_bits(path: Path) -> list[int]:
    """The set bits of a map such as input devices have: words of the kernel's ``long``, highest first."""
    width, number = 8 * struct.calcsize("l"), 0
    for word in (read_text(path) or "").split():
        number = number << width | int(word, 16)
    return [bit for bit in range(number.bit_length()) if number >> bit & 1]


def mounts() -> dict[str, tuple[str, str]]:
    """Device number (``8:1``) to the place where it is mounted first, and its file system (proc(5), mountinfo)."""
    found: dict[str, tuple[str, str]] = {}
    for line in (read_text(sysroot() / "proc/self/mountinfo", 1 << 20) or "").splitlines():
        before, _, after = line.partition(" - ")
        fields, kind = before.split(), after.split()
        if len(fields) > 4 and kind:
            place = _OCTAL.sub(lambda code: chr(int(code[1], 8)), fields[4])
            found.setdefault(fields[2], (place, kind[0]))
    return found


def free_bytes(mounted_at: str | None) -> int | None:
    """Bytes that this user may still write below a mount point; None without one, or where it cannot be asked."""
    try:
        status = os.statvfs(sysroot() / mounted_at.lstrip("/")) if mounted_at else None
    except OSError:
        return None
    return status.f_bavail * status.f_frsize if status else None


# Where a device is attached, without the numbers that the kernel gives again at each plug or each start.
#
# The path of a folder in sysfs is the way to a device: controller, hubs, ports. Some of its parts are counted in the
# order of discovery instead: they say nothing about the place, and the same number may be another device's tomorrow.

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
