"""New events of the two logs since the last look: calls that failed or worked, and what was printed. (Light.)

Everything in a log is foreign text: bounded, and its hidden characters made visible, before anybody else sees it.
"""

import os
import stat
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from octoform.base.escaping import escaped
from octoform.base.files import parse
from octoform.endpoint.logs import LoggedCall
from octoform.endpoint.published_files import read_policy
from octoform.patterns import regex
from octoform.records import dataclass
from octoform.state.layout import Layout

# New lines of a log, whatever becomes of the file: rotated, cut, replaced or not text at all. (Light.)
#
# A place in a file is remembered with the file's own number, so that lines which were written before a log was set
# away are still read from where it lies now, and none is read twice.

MAX_BYTES = 4_000_000
"""Bytes that are read at one look; of a log that grew by more, the newest of it."""
MAX_LINE = 1_000_000


class Tail:
    """The lines of one log from a place on. A new one begins at the log's end: what was before is no one's news."""

    def __init__(self, path: Path, place: Mapping[str, Any] | None = None) -> None:
        """``place`` is a former `place`; one that does not fit is as good as none."""
        self._path = path
        self._file, self._offset = _read(place)
        self.left_out = 0
        """Bytes that were passed over because there were too many."""
        if self._file is None:
            self.skip()

    @property
    def place(self) -> dict[str, Any]:
        """Where the next look begins, as JSON."""
        return {"file": list(self._file) if self._file else None, "offset": self._offset}

    def skip(self) -> None:
        """Go to the end: what was written until now is not to be judged."""
        found = _stat(self._path)
        self._file, self._offset = (_number(found), found.st_size) if found else ((0, 0), 0)

    def lines(self) -> list[str]:
        """The whole lines since the last time, as text; bytes that are none are replaced."""
        found = []
        there = _stat(self._path)
        if there is not None and _number(there) != self._file:
            former = self._moved()
            if former is not None:
                found += self._more(former)
            self._file, self._offset = _number(there), 0
        if there is not None:
            found += self._more(self._path)
        return found

    def _moved(self) -> Path | None:
        """Where the file lies that was read until now: beside the new one, under a name that begins with its own."""
        for path in sorted(self._path.parent.glob(f"{self._path.name}.*")):
            there = _stat(path)
            if there is not None and _number(there) == self._file:
                return path
        return None

    def _more(self, path: Path) -> list[str]:
        try:
            descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError:
            return []
        there = os.fstat(descriptor)
        if not stat.S_ISREG(there.st_mode):
            os.close(descriptor)
            self._offset = 0
            return []  # a pipe or a folder in its place has no lines
        with os.fdopen(descriptor, "rb") as log:
            size = there.st_size
            if size < self._offset:  # it was cut
                self._offset = 0
            cut = size - self._offset > MAX_BYTES
            if cut:
                self.left_out += size - MAX_BYTES - self._offset
                self._offset = size - MAX_BYTES
            log.seek(self._offset)
            data = log.read(MAX_BYTES)
        end = data.rfind(b"\n") + 1
        if not end and len(data) > MAX_LINE:
            end = len(data)  # what has no end is no line worth waiting for
        self._offset += end
        lines = data[:end].split(b"\n")[int(cut) :]
        return [line.decode("utf-8", "replace") for line in lines if line.strip()]


def _stat(path: Path) -> os.stat_result | None:
    try:
        return path.stat(follow_symlinks=False)
    except OSError:
        return None


def _number(found: os.stat_result) -> tuple[int, int]:
    return found.st_dev, found.st_ino


def _read(place: Mapping[str, Any] | None) -> tuple[tuple[int, int] | None, int]:
    try:
        device, inode = (place or {})["file"]
        return (int(device), int(inode)), int((place or {})["offset"])
    except (LookupError, TypeError, ValueError):
        return None, 0


def objects(lines: list[str]) -> Iterator[dict[str, Any]]:
    """The lines that are JSON objects; what is none states nothing here."""
    for line in lines:
        try:
            value = parse(line)
        except ValueError:
            continue
        if isinstance(value, dict):
            yield value


MAX_CALLS, MAX_LINES, MAX_UNDER_WAY = 200, 100, 500
TEXT_CHARS = 500
CALL_SECONDS, GRACE_SECONDS = 30.0, 10.0
"""Seconds of a call without a timeout in the policy, and the seconds after which it counts as lost."""
_ACCESS = regex(r'"(?:GET|HEAD|POST|PUT|PATCH|DELETE|OPTIONS) [^"]* HTTP/[\d.]+"')


