"""Lines of GPIO controllers through the kernel's character device (linux/gpio.h, version 2 of the interface).

Which lines a tool may drive is for the server to know; here is only how. Every call belongs under the device's lock.
"""

import fcntl
import os
import struct
from pathlib import Path
from typing import Any

from .devices import Device
from .faults import DeviceFault
from .sysfs import subsystem, sysroot

MAX_LINES = 512
_CHIPINFO, _LINEINFO, _GET_LINE, _SET_CONFIG, _GET_VALUES = 0x8044B401, 0xC100B405, 0xC250B407, 0xC110B40D, 0xC010B40E
_USED, _ACTIVE_LOW, _INPUT, _OUTPUT = 1, 2, 4, 8
_AS_IT_IS = bytes(272)  # struct gpio_v2_line_config without a flag: the direction stays
_held: dict[tuple[str, int], int] = {}
"""The lines that were set, by node and number: the kernel lets one go when its file is closed."""


def chips(unit: Device) -> dict[str, Path]:
    """Node and folder of each of the device's chips (the kernel's older class has names that only look like these)."""
    folders = [path for path in unit.paths("gpio") if subsystem(path)[0] == "bus"]
    return {str(sysroot() / "dev" / path.name): path for path in folders}


def chip(unit: Device, number: int) -> str:
    """The node of one of the device's chips; DeviceFault when it has fewer."""
    nodes = list(chips(unit))
    if number >= len(nodes):
        raise DeviceFault(unit.id, f"{unit.id} has {len(nodes)} GPIO chips now; the first is number 0")
    return nodes[number]


def lines(node: str) -> tuple[str, list[dict[str, Any]]]:
    """Label and lines of a chip, as the kernel knows them; asking requests no line, so nothing changes.

    A line has ``offset``, ``name``, ``consumer``, ``used``, ``active_low`` and ``direction`` (``in`` or ``out``).
    """
    with Path(node).open("rb", 0) as file:
        label, count = _chip(file)
        return label, [_line(file, offset) for offset in range(min(count, MAX_LINES))]


def read(node: str, line: int) -> tuple[dict[str, Any], int | None]:
    """A line as in ``lines``, and 1 where it is high; None for one that another program or the kernel uses.

    A line that no one uses is requested for the moment, and its direction stays as it is.
    """
    with Path(node).open("rb", 0) as file:
        found = _checked(node, file, line)
        if found["used"]:
            held = _held.get((node, line))
            return found, None if held is None else _level(held)
        asked = _request(file, line, _AS_IT_IS)
        try:
            return found, _level(asked)
        finally:
            os.close(asked)


def drive(node: str, line: int, state: str) -> bool:
    """Set a line that this server holds (``high``, ``low``, ``input``); False when it holds none, or no more."""
    key = (node, line)
    if key not in _held:
        return False
    try:
        fcntl.ioctl(_held[key], _SET_CONFIG, _config(state))
    except OSError:  # the chip was away in between, and what is there now is another
        os.close(_held.pop(key))
        return False
    return True


def hold(node: str, line: int, state: str) -> None:
    """Request a line, set it, and keep it until this server ends; OSError (EBUSY) for one that is in use."""
    with Path(node).open("rb", 0) as file:
        _checked(node, file, line)
        _held[node, line] = _request(file, line, _config(state))


def _chip(file: Any) -> tuple[str, int]:
    _, label, count = struct.unpack("=32s32sI", fcntl.ioctl(file, _CHIPINFO, bytes(68)))
    return _text(label), count


def _line(file: Any, offset: int) -> dict[str, Any]:
    answer = fcntl.ioctl(file, _LINEINFO, bytes(64) + struct.pack("=I", offset) + bytes(188))
    name, user, flags = struct.unpack_from("=32s32s8xQ", answer)
    facts = {"used": bool(flags & _USED), "active_low": bool(flags & _ACTIVE_LOW)}
    direction = "out" if flags & _OUTPUT else "in"
    return {"offset": offset, "name": _text(name), "consumer": _text(user), **facts, "direction": direction}


def _checked(node: str, file: Any, line: int) -> dict[str, Any]:
    count = min(_chip(file)[1], MAX_LINES)
    if line >= count:
        raise DeviceFault(node, f"the chip has {count} lines; the first is number 0")
    return _line(file, line)


def _config(state: str) -> bytes:
    """struct gpio_v2_line_config: flags, and one attribute (2 is output values) with its mask."""
    if state == "input":
        return struct.pack("=Q264x", _INPUT)
    return struct.pack("=QI20xI4xQQ216x", _OUTPUT, 1, 2, state == "high", 1)


def _request(file: Any, line: int, config: bytes) -> int:
    """A file that holds the line until it is closed (struct gpio_v2_line_request)."""
    asked = struct.pack("=I252x32s272sI28x", line, b"octoform", config, 1)
    number: int = struct.unpack_from("=i", fcntl.ioctl(file, _GET_LINE, asked), 588)[0]
    return number


def _level(held: int) -> int:
    """1 when the line is high (struct gpio_v2_line_values)."""
    bits: int = struct.unpack("=QQ", fcntl.ioctl(held, _GET_VALUES, struct.pack("=QQ", 0, 1)))[0]
    return bits & 1


def _text(padded: bytes) -> str:
    """A name as the kernel pads it."""
    return padded.split(b"\0")[0].decode("utf-8", "replace")
