"""Moments are written in one form and read in every form; a length of time follows no wall clock."""

import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from zones import in_zone

from octoform.base import clock

NOON = datetime(2026, 5, 4, 12, tzinfo=UTC)


@pytest.fixture
def berlin() -> Iterator[None]:
    with in_zone("Europe/Berlin"):
        yield


def test_a_moment_is_written_in_utc_to_the_asked_digit(monkeypatch: pytest.MonkeyPatch) -> None:
    assert clock.stamp(NOON) == clock.stamp(NOON.timestamp()) == "2026-05-04T12:00:00Z"
    assert clock.stamp(NOON.astimezone(timezone(timedelta(hours=5, minutes=30)))) == "2026-05-04T12:00:00Z"
    late = NOON + timedelta(microseconds=999_999)
    assert [clock.stamp(late, digits)[19:] for digits in (0, 3, 6)] == ["Z", ".999Z", ".999999Z"]
    monkeypatch.setattr(time, "time", lambda: NOON.timestamp())
    assert clock.stamp() == "2026-05-04T12:00:00Z"


@given(st.datetimes(datetime(1900, 1, 1), datetime(9998, 1, 1), timezones=st.just(UTC)))
def test_what_is_written_is_read_again(moment: datetime) -> None:
    """Every millisecond is the one that was meant, though a float has no exact thousandths."""
    moment = moment.replace(microsecond=moment.microsecond // 1000 * 1000)
    assert clock.parse_stamp(clock.stamp(moment, 3)) == moment
    assert clock.stamp(moment, 3) == moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


@pytest.mark.parametrize(
    "text",
    [
        *("2026-05-04T12:00:00Z", "2026-05-04T12:00:00+00:00", "2026-05-04T14:00:00+02:00", "2026-05-04T12:00:00"),
        *("2026-05-04 12:00", "20260504T120000Z", "2026-05-04T12:00:00.000000Z", "2026-05-04T11:59:60Z"),
    ],
)
def test_every_form_is_one_moment(text: str) -> None:
    assert clock.parse_stamp(text) == NOON and clock.epoch(text) == NOON.timestamp()


@pytest.mark.usefixtures("berlin")
def test_a_text_without_a_zone_is_of_the_one_that_is_asked_for() -> None:
    naive = clock.parse_stamp("2026-05-04T12:00:00", zone=None)
    assert naive is not None and naive.tzinfo is None
    assert clock.epoch("2026-05-04T12:00:00", zone=None) == NOON.timestamp() - 7200, "local time"
    assert clock.epoch("2026-05-04T12:00:00") == NOON.timestamp()
    assert clock.epoch("2026-05-04T12:00:00Z", zone=None) == NOON.timestamp()


@pytest.mark.parametrize("text", [None, 20260504, "", "soon", "2026-13-01", "2026-05-04T12:00:61Z", "12:00", b"2026"])
def test_what_is_no_time_is_none(text: object) -> None:
    assert clock.parse_stamp(text) is None and clock.epoch(text) is None


@pytest.mark.parametrize("text", ["9999-12-31T23:59:59Z", "9999-12-31T23:59:59-12:00", "0001-01-01T00:00:00+12:00"])
def test_the_ends_of_the_calendar_are_read_and_harm_nobody(text: str) -> None:
    assert clock.parse_stamp(text) is not None
    assert clock.epoch(text) is not None
    assert clock.parse_stamp("9999-12-31T23:59:60Z") is None, "a leap second after the last one"


def test_a_length_is_not_that_of_the_wall_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """The wall clock jumps back and ahead; the machine sleeps for an hour, which counts."""
    ticks = {time.CLOCK_BOOTTIME: 100.0}
    monkeypatch.setattr(time, "clock_gettime", ticks.__getitem__)
    monkeypatch.setattr(time, "monotonic", lambda: 100.0)
    began = clock.boottime()
    for jump in (-86_400.0, 86_400.0):
        monkeypatch.setattr(time, "time", lambda jump=jump: NOON.timestamp() + jump)
        assert clock.boottime() - began == 0.0
    ticks[time.CLOCK_BOOTTIME] += 3600.0
    assert clock.boottime() - began == 3600.0
    monkeypatch.delattr(time, "CLOCK_BOOTTIME")
    assert clock.boottime() == 100.0, "where no clock counts sleep, the one that rises"


def test_this_start_of_the_machine_has_a_name(tmp_path: Path) -> None:
    assert clock.boot_id() == clock.boot_id() != ""
    assert clock.boot_id(tmp_path) == ""
    (tmp_path / "sys/kernel/random").mkdir(parents=True)
    (tmp_path / "sys/kernel/random/boot_id").write_text("a-b-c\n")
    assert clock.boot_id(tmp_path) == "a-b-c"
