"""The running endpoint as its own record tells it, believed only where the kernel says the same.

Light: the pipe of every client and every plan ask this.
"""

from dataclasses import dataclass
from typing import Any

from octoform.base.files import read_json
from octoform.base.place import is_from
from octoform.base.shape import fits
from octoform.state.layout import Layout
from octoform.state.lock_holder import PROC, start_time

RECORD = "process.json"
MARK = "OCTOFORM_ENDPOINT"
"""A variable by which what the tools of an endpoint leave behind is known: a random word for each start."""


_RECORD = {
    "pid": int,
    "start": int,
    "boot": str,
    "argv": [str],
    "instance": str,
    "since": str,
    "scope": str,
    "url": (str, None),
    "mark": (str, None),
}


@dataclass(frozen=True, slots=True)
class Running:
    """A process that serves the endpoint; ``since`` is RFC 3339, ``url`` None without a network socket.

    ``start`` is when it started, in clock ticks since boot: with the pid, the boot and the command line it names
    the process for certain. ``instance`` tells one start of the endpoint from another.
    ``mark`` stands in its environment as MARK, and in that of all that its tools started (None: started by hand).
    """

    pid: int
    start: int
    argv: tuple[str, ...]
    instance: str
    since: str
    scope: str
    url: str | None
    mark: str | None = None


def running(layout: Layout) -> Running | None:
    """The process that serves this host's endpoint; None when its record is of no such live process."""
    found = last_running(layout)
    return found if found is not None and is_it(found) else None


def last_running(layout: Layout) -> Running | None:
    """The process that served this host's endpoint last, which may have ended; None when none did since the boot.

    The record in a copy of the folder is of the original's process, which is none of the copy's.
    """
    try:
        record = read_json(layout.run / RECORD)
    except (OSError, ValueError):
        return None
    if not fits(record, _RECORD):
        return None
    return _read(record) if record["boot"] == _boot() and is_from(record, layout.run) else None


def is_it(process: Running) -> bool:
    """True when exactly that process lives: pid, start time and command line agree."""
    return start_time(process.pid) == process.start and _command_line(process.pid) == process.argv


def _read(record: dict[str, Any]) -> Running:
    return Running(
        pid=record["pid"],
        start=record["start"],
        argv=tuple(record["argv"]),
        instance=record["instance"],
        since=record["since"],
        scope=record["scope"],
        url=record["url"],
        mark=record.get("mark"),
    )


def _boot() -> str:
    try:
        return (PROC / "sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return ""


def _command_line(pid: int) -> tuple[str, ...]:
    try:
        data = (PROC / str(pid) / "cmdline").read_bytes()
    except OSError:
        return ()
    return tuple(word.decode(errors="surrogateescape") for word in data.split(b"\0")[:-1])
