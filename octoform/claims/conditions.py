"""What a condition says of a value, and which of two conditions is the tighter one.

Nothing is guessed: a value that could not be read, or that is of another kind than the condition's, neither fulfils a
condition nor contradicts it. Light.
"""

import math

from octoform import conditions
from octoform.claims.model import Condition, Value
from octoform.conditions import is_number

_OTHER_TEXT = "\0"
_FAR = 1e300


def holds(condition: Condition, value: Value) -> bool | None:
    """Whether the condition is fulfilled; None when this value says nothing about it."""
    return conditions.holds(condition.op, condition.value, value)


def tighter(one: Condition, other: Condition) -> bool:
    """Whether ``one`` calls everything trouble that ``other`` does, and more than that."""
    return _covers(one, other) and not _covers(other, one)


def _covers(wide: Condition, narrow: Condition) -> bool:
    points = _points(wide, narrow)
    return all(holds(wide, point) is True for point in points if holds(narrow, point) is True)


def _points(one: Condition, other: Condition) -> list[Value]:
    """Values at which the two can differ: what lies between two of them is like one of them."""
    values = [one.value, other.value]
    if any(isinstance(value, str) for value in values):
        return [*values, _OTHER_TEXT]
    numbers = sorted(float(value) for value in values if is_number(value) and value is not None)
    around = [math.nextafter(number, side) for number in numbers for side in (-math.inf, math.inf)]
    middle = [sum(numbers) / 2] if len(numbers) == 2 else []
    return [True, False, *values, *around, *middle, -_FAR, _FAR]
