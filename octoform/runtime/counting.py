"""Where a product that measures nothing must be, and a stop for one that cannot be interrupted.

A position is a fact of this process, held for all of its threads. It is counted from the command that takes every axis
to its origin. It is unknown before that, after a movement that failed or whose answer did not come, and when the device
was attached again, because its own counter began again as well. A counted device is kept open: some do something of
their own while no one has their line open, which would make the count a lie.

After a stop nothing is sent but the one command that ends it; what is under way then is carried out to its end. A stop
outlives the process: it is a file (`stops`), looked at before each command. Where none can be written, it holds in this
process alone, and the answer states that.
"""

import json
import os
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

from .base.files import parse, read, record, replace
from .base.locks import held_folder
from .faults import DeviceFault

# A device's stop as a file: it has to outlive the process that took it, and be seen by every other one.
#
# It lies in the folder that OCTOFORM_STOPS names. Whatever stands at its place stops the device, readable or not: a
# damaged stop must never set anything free. Without that folder a stop is a fact of one process alone.

FORMAT = 1
_SIZE = 4096


class Stop(NamedTuple):
    """A stop that was seen: the command that ends it, or "" and why it cannot be read; ``mark`` is its own alone."""

    until: str
    unreadable: str
    mark: object


def seen(device: str) -> Stop | None:
    """The stop in force for the device, looked up each time; None without one or without a folder."""
    place = _place(device)
    if place is None:
        return None
    data = b""
    try:
        data = read(place, _SIZE, follow=False)
        fields = record(parse(data), FORMAT)
        until = fields["until"]
        if fields["device"] != device or not isinstance(until, str) or not until:
            raise ValueError("it is of another device")
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
    fields = {"format": FORMAT, "device": device, "until": until, "stop": os.urandom(8).hex()}
    try:
        with held_folder(place.parent):
            replace(place, json.dumps(fields).encode("ascii") + b"\n")
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
        with held_folder(place.parent):
            now = seen(device)
            if now is not None and now.mark == stop.mark:
                place.unlink()
    except OSError as problem:
        why = f"{place} cannot be removed ({_reason(problem)})"
        raise DeviceFault(device, f"the command went well, but {device} stays stopped: {why}") from problem


def _place(device: str) -> Path | None:
    folder = os.environ.get("OCTOFORM_STOPS")
    return Path(folder) / f"stopped-{quote(device, safe='')}.json" if folder else None


def _status(place: Path) -> object:
    """Identifies the file at a path where its content cannot; None when it cannot be read."""
    try:
        status = place.lstat()
    except OSError:
        return None
    return status.st_dev, status.st_ino, status.st_ctime_ns


def _reason(problem: Exception) -> str:
    return (problem.strerror if isinstance(problem, OSError) else None) or type(problem).__name__


ANEW = "the device was attached again"


class Step(NamedTuple):
    """The effect of a command on the position: ``by`` on an axis, or with ``zero`` the origin of all axes.

    ``resumes`` marks the command that ends a stop.
    """

    axis: str = ""
    by: int = 0
    zero: bool = False
    resumes: bool = False

    @property
    def moves(self) -> bool:
        """Whether it changes the position at all."""
        return self.zero or self.axis != ""


class _Known:
    def __init__(self) -> None:
        self.sums: dict[str, int] | None = None
        self.why = "nothing was counted since this server started"
        self.attached: object = None
        self.line = -1
        self.stopped = ""  # the command that ends a stop which is not, or not yet, a file
        self.stops = 0


_known: dict[str, _Known] = {}
_guard = threading.Lock()
NONE = Step()


def attached(line: int | str) -> object:
    """Equal for a line, open or by its node, for as long as its device was not attached again."""
    node = os.fstat(line) if isinstance(line, int) else Path(line).stat()
    return node.st_dev, node.st_ino, node.st_rdev, node.st_ctime_ns


