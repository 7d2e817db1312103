"""Event nodes of input devices (linux/input.h): axes, events, rumble. Every call belongs under the device's lock."""

import errno
import fcntl
import os
import select
import stat
import struct
import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NamedTuple

RUMBLE = 0x50
"""The bit of an effect that two motors play (FF_RUMBLE)."""
_EVIOCGABS, _EVIOCSFF = 0x80184540, 0x40004580
_FORCE = 21
_EVENT = struct.Struct("llHHi")  # struct input_event with this machine's word size
_EFFECT_BYTES = 48 if struct.calcsize("P") == 8 else 44  # struct ff_effect ends in a pointer


class Event(NamedTuple):
    """One event: the name of its node, the kernel's time in seconds, type, code and value."""

    node: str
    time: float
    kind: int
    code: int
    value: int


def axis(node: Path, code: int) -> dict[str, int | None]:
    """``position``, ``minimum`` and ``maximum`` of an axis; None where the node does not give them to this user."""
    position, low, high = None, None, None
    with suppress(OSError), os.fdopen(os.open(node, os.O_RDONLY | os.O_NONBLOCK), "rb", 0) as event:
        position, low, high = struct.unpack_from("=3i", fcntl.ioctl(event, _EVIOCGABS + code, bytes(24)))
    return {"position": position, "minimum": low, "maximum": high}


def events(nodes: Sequence[str], most: int, seconds: float) -> list[Event]:
    """The events that come within a time, until there are ``most``; OSError for a node that is an ordinary file."""
    found: list[Event] = []
    end, waiting, files = time.monotonic() + seconds, select.poll(), {}
    with ExitStack() as stack:
        for node in nodes:
            file = stack.enter_context(Path(node).open("rb", 0))
            if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY), node)  # it would be read as "no event came"
            files[file.fileno()] = Path(node).name
            waiting.register(file, select.POLLIN)
        while len(found) < most and (left := end - time.monotonic()) > 0:
            for number, _ in waiting.poll(1000 * left):
                data = os.read(number, 64 * _EVENT.size)
                found += [
                    Event(files[number], second + micro / 1e6, kind, code, value)
                    for second, micro, kind, code, value in _EVENT.iter_unpack(data)
                    if kind  # kind 0 only ends a report
                ]
    return found[:most]


def rumble(node: Path, strength: float, seconds: float) -> None:
    """Turn both motors (``strength`` is 0 to 1) for a time; returns when they stand still."""
    power, length = round(65535 * strength), round(1000 * seconds)
    effect = struct.pack("=Hh5H2x2H", RUMBLE, -1, 0, 0, 0, length, 0, power, power).ljust(_EFFECT_BYTES, b"\0")
    with node.open("r+b", 0) as pad:
        effect = fcntl.ioctl(pad, _EVIOCSFF | _EFFECT_BYTES << 16, effect)  # fills in the effect's number
        pad.write(_EVENT.pack(0, 0, _FORCE, struct.unpack_from("=h", effect, 2)[0], 1))
        time.sleep(seconds)
