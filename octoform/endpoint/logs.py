"""The two logs of the endpoint as lines in one order: the calls, and what its process printed. Light.

A log may be cut, replaced or taken away while it is followed; no event of the system shows that in Python's own
library, so the files are looked at again and again. Secrets are taken out where the bytes are read, over line ends
too, before anything else sees them.
"""

import os
import time
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

from octoform.base import clock
from octoform.base.files import parse, stream
from octoform.endpoint.access.tokens import kept_values
from octoform.patterns import regex
from octoform.records import dataclass, field
from octoform.redaction import Redactor
from octoform.state.layout import Layout

CALLS, SERVER = "calls", "server"
TAIL_BYTES = 4_000_000
"""How far back a log is read."""
MAX_LINE = 1_000_000
"""Bytes after which a line counts as ended."""
_STAMP = regex(r"\[?(\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:[.,]\d+)?(?:Z|[+-]\d\d:\d\d)?)")


@dataclass(frozen=True, slots=True)
class Line:
    """A line of a log: when (seconds since 1970), of which log, as it is there and as the object that it is.

    The time of a line without one is that of the line before it, or when it was seen.
    """

    at: float
    log: str
    text: str
    record: Mapping[str, Any] | None = None


@dataclass(slots=True)
class Tail:
    """The lines of one file from near its present end on, as they come."""

    path: Path
    log: str
    secrets: Mapping[str, str] = field(default_factory=dict)
    _open: ExitStack = field(default_factory=ExitStack)
    _file: "IO[bytes] | None" = None
    _redactor: Redactor | None = None
    _rest: bytes = b""
    _at: float | None = None

    def read(self) -> list[Line]:
        """The whole lines that were added since the last time; at the first time the last megabytes."""
        pieces = []
        if self._file is None:
            pieces.append(self._opened(TAIL_BYTES))
        elif self._replaced():
            pieces += [self._more(), self._ended(), self._opened(None)]
        pieces.append(self._more())
        texts = b"".join(pieces).decode("utf-8", "replace").split("\n")[:-1]
        return [line for text in texts if text.strip() for line in (self._line(text),)]

    def close(self) -> None:
        """Let the file go."""
        if self._file is not None:
            self._open.close()
            self._file = None

    def _opened(self, back: int | None) -> bytes:
        """Open the file that is there now, ``back`` bytes before its end, or at its beginning when that is None."""
        self.close()
        self._redactor, self._rest = Redactor(self.secrets), b""
        try:
            self._file = self._open.enter_context(stream(self.path))
        except OSError:
            return b""
        size = os.fstat(self._file.fileno()).st_size
        if back is not None and size > back:
            self._file.seek(size - back)
            self._file.readline()  # the first is cut
        return b""

    def _replaced(self) -> bool:
        """True when another file has taken the place, or this one was cut."""
        assert self._file is not None
        ours = os.fstat(self._file.fileno())
        try:
            there = self.path.stat()
        except OSError:
            return False  # moved away: what is written is still written to ours
        return (there.st_dev, there.st_ino) != (ours.st_dev, ours.st_ino) or there.st_size < self._file.tell()

    def _more(self) -> bytes:
        """The added lines, without secrets, up to the last end of a line."""
        if self._file is None or self._redactor is None:
            return b""
        self._rest += self._redactor.feed(self._file.read())
        end = self._rest.rfind(b"\n") + 1
        if not end and len(self._rest) > MAX_LINE:
            whole, self._rest = self._rest + b"\n", b""
            return whole
        whole, self._rest = self._rest[:end], self._rest[end:]
        return whole

    def _ended(self) -> bytes:
        """The unfinished last line of the former file."""
        last = self._rest + (self._redactor.flush() if self._redactor else b"")
        return last + b"\n" if last else b""

    def _line(self, text: str) -> Line:
        record = _object(text) if self.log == CALLS else None
        stamp = str(record.get("time")) if record else text
        found = _STAMP.match(stamp)
        at = _seconds(found[1]) if found else None
        if at is not None:
            self._at = at
        return Line(at or self._at or self._seen(), self.log, text, record)

    def _seen(self) -> float:
        """When the file was last written, for what states nothing about its time."""
        return os.fstat(self._file.fileno()).st_mtime if self._file else time.time()


def _object(text: str) -> dict[str, Any] | None:
    try:
        value = parse(text)
    except ValueError:
        return None
    return value if isinstance(value, dict) else None


def _seconds(stamp: str) -> float | None:
    """Seconds since 1970 of a time as logs have it; one without a zone is of this machine's."""
    return clock.epoch(stamp.replace(",", "."), zone=None)


@dataclass(frozen=True, slots=True)
class Logs:
    """Both logs of a host."""

    tails: tuple[Tail, ...]

    def read(self) -> list[Line]:
        """The lines since the last call, in order."""
        return sorted((line for tail in self.tails for line in tail.read()), key=lambda line: line.at)

    def close(self) -> None:
        """Let the files go."""
        for tail in self.tails:
            tail.close()


def logs_of(layout: Layout) -> Logs:
    """The logs of a host, read from near their ends; the values of its tokens are taken out."""
    secrets = {f"token {name}": value for name, value in kept_values(layout).items()}
    return Logs((Tail(layout.call_log, CALLS, secrets), Tail(layout.server_log, SERVER, secrets)))


# The call log that the launcher injects, read from a mark on.
#
# A call that a client made and the log does not hold would be invisible to an observer of the server; so the log,
# not the answer, is the evidence for a test call.


@dataclass(frozen=True, slots=True)
class LoggedCall:
    """A call line with its result line, if it came. ``error`` is the class of the exception, ``ms`` the duration.

    ``raw`` are the numbers that the tool read of its devices through the runtime, by folder and attribute.
    """

    tool: str
    ended: bool
    ok: bool
    error: str | None = None
    message: str | None = None
    ms: float | None = None
    raw: Mapping[str, float] = field(default_factory=dict)


def mark(path: Path) -> int:
    """The log's present size in bytes; 0 when there is none."""
    try:
        return path.stat().st_size
    except OSError:
        return 0


def calls_after(path: Path, position: int) -> list[LoggedCall]:
    """The calls begun after ``position``, in order; a log that became shorter is read from its start."""
    try:
        with stream(path) as log:
            log.seek(position if position <= mark(path) else 0)
            lines = log.read().splitlines()
    except OSError:
        return []
    return _paired(filter(None, map(_parsed, lines)))


def _paired(entries: Iterable[dict[str, Any]]) -> list[LoggedCall]:
    begun: dict[str, dict[str, Any]] = {}
    ended: dict[str, dict[str, Any]] = {}
    for entry in entries:
        key = str(entry.get("id"))
        if entry.get("event") == "call":
            begun[key] = entry
        elif entry.get("event") == "result":
            ended[key] = entry
    return [_logged(entry, ended.get(key)) for key, entry in begun.items()]


def _logged(call: dict[str, Any], result: dict[str, Any] | None) -> LoggedCall:
    tool = str(call.get("tool"))
    if result is None:
        return LoggedCall(tool, ended=False, ok=False)
    ended = bool(result.get("ok")), result.get("error"), result.get("message"), result.get("ms")
    return LoggedCall(tool, True, *ended, raw=_numbers(result.get("raw")))


def _numbers(value: Any) -> dict[str, float]:
    found = value.items() if isinstance(value, dict) else ()
    return {str(name): float(number) for name, number in found if isinstance(number, int | float)}


def _parsed(line: bytes) -> dict[str, Any] | None:
    try:
        value = parse(line)
    except ValueError:  # a line that another process is just writing
        return None
    return value if isinstance(value, dict) else None
