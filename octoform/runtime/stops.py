"""A device's stop as a file: it has to outlive the process that took it, and be seen by every other one.

It lies in the folder that OCTOFORM_STOPS names. Whatever stands at its place stops the device, readable or not: a
damaged stop must never set anything free. Without that folder a stop is a fact of one process alone.
"""

import contextlib
import fcntl
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from .faults import DeviceFault
from .plainfiles import parse, read, replace

FORMAT = 1
_SIZE = 4096


class Stop(NamedTuple):
    """A stop that was seen: the command that ends it, or "" and why it cannot be read; ``mark`` is its own alone."""

    until: str
    unreadable: str
    mark: object


def seen(device: str) -> Stop | None:
    """What stops the device now, looked up anew each time; None when nothing does or no folder is named."""
    place = _place(device)
    if place is None:
        return None
    data = b""
    try:
        data = read(place, _SIZE, follow=False)
        told = parse(data)
        until = told["until"]
        if told["format"] != FORMAT or told["device"] != device or not isinstance(until, str) or not until:
            raise ValueError("it is of another device or format")
    except FileNotFoundError:
        return None
    except (OSError, ValueError, LookupError, TypeError) as problem:
        return Stop("", f"{place} is there but cannot be read ({_reason(problem)})", data or _status(place))
    return Stop(until, "", data)


def put(device: str, until: str) -> str:
    """Stop the device until the command ``until``; "" once that stands on the disk, else why it does not."""
    place = _place(device)
    if place is None:
        return "it was given no folder to keep the stop in"
    # Two stops are never the same bytes: the command that ends one must not end a later one.
    told = {"format": FORMAT, "device": device, "until": until, "stop": os.urandom(8).hex()}
    try:
        with _alone(place.parent):
            replace(place, json.dumps(told).encode("ascii") + b"\n")
    except OSError as problem:
        return f"{place} cannot be written ({_reason(problem)})"
    return ""


def lift(device: str, stop: Stop | None) -> None:
    """End the stop that was seen before the command that ends it was sent; one that came later stays.

    DeviceFault when its file cannot be removed: the device stays stopped then.
    """
    place = _place(device)
    if stop is None or place is None:
        return
    try:
        with _alone(place.parent):
            now = seen(device)
            if now is not None and now.mark == stop.mark:
                place.unlink()
    except OSError as problem:
        why = f"{place} cannot be removed ({_reason(problem)})"
        raise DeviceFault(device, f"the command went well, but {device} stays stopped: {why}") from problem


def _place(device: str) -> Path | None:
    folder = os.environ.get("OCTOFORM_STOPS")
    return Path(folder) / f"stopped-{quote(device, safe='')}.json" if folder else None


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """While no other thread or process changes a stop in it."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _status(place: Path) -> object:
    """Tells one thing at a place from the next where its content cannot; None when nothing can be told."""
    try:
        status = place.lstat()
    except OSError:
        return None
    return status.st_dev, status.st_ino, status.st_ctime_ns


def _reason(problem: Exception) -> str:
    return (problem.strerror if isinstance(problem, OSError) else None) or type(problem).__name__
