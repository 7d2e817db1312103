"""The journal: what is cut is ignored, what is altered is refused, and nothing in between is possible."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.diagnostics import Diagnostic, Severity
from octoform.state.store.journal import Journal, Op, Reading, Record, decode, encode, read

texts = st.text(st.characters(codec="utf-8"), max_size=30)
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=8,
)
records = st.builds(
    Record, n=st.integers(1, 9), time=texts, op=st.sampled_from(Op), run=texts, node=texts,
    data=st.dictionaries(texts, values, max_size=3),
)  # fmt: skip


def write(path: Path, count: int) -> list[Record]:
    journal = Journal(path, Reading())
    written = [Record(n, "2030-01-01T00:00:00Z", Op.BEGIN, "r", f"node{n}", {"é": n}) for n in range(1, count + 1)]
    for record in written:
        assert journal.append(record) is None
    return written


@given(records)
def test_a_record_is_read_as_it_was_written(record: Record) -> None:
    line = encode(record)
    assert line.count(b"\n") == 1
    assert decode(line[:-1]) == record


@given(records, st.data())
def test_an_altered_line_is_no_record(record: Record, data: st.DataObject) -> None:
    line = bytearray(encode(record)[:-1])
    at = data.draw(st.integers(0, len(line) - 1))
    line[at] ^= 1 << data.draw(st.integers(0, 7))
    found = decode(bytes(line))
    assert found is None or found == record  # a flipped bit in the spelling of the same value


def test_an_absent_journal_is_an_empty_one(tmp_path: Path) -> None:
    assert read(tmp_path / "journal.jsonl") == (Reading(), [])


def test_cut_at_every_byte_only_whole_lines_count(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    written = write(path, 3)
    data = path.read_bytes()
    for length in range(len(data) + 1):
        path.write_bytes(data[:length])
        reading, found = read(path)
        assert reading is not None
        whole = data[:length].count(b"\n")
        assert list(reading.records) == written[:whole]
        assert reading.torn is (not data[:length].endswith(b"\n") and length > 0)
        assert [item.code for item in found] == (["STATE-JOURNAL-TORN"] if reading.torn else [])
        where = f"line {len(reading.records) + 1} of the journal"
        assert all(item.summary.startswith(where) for item in found)
        assert all(item.severity is Severity.WARNING for item in found)


def test_the_next_append_cuts_a_torn_line_off(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    write(path, 2)
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"n":3,"half')
    reading, _ = read(path)
    assert reading is not None
    record = Record(3, "t", Op.SUCCESS, "r", "x", {})
    assert Journal(path, reading).append(record) is None
    assert path.read_bytes() == whole + encode(record)


@pytest.mark.parametrize("line", [1, 2, 3])
@pytest.mark.parametrize("damage", [b"garbage", b"", b"\xff\xfe", b"{}", b"null", b"[" * 100_000])
def test_a_bad_line_is_refused_by_number(tmp_path: Path, line: int, damage: bytes) -> None:
    path = tmp_path / "journal.jsonl"
    write(path, 3)
    lines = path.read_bytes().split(b"\n")
    lines[line - 1] = damage
    path.write_bytes(b"\n".join(lines))
    reading, found = read(path)
    assert reading is None
    assert [item.code for item in found] == ["STATE-JOURNAL-CORRUPT"]
    assert f"line {line} of 3" in found[0].summary
    assert f"lines 1 to {line - 1} are whole" in (found[0].detail or "")


def test_a_line_that_is_missing_or_doubled_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    write(path, 3)
    first, second, third = path.read_bytes().splitlines(keepends=True)
    for lines, at in (([first, third], 2), ([first, first, second], 2), ([second, third], 1)):
        path.write_bytes(b"".join(lines))
        reading, found = read(path)
        assert reading is None and f"line {at} " in found[0].summary


def test_a_refused_append_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    write(path, 2)
    before = path.read_bytes()
    reading, _ = read(path)
    assert reading is not None

    def full(name: str) -> None:
        if name.endswith(".written"):
            raise OSError(28, os.strerror(28))

    problem = Journal(path, reading, full).append(Record(3, "t", Op.BEGIN, "r", "x", {}))
    assert problem is not None and problem.code == "STATE-DISK-FULL"
    assert path.read_bytes() == before


def test_a_journal_that_is_a_link_is_neither_read_nor_written(tmp_path: Path) -> None:
    target = tmp_path / "foreign"
    target.write_text("precious")
    path = tmp_path / "journal.jsonl"
    path.symlink_to(target)
    reading, found = read(path)
    assert reading is None and found[0].code == "STATE-LINK"
    assert Journal(path, Reading()).append(Record(1, "t", Op.BEGIN, "r", "x", {})) is not None
    assert target.read_text() == "precious"


@pytest.mark.parametrize("gone", [Journal.clear, lambda journal: journal.set_aside(Path("/proc/aside"))])
def test_records_that_cannot_be_dropped_are_told_and_stay(
    tmp_path: Path, gone: Callable[[Journal], Diagnostic | None]
) -> None:
    path = tmp_path / "journal.jsonl"
    journal = Journal(path, Reading())
    assert gone(journal) is None, "there is nothing to drop"
    path.mkdir()
    found = gone(journal)
    assert found is not None and found.severity is Severity.ERROR and str(path) in f"{found.path} {found.summary}"
    assert path.is_dir()
