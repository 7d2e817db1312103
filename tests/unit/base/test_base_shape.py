"""A record is used only where every part of it has the form that its readers stand on."""

from typing import Any

import pytest

from octoform.base.shape import fits

RECORD = {"format": int, "files": {str: str}, "tools": [str], "previous": (str, None), "at": float}
WHOLE: dict[str, Any] = {"format": 1, "files": {"a": "b"}, "tools": ["read"], "previous": None, "at": 1, "more": []}


def test_a_whole_record_fits() -> None:
    assert fits(WHOLE, RECORD)
    assert fits({name: each for name, each in WHOLE.items() if name != "previous"}, RECORD)


@pytest.mark.parametrize(
    "part",
    [
        {"format": True},
        {"format": "1"},
        {"files": {"a": 1}},
        {"files": []},
        {"tools": "read"},
        {"tools": [1]},
        {"previous": 5},
        {"at": None},
    ],
)
def test_a_part_of_another_type_does_not(part: dict[str, Any]) -> None:
    assert not fits(WHOLE | part, RECORD)


@pytest.mark.parametrize("value", [None, [], "x", 5])
def test_neither_does_something_else(value: Any) -> None:
    assert not fits(value, RECORD)
