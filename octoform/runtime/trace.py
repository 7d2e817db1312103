"""What one call of a tool asked of the host: the devices that it looked for, and the numbers that it read of them.

The call log tells it with the call's result. By it a result can be held against what the kernel said: a tool that asks
for no device, or that gives the same number while the attribute it reads has moved, does not tell the truth.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path, PosixPath
from typing import Any

MOST = 8
"""Devices and numbers that are kept of one call."""


@dataclass
class Trace:
    """``devices`` are the ids in the order in which they were asked for, ``raw`` numbers by folder and attribute."""

    devices: list[str] = field(default_factory=list)
    raw: dict[str, float] = field(default_factory=dict)


_current: ContextVar[Trace | None] = ContextVar("trace", default=None)


@contextmanager
def traced() -> Iterator[Trace]:
    """What the code inside asks for is in the trace, as far as it asks in this thread or task."""
    trace = Trace()
    token = _current.set(trace)
    try:
        yield trace
    finally:
        _current.reset(token)


@contextmanager
def asking(device: str) -> Iterator[None]:
    """A device is looked for; what is read meanwhile tells where it is, and nothing of what it measures."""
    trace = _current.get()
    if trace is not None and device not in trace.devices and len(trace.devices) < MOST:
        trace.devices.append(device)
    token = _current.set(None)
    try:
        yield
    finally:
        _current.reset(token)


def read(path: Path, text: str | bytes) -> None:
    """An attribute was read; it is kept where it is a number."""
    trace = _current.get()
    if trace is None or len(trace.raw) >= MOST or len(text) > 64:
        return
    try:
        number = float(text)
    except ValueError:
        return
    if math.isfinite(number):
        trace.raw[f"{path.parent.name}/{path.name}"] = number


class Folder(PosixPath):
    """A folder of attributes; what is read of the paths below it is in the trace."""

    def read_text(self, *arguments: Any, **options: Any) -> str:
        """As of every path."""
        text = super().read_text(*arguments, **options)
        read(self, text)
        return text

    def read_bytes(self) -> bytes:
        """As of every path."""
        data = super().read_bytes()
        read(self, data)
        return data
