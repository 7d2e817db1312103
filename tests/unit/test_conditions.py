"""Conditions on values."""

import math

import pytest

from octoform.conditions import holds


@pytest.mark.parametrize(
    ("op", "wanted", "value", "answer"),
    [
        (">", 1, 2, True),
        (">=", 2, 2.0, True),
        ("<", 1, 2, False),
        ("<=", 2, 2, True),
        ("==", "a", "a", True),
        ("==", 1, 1.0, True),
        ("!=", True, False, True),
        (">", 0, True, None),
        ("==", 1, True, None),
        (">", "a", 1, None),
        (">", "a", "b", None),
        (">", 1, None, None),
        ("==", None, None, None),
        (">", 1, math.nan, None),
        ("==", math.inf, math.inf, None),
        ("==", [1], [1], None),
        ("~", 1, 1, None),
    ],
)
def test_nothing_is_guessed(op: str, wanted: object, value: object, answer: bool | None) -> None:
    assert holds(op, wanted, value) is answer