@dataclass(frozen=True, slots=True)
class Heard:
    """The events in the logs since the last look.

    ``failures`` are in order, the newest where there are too many, of each tool those after its last call that worked;
    ``worked`` are names of tools, each once.
    """

    failures: tuple[LoggedCall, ...] = ()
    worked: tuple[str, ...] = ()
    printed: tuple[str, ...] = ()


class Hearing:
    """Reads both logs from a place on; ``places`` is a former `places`."""

    def __init__(self, layout: Layout, uptime: Callable[[], float], places: Mapping[str, Any] | None = None) -> None:
        known = places or {}
        self._layout = layout
        self._uptime = uptime
        self._calls = Tail(layout.call_log, known.get("calls"))
        self._server = Tail(layout.server_log, known.get("server"))
        self._under_way: dict[str, tuple[str, float]] = {}

    @property
    def places(self) -> dict[str, Any]:
        """Where the next look begins, as JSON."""
        return {"calls": self._calls.place, "server": self._server.place}

    def __call__(self, *, again: bool = True) -> Heard:
        """The new events; without ``again`` only what is overdue, and no file is read."""
        failures: list[LoggedCall] = []
        worked: dict[str, None] = {}
        for entry in objects(self._calls.lines()) if again else ():
            call = self._ended(entry)
            if call is not None and call.ok:
                worked[call.tool] = None
                failures = [each for each in failures if each.tool != call.tool]
            elif call is not None:
                failures.append(call)
        failures += self._overdue()
        printed = [_display(line) for line in self._server.lines() if not _ACCESS.search(line)] if again else []
        return Heard(tuple(failures[-MAX_CALLS:]), tuple(worked), tuple(printed[-MAX_LINES:]))

    def successes(self) -> Heard:
        """Only the tools whose last call worked, of what is new; the rest is not to be judged.

        A person or agent at work on the host tries its tools and judges failures. That a tool works is true for all.
        """
        last: dict[str, bool] = {}
        for entry in objects(self._calls.lines()):
            call = self._ended(entry)
            if call is not None:
                last[call.tool] = call.ok
        self._server.skip()
        self._under_way.clear()
        return Heard(worked=tuple(name for name, ok in last.items() if ok))

    def _ended(self, entry: Mapping[str, Any]) -> LoggedCall | None:
        """The call that a line ends; None for every other line."""
        identity, tool = str(entry.get("id")), _display(str(entry.get("tool")))
        if entry.get("event") == "call":
            if len(self._under_way) < MAX_UNDER_WAY:
                self._under_way[identity] = (tool, self._uptime())
            return None
        if entry.get("event") != "result":
            return None
        self._under_way.pop(identity, None)
        error, message = (_text(entry.get(name)) for name in ("error", "message"))
        took = entry.get("ms")
        return LoggedCall(tool, True, entry.get("ok") is True, error, message, took if _is_number(took) else None)

    def _overdue(self) -> Iterator[LoggedCall]:
        """Calls that should have ended long ago; each is reported once."""
        now = self._uptime()
        late = [key for key, (_, began) in self._under_way.items() if now - began > CALL_SECONDS + GRACE_SECONDS]
        allowed = self._allowed() if late else {}
        for key in late:
            tool, began = self._under_way[key]
            seconds = allowed.get(tool, CALL_SECONDS)
            if now - began > seconds + GRACE_SECONDS:
                del self._under_way[key]
                yield LoggedCall(tool, False, False, None, f"it has not ended within its {seconds:g} s")

    def _allowed(self) -> dict[str, float]:
        """The timeout of each tool by the policy, in seconds."""
        tools = (read_policy(self._layout) or {"tools": {}})["tools"]
        return {name: float(tool["timeout"]) for name, tool in tools.items() if tool.get("timeout") is not None}

    def forget(self) -> None:
        """The process is another one: what was under way in the former ended with it."""
        self._under_way.clear()


def _text(value: object) -> str | None:
    return None if value is None else _display(str(value))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _display(text: str) -> str:
    cut = text if len(text) <= TEXT_CHARS else f"{text[:TEXT_CHARS]}..."
    return escaped(cut)
