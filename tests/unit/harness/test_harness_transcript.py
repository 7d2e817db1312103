"""A transcript that was written can be read, and one that somebody else wrote does no harm."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.harness.port import (
    AgentEvent,
    Closed,
    ExitReason,
    ModelProblem,
    Output,
    TaskLimits,
    ToolCalled,
    ToolReturned,
    Totals,
    Turn,
    Usage,
)
from octoform.harness.transcript import Moment, decode, encode, read, used, with_text
from octoform.harness.watcher import Watcher

EVENTS: list[AgentEvent] = [
    Output("a line"),
    ToolCalled("bash", "echo 'ä' | cat"),
    ToolReturned(True),
    ToolReturned(),
    Turn(Usage(1, 2, 3, 0.5, "manifest")),
    Turn(),
    Totals(Usage(10, None, 4)),
    ModelProblem(ExitReason.RATE_LIMIT, "429"),
    ModelProblem(ExitReason.AUTH, "401", final=True),
    Closed(False, "gave up"),
]


class Fixed:
    """A dialect that gives one event for each line."""

    def __init__(self) -> None:
        self._left = list(EVENTS)

    def read(self, stream: str, line: bytes) -> list[AgentEvent]:
        return [self._left.pop(0)] if line else []


def test_what_the_watcher_writes_is_read_again(tmp_path: Path) -> None:
    times = iter(range(1000))
    watcher = Watcher(Fixed(), TaskLimits(60.0), lambda *_: None, clock=lambda: float(next(times)))
    watcher.recording(tmp_path / "transcript.jsonl")
    watcher.feed("stdout", b"x\n" * len(EVENTS))
    watcher.finish()
    found = read(tmp_path / "transcript.jsonl")
    assert [item.event for item in found] == EVENTS
    assert [item.at for item in found] == sorted(item.at for item in found)
    assert encode(found) == (tmp_path / "transcript.jsonl").read_bytes()


@pytest.mark.parametrize(
    "line",
    [b"", b"{", b"[]", b"{}", b'{"event": 3}', b'{"event": "dance"}', b"\xff\xfe", b"{" * 5000, b'{"event": null}'],
)
def test_what_is_no_event_is_passed_over(line: bytes) -> None:
    assert decode(line + b'\n{"event": "said", "text": "x", "at": "late"}\n') == [Moment(0.0, Output("x"))]


def test_values_of_the_wrong_kind_are_none() -> None:
    line = b'{"at": -1, "event": "turn", "usage": {"input_tokens": "many", "output_tokens": true, "cost_usd": 1e99}}'
    assert decode(line) == [Moment(0.0, Turn(Usage()))]
    assert decode(b'{"event": "trouble", "reason": "weather", "text": 4}') == [
        Moment(0.0, ModelProblem(ExitReason.CRASHED, ""))
    ]


@given(st.binary(max_size=300))
def test_any_bytes_are_read(data: bytes) -> None:
    decode(data)


def test_no_file_is_no_event(tmp_path: Path) -> None:
    assert read(tmp_path / "gone") == []
    (tmp_path / "link").symlink_to(tmp_path)
    assert read(tmp_path / "link") == []


def test_only_what_has_words_gets_others() -> None:
    assert with_text(Closed(True, "x"), "y") == Closed(True, "y")
    assert with_text(ToolReturned(True), "y") == ToolReturned(True)


def test_what_was_used_so_far_is_what_the_watcher_counts() -> None:
    assert used([Moment(0.0, Output("a line"))]) == (None, Usage())
    replies = [Moment(float(at), Turn(Usage(10, None, at))) for at in range(3)]
    assert used(replies) == (3, Usage(30, None, 3))
    assert used([*replies, Moment(3.0, Totals(Usage(31, 5, 4)))]) == (3, Usage(31, 5, 4))


class Pieces:
    """A dialect whose words come in pieces, spelt as their program likes; an empty line ends them."""

    def __init__(self) -> None:
        self._held = ""

    def read(self, stream: str, line: bytes) -> list[AgentEvent]:
        if line:
            self._held += json.loads(line)
            return []
        text, self._held = self._held, ""
        return [Output(text), ToolCalled("bash", text), ModelProblem(ExitReason.AUTH, text), Closed(False, text)]


KEY = "loop-7f3c19d2a4"
SPELT = {
    "whole": [json.dumps(KEY)],
    "in pieces": [json.dumps(KEY[:7]), json.dumps(KEY[7:])],
    "letter by letter": ['"' + "".join(f"\\u{ord(sign):04x}" for sign in KEY) + '"'],
}


@pytest.mark.parametrize("spelling", SPELT)
def test_a_key_that_only_a_dialect_sees_whole_reaches_no_transcript(tmp_path: Path, spelling: str) -> None:
    lines: list[str] = []
    watcher = Watcher(Pieces(), TaskLimits(60.0), lambda event, *_: lines.append(str(event)))
    watcher.recording(tmp_path / "transcript.jsonl", {"LOOP_KEY": KEY})
    watcher.feed("stdout", "".join(f"{line}\n" for line in (*SPELT[spelling], "")).encode())
    watcher.finish()
    written = (tmp_path / "transcript.jsonl").read_text()
    assert KEY not in written + "".join(lines)
    assert written.count("[LOOP_KEY redacted]") == 4
