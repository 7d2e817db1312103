"""What the daemon knows, as an agent may read it: checked, bounded in bytes, and without anything that acts as text.

A brief comes from another process and holds words of devices and tools. What is not of the right form is left out and
counted; of what is too much, the newest of each signal stays first.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any

from octoform.escaping import escaped

READING_BYTES = 24 << 10
FAILURE_BYTES = 8 << 10
CLAIM_BYTES = 8 << 10
SUMMARY_CHARACTERS = 600
TEXT_CHARACTERS = 300
FRAME = "frame"
CHANNELS = ("log", FRAME, "sensor", "kernel", "process")

Row = dict[str, Any]


def readings_of(brief: Mapping[str, Any]) -> list[Row]:
    """The readings of a brief as rows ``{id, at, channel, source, path, value, why}``, oldest first, bounded.

    Of too many the newest of each signal stay, and of a camera the one before it, which vouches for the former picture.

    A reading may come with its signal in a member of its own.
    """
    rows = [row for item in _listed(brief, "readings") for row in _reading(item)]
    newest = _newest_of_each(rows)
    first = sorted(range(len(rows)), key=lambda at: (at not in newest, -at))
    kept = sorted(_within((at, rows[at]) for at in first))
    return [rows[at] for at in kept]


def failures_of(brief: Mapping[str, Any]) -> list[Row]:
    """The failures of a brief as rows ``{id, tool, error, message, count, first, last}``, bounded, newest kept."""
    names = ("id", "tool", "error", "message", "first", "last")
    rows = []
    for item in _listed(brief, "failures"):
        row: Row = {name: _text(item.get(name)) for name in names}
        if row["id"] and row["tool"]:
            count = item.get("count")
            rows.append({**row, "count": count if isinstance(count, int) else 1})
    return _newest(rows, FAILURE_BYTES)


def claims_of(brief: Mapping[str, Any]) -> list[Row]:
    """The claims in force, with their words made plain, bounded."""
    return _newest([plain(item) for item in _listed(brief, "claims")], CLAIM_BYTES)


def summary_of(brief: Mapping[str, Any]) -> str | None:
    """The words of the last report."""
    told = brief.get("summary")
    return escaped(told, "\n")[:SUMMARY_CHARACTERS] if isinstance(told, str) and told.strip() else None


def since_of(brief: Mapping[str, Any]) -> float:
    """The moment from which on the log counts, in seconds since 1970; 0 where none is given."""
    try:
        return datetime.fromisoformat(str(brief.get("since"))).timestamp()
    except (ValueError, OverflowError):
        return 0.0


def _reading(item: Mapping[str, Any]) -> Iterable[Row]:
    signal = item.get("signal")
    place = signal if isinstance(signal, Mapping) else item
    row: Row = {"id": _text(item.get("id")), "at": _text(item.get("at"))}
    row |= {name: _text(place.get(name)) for name in ("channel", "source", "path")}
    if row["id"] and row["channel"] in CHANNELS:
        value = item.get("value")
        row["value"] = _text(value) if isinstance(value, str) else value if _is_plain(value) else None
        row["why"] = _text(item.get("why"))
        yield row


def _is_plain(value: object) -> bool:
    return value is None or isinstance(value, bool | int | float)


def _newest_of_each(rows: Sequence[Row]) -> frozenset[int]:
    """The places of the newest row of each signal; the newest two of a camera's."""
    found: dict[tuple[str, str, str], list[int]] = {}
    for at, row in enumerate(rows):
        kept = found.setdefault((row["channel"], row["source"], row["path"]), [])
        del kept[: -1 if row["channel"] == FRAME else None]
        kept.append(at)
    return frozenset(at for kept in found.values() for at in kept)


def _within(rows: Iterable[tuple[int, Row]]) -> Iterable[int]:
    left = READING_BYTES
    for at, row in rows:
        left -= _size(row)
        if left < 0:
            return
        yield at


def _newest(rows: Sequence[Row], size: int) -> list[Row]:
    kept: list[Row] = []
    for row in reversed(rows):
        size -= _size(row)
        if size < 0:
            break
        kept.append(row)
    return kept[::-1]


def _size(row: Row) -> int:
    return len(json.dumps(row, ensure_ascii=False).encode("utf-8", "surrogatepass"))


def _listed(brief: Mapping[str, Any], name: str) -> list[Mapping[str, Any]]:
    value = brief.get(name)
    return [item for item in value if isinstance(item, Mapping)] if isinstance(value, list | tuple) else []


def _text(value: object) -> str:
    return escaped(value)[:TEXT_CHARACTERS] if isinstance(value, str) else ""


def plain(value: Any) -> Any:
    """A JSON value whose texts are short and hide nothing."""
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        return {_text(str(key)): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value if _is_plain(value) else None
