"""The call log that the launcher injects, read from a mark on.

A call that a client made and the log does not hold would be invisible to whoever watches the server; so the log,
not the answer, is what a trial call is believed by.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from octoform.base.files import parse, stream


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
