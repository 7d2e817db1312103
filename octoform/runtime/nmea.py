"""Sentences of NMEA 0183 from a receiver, and their numbers. Nothing is ever sent."""

import functools
import operator
import os
import re
import select
import termios
import time
from collections.abc import Iterator

from .faults import DeviceFault

_BLOCK = 4096


def sentences(node: str, seconds: float) -> Iterator[list[str]]:
    """The fields of each whole sentence that comes within a time. Belongs under the device's lock."""
    descriptor, end, data = os.open(node, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY), time.monotonic() + seconds, b""
    try:
        if os.isatty(descriptor):  # a terminal would send back what comes
            state = termios.tcgetattr(descriptor)
            state[0] = state[1] = state[3] = 0
            termios.tcsetattr(descriptor, termios.TCSANOW, state)
        waiting = select.poll()
        waiting.register(descriptor, select.POLLIN)
        while (left := end - time.monotonic()) > 0:
            if not waiting.poll(1000 * left):
                return
            if not (part := os.read(descriptor, _BLOCK)):
                raise DeviceFault(node, "the receiver went away")
            *lines, data = (data[-_BLOCK:] + part).split(b"\n")
            for line in lines:
                body, _, found = line.strip().rpartition(b"$")[2].partition(b"*")
                if found.upper() == b"%02X" % functools.reduce(operator.xor, body, 0):
                    yield body.decode("ascii", "replace").split(",")
    finally:
        os.close(descriptor)


def degrees(text: str, half: str) -> float | None:
    """Degrees of ``ddmm.mmmm`` and a half of the globe; None where it is not given."""
    if not re.fullmatch(r"\d{3,5}(\.\d+)?", text) or half not in ("N", "S", "E", "W"):
        return None
    whole, minutes = divmod(float(text), 100)
    return round((whole + minutes / 60) * (-1 if half in "SW" else 1), 7)


def number(text: str) -> float | None:
    """A number of a sentence; None where it is not given."""
    return float(text) if re.fullmatch(r"-?\d+(\.\d+)?", text) else None
