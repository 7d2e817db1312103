"""How large a result is, without serialising it: one that is far too large must not cost the others their time.

The estimate walks the value and never counts more than JSON will need, so what it refuses is too large for certain, and
it stops as soon as it knows. Only a result near its bound is really serialised for its size.
"""

from collections.abc import Mapping
from typing import Any

from fastmcp.tools.base import ToolResult
from pydantic_core import to_json

ESCAPE = 8
"""How far the estimate may be below the size: a control character takes six bytes, a fraction up to 24 for three."""


def at_least(value: Any, bound: float) -> int:
    """A lower bound of the bytes of ``value`` as JSON; the walk ends once it is over ``bound``.

    One byte of every part is counted with what it is in, so that a long list is refused before it is walked.
    """
    total, rest = 1, [value]
    while rest and total <= bound:
        item = rest.pop()
        kind = type(item)
        if kind is str:
            total += len(item) + 1
        elif kind is float or kind is bool or item is None:
            total += 2
        elif kind is int:
            total += item.bit_length() // 4
        elif isinstance(item, Mapping):
            total += 4 * len(item)
            if total <= bound:
                rest.extend(item)
                rest.extend(item.values())
        elif isinstance(item, list | tuple | set | frozenset):
            total += 2 * len(item)
            if total <= bound:
                rest.extend(item)
        else:
            total += _other(item, rest)
    return total


def exceeds(value: Any, bound: int) -> int | None:
    """The size in bytes when ``value`` as JSON is larger than ``bound`` bytes, else None."""
    size = at_least(value, bound)
    if size > bound:
        return size
    if size * ESCAPE <= bound:
        return None
    size = len(to_json(value, fallback=str, serialize_unknown=True))
    return size if size > bound else None


def of_result(result: ToolResult, bound: int) -> int | None:
    """The size of a tool's result in bytes when it is over its bound, else None."""
    parts: list[Any] = [
        getattr(block, "text", None) or getattr(block, "data", None) or block for block in result.content
    ]
    if result.structured_content is not None:
        parts.append(result.structured_content)
    return exceeds(parts, bound)


def _other(item: Any, rest: list[Any]) -> int:
    """Bytes of what is no JSON itself; its parts go to ``rest``."""
    if isinstance(item, bytes | bytearray | memoryview):
        return len(item)
    if isinstance(item, str):
        return len(item) + 2
    size = getattr(item, "nbytes", None)
    if isinstance(size, int):
        return size
    if parts := getattr(item, "__dict__", None):
        rest.extend(parts.values())
    return 2
