"""The running endpoint: its own record, believed only where the kernel reports the same, and what its process answers.

Light: the pipe of every client and every plan ask this.
"""

import json
import os
import pwd
from collections.abc import Mapping
from typing import Any

from octoform.base import clock
from octoform.base.escaping import escaped
from octoform.base.files import parse, private_folder, read_json
from octoform.base.place import is_from
from octoform.base.processes import command_line, is_alive
from octoform.base.shape import fits
from octoform.diagnostics import Diagnostic, error
from octoform.records import dataclass
from octoform.state.files import read_regular, refused, write_atomic
from octoform.state.layout import Layout

RECORD = "process.json"
CONTROL = "control.sock"
MAX_ANSWER_BYTES = 16_000_000
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
    the process for certain. ``instance`` identifies one start of the endpoint.
    ``mark`` is in its environment as MARK, and in that of all that its tools started (None: started by hand).
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
    return _read(record) if record["boot"] == clock.boot_id() and is_from(record, layout.run) else None


def is_it(process: Running) -> bool:
    """True when exactly that process lives: pid, start time and command line agree."""
    return is_alive(process.pid, process.start) and command_line(process.pid) == process.argv


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


# A person's stop: a mark that lasts until the endpoint is wanted again, so that nothing starts it by itself. Light.
#
# ``octoform stop`` makes it. ``start`` and ``apply`` take it away, and so does a client whose command line its owner
# gave ``-start``. Every other client is refused with the stop as the reason. The daemon leaves a marked endpoint alone,
# also after a reboot.

_LIMIT = 64 * 1024
_MAX_CHARACTERS = 200
STOPPED = "ENDPOINT-STOPPED"
HINT = "octoform start starts it; a client whose command has -start may, too"


@dataclass(frozen=True, slots=True)
class Stop:
    """The person who stopped the endpoint, and when (RFC 3339, empty where the mark does not say)."""

    by: str = "a person"
    at: str = ""

    def describe(self, host: str) -> str:
        """One sentence for anyone who finds it stopped."""
        return f"the endpoint of {host} was stopped by {self.by}" + (f" at {self.at}" if self.at else "")


def mark(layout: Layout) -> Diagnostic | None:
    """Say that a person wants the endpoint stopped; why it could not be stated, None when it is."""
    document = {"format": 1, "by": _person(), "at": clock.stamp()}
    try:
        private_folder(layout.run)
    except OSError as problem:
        return refused(problem, layout.run)
    return write_atomic(layout.stop_mark, json.dumps(document).encode(), 0o600)


def unmark(layout: Layout) -> None:
    """The endpoint is wanted again. OSError when the system refuses."""
    layout.stop_mark.unlink(missing_ok=True)


def is_marked(layout: Layout) -> bool:
    """True while a person wants it stopped; whatever is in the mark's place counts."""
    return os.path.lexists(layout.stop_mark)


def read(layout: Layout) -> Stop | None:
    """The stop that holds; None when there is none. A mark that cannot be read holds without a name."""
    if not is_marked(layout):
        return None
    data, _ = read_regular(layout.stop_mark, _LIMIT)
    try:
        document = parse(data or b"")
        return Stop(*(escaped(str(text)[:_MAX_CHARACTERS]) for text in (document["by"], document.get("at", ""))))
    except (ValueError, LookupError, TypeError, AttributeError):
        return Stop()


def refusal(layout: Layout, hint: str = HINT) -> Diagnostic | None:
    """Why nothing may start the endpoint unasked; None when no person stopped it."""
    stop = read(layout)
    return None if stop is None else error(STOPPED, stop.describe(layout.host), hint=hint)


def _person() -> str:
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return f"uid {os.getuid()}"


# Endpoints of other hosts in a folder: one that the manifest no longer names runs on until it is stopped. Light.


def running_beside(layout: Layout) -> tuple[str, ...]:
    """The hosts of this folder, but for this one, whose endpoints run, by name."""
    records = layout.project.glob(f".octoform/*/{layout.run.name}/{RECORD}")
    hosts = sorted(path.parents[1].name for path in records)
    return tuple(host for host in hosts if host != layout.host and running(Layout(layout.project, host)))


def ask(layout: Layout, question: Mapping[str, Any], seconds: float = 5.0) -> dict[str, Any] | None:
    """The answer of the endpoint's control thread to ``{"op": ..., ...}``, one line of JSON each way.

    None when no process answers within ``seconds``.
    """
    from octoform.endpoint.sockets import connect  # whose library defines two hundred constants

    try:
        with connect(layout.run / CONTROL, seconds) as connection:
            connection.sendall(json.dumps(question).encode() + b"\n")
            data = b""
            while not data.endswith(b"\n") and len(data) < MAX_ANSWER_BYTES:
                part = connection.recv(65536)
                if not part:
                    break
                data += part
            answer = parse(data)
    except (OSError, ValueError):
        return None
    return answer if isinstance(answer, dict) else None
