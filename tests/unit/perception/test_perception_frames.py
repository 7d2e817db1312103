"""Two pictures at most, every absence with its reason, and a summary without what no picture shows."""

import json
import stat
from dataclasses import replace
from pathlib import Path

import pytest

from octoform.diagnostics import error
from octoform.perception.capture import Picture, Taken
from octoform.perception.frames import MAX_BYTES, Record, keep, picture_of, read, with_absence, with_picture, words
from octoform.state.layout import Layout

VIEW = {"device": "usb-1f00-00c1", "tool": "capture_image", "arguments": {"device": "usb-1f00-00c1"}}
GONE = error("PERCEPTION-TOOL-FAILED", "capture_image took no picture", detail="unplugged\x1b[31m\nsince noon")


def taken(level: int = 100, *, seed: int = 0, mime: str = "image/jpeg") -> Taken:
    """A striped picture; ``seed`` changes one pixel of it, as noise would, ``level`` all but the first rows."""
    thumb = bytes([20 + seed] + [20] * 1023) + bytes([level, 250] * 1024)
    mean = sum(thumb) / 3072
    spread = (sum((value - mean) ** 2 for value in thumb) / 3072) ** 0.5
    return Taken(b"picture %d %d" % (level, seed), mime, Picture(mean, spread, thumb, f"{level} {seed}", 0.9), 640, 480)


def black(seed: int = 0) -> Taken:
    return Taken(b"black", "image/jpeg", Picture(1.0 + seed, 0.5, bytes(3072)), 640, 480)


def at(second: int) -> str:
    return f"2026-01-01T00:00:{second:02d}Z"


def after(*outcomes: Taken | None) -> Record:
    """The record after these looks, one a second; None is one without a picture."""
    record: Record | None = None
    for second, outcome in enumerate(outcomes):
        made = with_picture(record, outcome, VIEW, at(second)) if outcome else with_absence(record, GONE, at(second))
        record = made
    assert record is not None
    return record


def test_the_first_picture_is_compared_with_nothing() -> None:
    record = after(taken())
    assert record.current is not None and record.previous is None and record.absent is None
    assert (record.current.file, record.current.at, record.current.size) == ("current.jpg", at(0), 13)
    assert (record.current.frozen, record.current.difference, record.current.problem) == (None, None, None)
    assert record.summary.changes == (f"{at(0)}: first picture through usb-1f00-00c1",)


def test_the_next_one_is_compared_with_it() -> None:
    record = after(taken(), taken(seed=1), taken(30))
    assert record.current is not None and record.previous is not None
    assert record.previous.file == "previous.jpg" and record.previous.at == at(1)
    assert record.previous.difference is not None and record.previous.difference < 1.0
    assert record.current.difference is not None and record.current.difference > 3.0
    assert record.summary.changes[1:] == (f"{at(2)}: changed by {record.current.difference:g}",)
    assert "difference to the one before" in words(record) and "changed by" in words(record)


def test_trouble_is_counted_and_told_when_it_comes_and_when_it_goes() -> None:
    record = after(taken(), black(), black(1), *[taken(seed=2)] * 6, taken(seed=3))
    summary = record.summary
    assert (summary.looks, summary.black, summary.uniform, summary.frozen, summary.absences) == (10, 2, 0, 1, 0)
    lines = [line.partition(": ")[2] for line in summary.changes[1:]]
    assert lines == ["black", "it shows something again", "frozen", "it shows something again"]


def test_one_repeat_is_suspected_and_no_trouble_and_a_new_picture_ends_it() -> None:
    record = after(taken(), taken())
    assert record.current is not None and record.current.suspected
    assert (record.current.repeats, record.current.since, record.current.frozen) == (1, at(0), None)
    assert record.current.problem is None and record.summary.frozen == 0
    last = after(taken(), taken(), taken(seed=1)).current
    assert last is not None and (last.repeats, last.frozen, last.suspected) == (0, False, False)


def test_a_record_of_before_that_knows_no_pixels_is_still_read() -> None:
    document = json.loads(after(taken()).model_dump_json())
    for name in ("pixels", "grain", "repeats", "since"):
        del document["current"][name]
    record = with_picture(Record.model_validate(document), taken(), VIEW, at(9))
    assert record.current is not None and (record.current.repeats, record.current.problem) == (0, None)


@pytest.mark.parametrize(("last", "trouble"), [(black(1), "black"), (taken(30), "frozen")])
def test_of_a_picture_that_shows_nothing_no_state_is_told(last: Taken, trouble: str) -> None:
    record = after(taken(), *[taken(30)] * 5, last)
    assert record.current is not None and record.current.problem == trouble
    found = words(record)
    assert f"it is {trouble}" in found and "physical state is unknown" in found
    assert "changed" not in found and "mean" not in found


def test_an_absence_has_its_reason_and_makes_the_last_picture_old() -> None:
    record = after(taken(), taken(30), None, None)
    assert record.current is None and record.absent is not None and record.previous is not None
    assert (record.absent.since, record.absent.last, record.absent.code) == (at(2), at(3), GONE.code)
    assert record.absent.reason == "capture_image took no picture: unplugged\\x1b[31m since noon"
    assert (record.previous.at, record.previous.file) == (at(1), "previous.jpg")
    assert (record.summary.looks, record.summary.absences) == (4, 2)