def position(device: str, node: str, axes: Iterable[str], zero: str) -> dict[str, Any]:
    """The sum of each axis since ``zero``, or None for each with the reason in ``unknown``; nothing is opened."""
    now = attached(node)
    with _guard:
        known = _known.setdefault(device, _Known())
        if known.sums is not None and known.attached != now:
            known.sums, known.why = None, ANEW
        if known.sums is None:
            return {"device": device, **dict.fromkeys(axes), "unknown": f"{known.why}; {zero} makes it known"}
        return {"device": device, **{axis: known.sums.get(axis, 0) for axis in axes}, "unknown": None}


def stop(device: str, until: str) -> dict[str, Any]:
    """From now on nothing is sent to the device but the command ``until``, also by servers that start later.

    ``note`` states why, when the stop could not be written and ends with this server.
    """
    with _guard:
        known = _known.setdefault(device, _Known())
        known.stopped = until
        known.stops += 1
        mine = known.stops
    unwritten = put(device, until)
    if not unwritten:
        with _guard:
            if known.stops == mine:
                known.stopped = ""
    holds = f"or this server ends, because {unwritten}" if unwritten else "also after a restart of this server"
    under_way = "a movement under way goes on to its end: nothing can interrupt it"
    note = f"nothing is sent until {until} went well, {holds}; {under_way}"
    return {"device": device, "stopped": True, "until": until, "note": note}


def refuse(device: str, step: Step) -> None:
    """DeviceFault while the device is stopped, for every command but the one that ends the stop."""
    if step.resumes:
        return
    # The process before the file: a stop that is becoming a file is always in one of them.
    until = _known.setdefault(device, _Known()).stopped
    if not until and (found := seen(device)) is not None:
        if found.unreadable:
            ending = "nothing is sent to it but the command that ends a stop"
            raise DeviceFault(device, f"{device} counts as stopped: {found.unreadable}; {ending}")
        until = found.until
    if until:
        raise DeviceFault(device, f"{device} is stopped: nothing is sent to it until {until} went well")


def _let_go(known: _Known) -> None:
    line, known.line = known.line, -1
    if line >= 0:
        os.close(line)


class Counted:
    """Around the sending of one command, once its device is held: refuses it after a stop, and keeps the count."""

    def __init__(self, device: str, step: Step, line: int) -> None:
        """``line`` is the open line, by the number of its file."""
        self._device, self._step, self._line = device, step, line
        self._stops = 0
        self._stop: Stop | None = None
        self._sums: dict[str, int] | None = None
        self._why = ""

    def __enter__(self) -> "Counted":
        """DeviceFault while the device is stopped; from here on its position is unknown until it answered."""
        with _guard:
            known = _known.setdefault(self._device, _Known())
            refuse(self._device, self._step)
            self._stops = known.stops
            self._stop = seen(self._device) if self._step.resumes else None
            if known.attached != (now := attached(self._line)):
                if known.sums is not None:
                    known.sums, known.why = None, ANEW
                _let_go(known)
            known.attached = now
            if self._step.moves and known.line < 0:
                # Opened once more, not duplicated: a lock on the line lasts for one exchange alone.
                known.line = os.open(os.ttyname(self._line), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
            self._sums, self._why = known.sums, known.why
            if self._step.moves:
                known.sums, known.why = None, "a movement is under way"
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Count what was acknowledged; forget the position after what was not.

        DeviceFault when the command went well but the stop that it ends cannot be removed.
        """
        step = self._step
        with _guard:
            known = _known[self._device]
            if kind is not None:
                if step.moves:
                    known.why = "a movement failed, and whether it was carried out is not known"
                return
            if step.zero:
                known.sums = {}
            elif step.moves:
                known.sums, known.why = self._sums, self._why
                if known.sums is not None:
                    known.sums = {**known.sums, step.axis: known.sums.get(step.axis, 0) + step.by}
            ends = step.resumes and known.stops == self._stops
            if ends:
                known.stopped = ""
        if ends:
            lift(self._device, self._stop)
