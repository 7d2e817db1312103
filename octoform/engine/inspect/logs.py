"""What the endpoint did, for a person: a call and its result as one entry, beside what its process printed. Light."""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from octoform.diagnostics import Diagnostic
from octoform.endpoint.observe.logs import CALLS, Line, Logs, logs_of
from octoform.engine.tools import layout_of

PATIENCE_SECONDS = 2.0
"""A call that takes longer is shown before its result comes."""


@dataclass(frozen=True, slots=True)
class Entry:
    """What one line for a person tells; ``at`` as in `Line`.

    ``line`` is what it was made of: of a call its result, as far as there is one. ``call`` is the line with which the
    call began; None for everything that is no call.
    """

    at: float
    line: Line
    call: Mapping[str, Any] | None = None
    ended: bool = True


@dataclass(slots=True)
class Pairing:
    """Brings calls and results together; ``clock`` counts seconds."""

    clock: Callable[[], float] = time.monotonic
    _open: dict[str, tuple[Line, float]] = field(default_factory=dict)

    def take(self, lines: list[Line]) -> Iterator[Entry]:
        """Entries for what has come: a call where its result stands."""
        for line in lines:
            record = line.record or {}
            event, key = record.get("event"), str(record.get("id"))
            if line.log == CALLS and event == "call":
                self._open[key] = (line, self.clock())
            elif line.log == CALLS and event == "result":
                began = self._open.pop(key, None)
                yield Entry(line.at, line, (began[0].record if began else None) or record)
            else:
                yield Entry(line.at, line)

    def waiting(self, seconds: float) -> Iterator[Entry]:
        """Calls that have had no result for so long, each once; its result is an entry of its own."""
        now = self.clock()
        for key, (line, since) in self._open.items():
            if now - since >= seconds:
                self._open[key] = (line, float("inf"))
                yield Entry(line.at, line, line.record, ended=False)


def open_logs(project: Path, environ: Mapping[str, str]) -> tuple[Logs | None, list[Diagnostic]]:
    """The logs of the project's host; to be closed."""
    layout, found = layout_of(project, environ)
    return (logs_of(layout) if layout else None), found


def entries(logs: Logs) -> tuple[list[Entry], Pairing]:
    """All that there is now, in order, a call without a result where it began; and what is to go on with."""
    pairing = Pairing()
    found = [*pairing.take(logs.read()), *pairing.waiting(0.0)]
    return sorted(found, key=lambda entry: entry.at), pairing


def following(logs: Logs, pairing: Pairing, go_on: Callable[[], bool]) -> Iterator[list[Entry]]:
    """What comes from now on, in pieces; ``go_on`` waits, and says whether anybody is still there to read."""
    while go_on():
        yield [*pairing.take(logs.read()), *pairing.waiting(PATIENCE_SECONDS)]


def lines(logs: Logs, go_on: Callable[[], bool]) -> Iterator[list[Line]]:
    """The same without bringing calls and results together."""
    while go_on():
        yield logs.read()