def test_while_no_picture_is_there_nothing_is_told_of_the_physical_state() -> None:
    record = after(taken(), taken(30), None)
    found = words(record)
    assert f"No picture since {at(2)} because capture_image took no picture" in found
    assert f"unknown since the picture of {at(1)}" in found
    for word in ("changed", "mean", "difference", "first picture", VIEW["device"]):
        assert str(word) not in found
    assert "unknown at any time" in words(after(None))


def test_an_absence_that_ended_stays_in_the_summary() -> None:
    record = after(taken(), None, None, taken(seed=1))
    assert record.absent is None and record.current is not None and record.current.frozen is False
    assert record.summary.changes[1].startswith(f"{at(1)} to {at(3)}: no picture because capture_image took no")


def test_pictures_of_two_views_are_not_compared() -> None:
    record = with_picture(after(taken()), taken(), {**VIEW, "device": "usb-1f00-00c2"}, at(1))
    assert record.current is not None and (record.current.frozen, record.current.difference) == (None, None)
    assert record.summary.changes[-1] == f"{at(1)}: another view, usb-1f00-00c2"


def test_the_summary_does_not_grow_however_long_it_goes_on() -> None:
    long = replace(GONE, detail="é" * 4000)
    record = after(taken())
    sizes = []
    for second in range(90):
        record = with_absence(record, long, at(second % 60)) if second % 3 else record
        record = with_picture(record, taken(30 + second % 2 * 200, seed=second % 7), VIEW, at(second % 60))
        sizes.append(len(record.model_dump_json()))
    assert max(sizes[50:]) < 16_000
    assert sum(len(line.encode()) + 1 for line in record.summary.changes) <= MAX_BYTES
    assert len(words(record).encode()) < 3072 and len(words(with_absence(record, long, at(0))).encode()) < 3072
    assert record.summary.looks == 151


def names(layout: Layout) -> list[str]:
    return sorted(path.name for path in layout.frames.iterdir())


def test_two_pictures_and_their_record_are_kept_for_the_owner_alone(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    for second in range(4):
        record, found = keep(
            layout, VIEW, taken(seed=second, mime="image/png" if second == 2 else "image/jpeg"), at(second)
        )
        assert found == [] and record is not None
    assert names(layout) == ["current.jpg", "frames.json", "previous.png"]
    assert stat.S_IMODE(layout.frames.stat().st_mode) == 0o700
    assert {stat.S_IMODE(path.stat().st_mode) for path in layout.frames.iterdir()} == {0o600}
    assert record is not None and record.current is not None and record.previous is not None
    assert read(layout) == (record, [])
    assert picture_of(layout, record.current) == b"picture 100 3"
    assert picture_of(layout, record.previous) == b"picture 100 2"
    assert json.loads((layout.frames / "frames.json").read_bytes())["current"]["complaint"] is None


def test_an_absence_leaves_no_current_picture(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    assert read(layout) == (None, [])
    keep(layout, VIEW, taken(), at(0))
    keep(layout, VIEW, GONE, at(1))
    record, found = keep(layout, VIEW, GONE, at(2))
    assert found == [] and record is not None and record.previous is not None
    assert names(layout) == ["frames.json", "previous.jpg"]
    assert picture_of(layout, record.previous) == b"picture 100 0"


def test_a_picture_that_is_not_the_one_of_the_record_is_none(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    record, _ = keep(layout, VIEW, taken(), at(0))
    assert record is not None and record.current is not None
    (layout.frames / "current.jpg").write_bytes(b"of a run that was killed before it wrote its record")
    assert picture_of(layout, record.current) is None
    (layout.frames / "current.jpg").unlink()
    (layout.frames / ".current.jpg.abc.octoform-tmp").write_bytes(b"half")
    record, found = keep(layout, VIEW, taken(30), at(1))
    assert found == [] and record is not None and record.previous is not None
    assert picture_of(layout, record.previous) is None
    assert names(layout) == ["current.jpg", "frames.json"]


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"format": 2, "summary": {"since": "x"}}', "\0"])
def test_a_damaged_record_is_begun_anew_and_that_is_told(tmp_path: Path, text: str) -> None:
    layout = Layout(tmp_path, "bench")
    keep(layout, VIEW, taken(), at(0))
    (layout.frames / "frames.json").write_text(text)
    record, found = keep(layout, VIEW, taken(30), at(1))
    assert [(item.code, item.severity.value) for item in found] == [("PERCEPTION-FRAMES", "warning")]
    assert record is not None and record.summary.looks == 1
    assert names(layout) == ["current.jpg", "frames.json"]


def test_no_picture_is_written_through_a_link(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    layout.local.mkdir(parents=True)
    layout.frames.symlink_to(elsewhere)
    record, found = keep(layout, VIEW, taken(), at(0))
    assert record is None and [item.code for item in found] == ["PERCEPTION-FRAMES"]
    assert list(elsewhere.iterdir()) == []
