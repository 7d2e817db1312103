"""Both logs as lines in one order, over everything that happens to files that somebody else writes."""

import json
import os
from pathlib import Path

import pytest

from octoform.base.clock import stamp
from octoform.endpoint.logs import CALLS, SERVER, TAIL_BYTES, Line, Tail, logs_of
from octoform.engine.inspect.state import PATIENCE_SECONDS, Pairing
from octoform.state.layout import Layout

KEY = [
    "-----BEGIN PRIVATE KEY-----",
    "TUlJQ1hRSUJBQUtCZ1FDOA==",
    "TUlJQ1hRSUJBQUtCZ1FDOB==",
    "-----END PRIVATE KEY-----",
]


def texts(tail: Tail) -> list[str]:
    return [line.text for line in tail.read()]


def add(path: Path, text: str) -> None:
    with path.open("a") as file:
        file.write(text)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "server.log"


def test_a_log_that_is_not_there_yet_is_read_once_it_is(path: Path) -> None:
    tail = Tail(path, SERVER)
    assert texts(tail) == []
    add(path, "one\n")
    assert texts(tail) == ["one"]
    assert texts(tail) == []


def test_a_line_counts_when_it_is_whole(path: Path) -> None:
    tail = Tail(path, SERVER)
    add(path, "one\ntw")
    assert texts(tail) == ["one"]
    add(path, "o\n\nthree")
    assert texts(tail) == ["two"]


def test_a_log_that_is_cut_is_read_from_its_start(path: Path) -> None:
    tail = Tail(path, SERVER)
    add(path, "one\ntwo and a rest")
    assert texts(tail) == ["one"]
    path.write_text("new\n")
    assert texts(tail) == ["two and a rest", "new"]


def test_a_log_that_is_moved_away_is_read_to_its_end_and_then_the_new_one(path: Path) -> None:
    tail = Tail(path, SERVER)
    add(path, "one\n")
    assert texts(tail) == ["one"]
    moved = path.with_name("server.log.1")
    path.rename(moved)
    add(moved, "two\n")
    assert texts(tail) == ["two"], "its writer still has it open"
    add(moved, "three\n")
    add(path, "four\n")
    assert texts(tail) == ["three", "four"]


def test_of_a_long_log_the_end_is_read_and_no_half_line(path: Path) -> None:
    line = "x" * 99 + "\n"
    path.write_text(line * (TAIL_BYTES // 100 + 1000))
    found = texts(Tail(path, SERVER))
    assert 0 < len(found) <= TAIL_BYTES // 100
    assert set(found) == {line[:-1]}


def test_secrets_are_taken_out_also_where_they_are_cut(path: Path) -> None:
    tail = Tail(path, SERVER, {"token reader": "octoform_s3cr3tvalue"})
    add(path, f"before\nsays octoform_s3cr3tvalue\n{KEY[0]}\n{KEY[1]}\nAuthorization: Bear")
    seen = texts(tail)
    add(path, f"er abcdefgh12345678\n{KEY[2]}\n{KEY[3]}\nafter\n")
    seen += texts(tail)
    text = "\n".join(seen)
    assert seen[0] == "before" and seen[-1] == "after"
    assert "[token reader redacted]" in text
    for secret in ("s3cr3tvalue", KEY[1], KEY[2], "abcdefgh12345678"):
        assert secret not in text


def test_values_of_tokens_are_taken_out(layout: Layout) -> None:
    folder = layout.run / "tokens"
    folder.mkdir(parents=True)
    (folder / "default").write_text("octoform_s3cr3tvalue\n")
    layout.logs.mkdir(parents=True)
    layout.server_log.write_text("GET /mcp octoform_s3cr3tvalue\n")
    assert [line.text for line in logs_of(layout).read()] == ["GET /mcp [token default redacted]"]


def test_both_logs_stand_in_the_order_of_their_times(layout: Layout) -> None:
    layout.logs.mkdir(parents=True)
    calls = [{"event": "call", "id": "1", "time": f"2026-01-01T00:00:0{second}.500Z", "tool": "a"} for second in (1, 3)]
    layout.call_log.write_text("".join(json.dumps(call) + "\n" for call in calls) + '{"event": "cal\n')
    layout.server_log.write_text("2026-01-01T00:00:02Z second\n  its second line\n[2026-01-01 00:00:09,5+00:00] last\n")
    lines = logs_of(layout).read()
    assert [(line.log, stamp(line.at, 1)[17:21]) for line in lines] == [
        (CALLS, "01.5"),
        (SERVER, "02.0"),
        (SERVER, "02.0"),
        (CALLS, "03.5"),
        (CALLS, "03.5"),
        (SERVER, "09.5"),
    ]
    assert lines[4].record is None, "a line that is no object stays what it is"


def test_what_says_nothing_of_its_time_was_written_when_the_log_was(path: Path) -> None:
    path.write_text("hello\n")
    os.utime(path, (1000, 1000))
    assert [line.at for line in Tail(path, SERVER).read()] == [1000]


def call(number: int, event: str, **more: object) -> Line:
    return Line(float(number), CALLS, "", {"event": event, "id": f"c{number % 10}", "tool": f"t{number % 10}", **more})


def test_a_call_and_its_result_are_one_entry_and_a_long_one_is_told_of_once() -> None:
    now = [0.0]
    pairing = Pairing(lambda: now[0])
    (printed,) = pairing.take([call(1, "call"), call(2, "call"), Line(2.0, SERVER, "hello")])
    assert printed.call is None
    assert list(pairing.waiting(PATIENCE_SECONDS)) == []
    (done,) = pairing.take([call(11, "result", ok=True)])
    assert done.call is not None and done.call["event"] == "call" and done.ended
    now[0] = PATIENCE_SECONDS
    (late,) = pairing.waiting(PATIENCE_SECONDS)
    assert late.call is not None and late.call["tool"] == "t2" and not late.ended
    assert list(pairing.waiting(PATIENCE_SECONDS)) == []
    (done,) = pairing.take([call(12, "result", ok=False)])
    assert done.ended and done.call is not None and done.call["event"] == "call"
    (alone,) = pairing.take([call(13, "result", ok=True)])
    assert alone.call is not None, "its beginning lies further back than the log was read"
