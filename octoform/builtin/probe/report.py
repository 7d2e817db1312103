"""Reads what tools report as objects whose members may be missing, empty or of another type than expected."""

from collections.abc import Iterator
from typing import Any

Entry = dict[str, Any]
_NOTHING = frozenset(("", "not provided", "unknown", "n/a", "none"))


def number(entry: Entry, *keys: str) -> int | None:
    """The first whole number under one of the keys."""
    for key in keys:
        value = entry.get(key)
        if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 64:
            return value
    return None


def said(entry: Entry, *keys: str) -> str:
    """The first text (or number, as text) under one of the keys; empty where the system has nothing to say."""
    for key in keys:
        value = entry.get(key)
        if isinstance(value, str) and value.strip().lower() not in _NOTHING:
            return value.strip()
        if isinstance(value, int | float) and not isinstance(value, bool):
            return str(value)
    return ""


def dicts(value: Any) -> Iterator[Entry]:
    """The objects in a list; none where there is no list."""
    yield from (item for item in value if isinstance(item, dict)) if isinstance(value, list) else ()
