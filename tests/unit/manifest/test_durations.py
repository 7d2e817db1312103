"""Times as people write them: durations, rates, hours of the day."""

import pytest

from octoform.base.durations import hours, rate, seconds


@pytest.mark.parametrize(
    ("text", "length"),
    [
        ("200s", 200),
        ("5m", 300),
        ("1h30m", 5400),
        ("1h1m1s", 3661),
        ("0s", 0),
        ("", None),
        ("5", None),
        ("1m1h", None),
        ("1.5h", 5400),
        ("1.5m", 90),
        ("0.5s", 0.5),
        ("1m0.25s", 60.25),
        ("500ms", 0.5),
        ("1s5ms", 1.005),
        ("5ms", 0.005),
        ("1.m", None),
        (".5s", None),
        ("1e3s", None),
        ("5ms1s", None),
        (" 5s", None),
        ("5s\n", None),
        ("٣s", None),
    ],
)
def test_durations(text: str, length: float | None) -> None:
    assert seconds(text) == length


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("10/1m", (10, 60)),
        ("1/24h", (1, 86400)),
        ("999999/1h30m", (999999, 5400)),
        ("0/1m", None),
        ("10/0s", None),
        ("10/25h", None),
        ("10/x", None),
        ("10/", None),
        ("/1m", None),
        ("10", None),
        ("-1/1m", None),
        ("1.5/1m", None),
        ("10/1m\n", None),
        ("٣/1m", None),
    ],
)
def test_rates(text: str, meaning: tuple[int, int] | None) -> None:
    assert rate(text) == meaning


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("22:00-07:00", ("22:00", "07:00")),
        ("00:00-23:59", ("00:00", "23:59")),
        ("07:00-07:00", None),
        ("24:00-07:00", None),
        ("22:60-07:00", None),
        ("7:00-8:00", None),
        ("22:00", None),
        ("22:00 - 07:00", None),
        ("22:00-07:00\n", None),
        ("", None),
    ],
)
def test_hours(text: str, meaning: tuple[str, str] | None) -> None:
    assert hours(text) == meaning
