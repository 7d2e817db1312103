"""Conditions: whether a value fulfils one, and whether any could refute it; for contracts and claims alike.

Nothing is guessed: absence, another kind of value or a number that is none states nothing either way. Truth values are
no numbers here: a switch that reads true has not risen above 0.
"""

import math
from collections.abc import Callable
from operator import eq, ge, gt, le, lt, ne
from typing import Any

_ORDER: dict[str, Callable[[Any, Any], bool]] = {">=": ge, ">": gt, "<=": le, "<": lt}
_TESTS: dict[str, Callable[[Any, Any], bool]] = {**_ORDER, "==": eq, "!=": ne}
OPERATORS = tuple(_TESTS)


def is_number(value: object) -> bool:
    """Whether it is a finite number; True and False are none."""
    return (isinstance(value, int) and not isinstance(value, bool)) or (
        isinstance(value, float) and math.isfinite(value)
    )


def holds(op: str, wanted: object, value: object) -> bool | None:
    """Whether ``value`` is ``op wanted``; None where the two cannot be compared (absence, another kind, no order)."""
    if op not in _TESTS or value is None or wanted is None or _kind(value) != _kind(wanted):
        return None
    if _kind(value) == "other" or (op in _ORDER and _kind(value) != "number"):
        return None
    return _TESTS[op](value, wanted)


def untestable(op: str, wanted: object) -> str | None:
    """Why no reading would ever refute the condition; None when one can."""
    if op in _ORDER and not is_number(wanted):
        return f"{op} compares numbers"
    if op == "!=" and is_number(wanted):
        return "nearly every number is different from another one"
    return None


def _kind(value: object) -> str:
    if isinstance(value, bool):
        return "switch"
    if isinstance(value, str):
        return "text"
    return "number" if is_number(value) else "other"
