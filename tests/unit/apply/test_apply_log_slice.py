"""The logs as an agent of the daemon gets them: bounded, errors kept, and nothing in them that acts."""

import json
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from octoform.apply.duty import ERROR_BYTES, LOG_BYTES, is_problem, slice_of, sliced
from octoform.base.escaping import is_hidden
from octoform.diagnostics import Diagnostic, warning
from octoform.endpoint.logs import CALLS, SERVER, Line
from octoform.harness.llm.completion import Condensed
from octoform.harness.port import Usage
from octoform.state.layout import Layout


class Model:
    """A housekeeping model; what it is shown is kept."""

    def __init__(self, answer: Condensed | Diagnostic) -> None:
        self.answer, self.shown = answer, ""

    def complete(self, text: str, instruction: str) -> Condensed | Diagnostic:
        self.shown = text
        return self.answer


def result(number: int, *, ok: bool, error: str = "OSError") -> Line:
    record = {"event": "result", "id": f"{number:016x}", "tool": "read", "ok": ok}
    record |= {} if ok else {"error": error, "message": f"no answer after {number} ms"}
    return Line(float(number), CALLS, json.dumps(record), record)


def test_errors_come_first_each_once_and_the_newest_lines_after_them() -> None:
    lines = [result(number, ok=number % 100 != 7) for number in range(20_000)]
    lines.append(Line(20_001.0, SERVER, "ValueError: the one that is different"))
    text = sliced(lines, {}).text
    assert len(text.encode()) <= LOG_BYTES
    assert "(200 times)" in text and "no answer after 19907 ms" in text and "the one that is different" in text
    assert text.index("the one that is different") < text.index("# newest lines")
    assert f'"{19_999:016x}"' in text and f'"{5:016x}"' not in text
    assert "older ones are omitted" in text


def test_without_a_model_or_with_one_that_fails_the_slice_is_bounded_all_the_same() -> None:
    lines = [result(number, ok=True) for number in range(5000)] + [result(9000, ok=False, error="KeyError")]
    failed = Model(warning("HOUSEKEEPING-FAILED", "the model cannot be reached"))
    for found in (sliced(lines, {}), sliced(lines, {}, failed)):
        assert found.raw is None and "KeyError" in found.text and len(found.text.encode()) <= LOG_BYTES
    assert sliced(lines, {}, failed).reason == "the model cannot be reached"


def test_a_summary_takes_no_errors_place_and_what_it_sums_up_is_kept() -> None:
    lines = [result(number, ok=number != 17) for number in range(3000)]
    model = Model(Condensed("3000 reads, one failed\x1b[31m", Usage(10, 0, 5)))
    found = sliced(lines, {}, model)
    assert "OSError" in found.text and "OSError" not in model.shown
    assert "3000 reads, one failed\\x1b[31m" in found.text and found.usage.input_tokens == 10
    assert found.raw is not None and len(found.raw.splitlines()) == 2999
    assert len(found.text.encode()) <= LOG_BYTES


def test_a_short_log_asks_no_model() -> None:
    model = Model(Condensed("never"))
    assert "never" not in sliced([result(1, ok=True)], {}, model).text and model.shown == ""


@given(st.lists(st.text(max_size=60) | st.just("Error: " + "x" * 5000), max_size=80))
def test_whatever_stands_in_it_the_slice_is_bounded_and_plain(texts: list[str]) -> None:
    text = sliced([Line(float(at), SERVER, text) for at, text in enumerate(texts)], {}).text
    assert len(text.encode()) <= LOG_BYTES
    assert not any(is_hidden(character) for character in text if character not in "\n\t")


def test_many_different_errors_leave_room_for_what_is_new() -> None:
    lines = [Line(float(at), SERVER, f"Error in {chr(97 + at % 26) * (at % 50 + 1)}") for at in range(3000)]
    text = sliced([*lines, result(5000, ok=True)], {}).text
    assert f'"{5000:016x}"' in text and len(text[: text.index("# newest")].encode()) <= ERROR_BYTES + 200


def test_secrets_bytes_and_what_was_before_are_not_told(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    layout.logs.mkdir(parents=True)
    old = {"event": "result", "id": "1", "time": "2026-11-01T00:00:00Z", "tool": "old_tool", "ok": False}
    new = {"event": "result", "id": "2", "time": "2026-11-22T00:00:00Z", "tool": "new_tool", "ok": False}
    layout.call_log.write_text(f"{json.dumps(old)}\n{json.dumps(new)}\n")
    with layout.call_log.open("ab") as log:
        log.write(b'{"event": "result", "ok": false, "message": "raw \xff\xfe s3cret-value"}\n')
    text = slice_of(layout, 1_795_000_000.0, {"KEY": "s3cret-value"}).text
    assert "new_tool" in text and "old_tool" not in text and "s3cret-value" not in text and "raw" in text
    assert slice_of(Layout(tmp_path, "nothing"), 0.0, {}).text == ""


def test_lines_of_a_clock_that_was_ahead_take_no_room_from_what_came_after(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    layout.logs.mkdir(parents=True)
    ahead = {"event": "result", "id": "1", "time": "2999-01-01T00:00:00Z", "tool": "early", "ok": True}
    failed = {"event": "result", "id": "2", "time": "2026-11-22T00:00:00Z", "tool": "weigh", "ok": False}
    layout.call_log.write_text(f"{json.dumps(ahead)}\n" * 5000 + f"{json.dumps(failed)}\n")
    text = slice_of(layout, 1_795_000_000.0, {}).text
    assert "weigh" in text and "early" in text, "neither hides the other"


def test_what_is_trouble() -> None:
    assert is_problem(result(1, ok=False)) and not is_problem(result(1, ok=True))
    fields = {"event": "result", "ok": True, "value": "error: none"}
    assert not is_problem(Line(0.0, CALLS, json.dumps(fields), fields)), "a tool may read the word"
    assert is_problem(Line(0.0, SERVER, "Traceback (most recent call last):"))
    assert not is_problem(Line(0.0, SERVER, "listening"))
