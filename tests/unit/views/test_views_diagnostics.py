"""Diagnostics as text: the caret points at the place whatever the line holds."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.diagnostics import Diagnostic, Severity, Span, error, warning
from octoform.views.format.problems import render, summary


def test_whole_form_without_colour() -> None:
    item = error(
        "MANIFEST-UNKNOWN-KEY",
        "unknown key `hots`",
        path="octopus.yaml",
        span=Span(12, 3, 7),
        source="  hots: bench",
        detail="first\nsecond",
        hint="did you mean `host`?",
    )
    assert render(item, colour=False) == (
        "error[MANIFEST-UNKNOWN-KEY]: unknown key `hots`\n"
        "  --> octopus.yaml:12:3\n"
        "   |\n"
        "12 |   hots: bench\n"
        "   |   ^^^^\n"
        "     first\n"
        "     second\n"
        "   help: did you mean `host`?"
    )


def test_artifact_form_has_the_pointer() -> None:
    item = warning("PROBE-X", "odd", path="probe/output.json", pointer="/devices/3/id")
    assert render(item, colour=False) == "warning[PROBE-X]: odd\n --> probe/output.json#/devices/3/id"


def test_least_form_is_one_line() -> None:
    assert (
        render(error("STATE-LOCKED", "the state is locked"), colour=False) == "error[STATE-LOCKED]: the state is locked"
    )


def test_colour_changes_nothing_but_colour() -> None:
    item = error("A-B", "c", path="f", span=Span(1, 2), source="abc", hint="d")
    coloured = render(item, colour=True)
    assert "\x1b[1;31m" in coloured
    for code in ("0", "1", "1;31", "1;34", "36"):
        coloured = coloured.replace(f"\x1b[{code}m", "")
    assert coloured == render(item, colour=False)


@pytest.mark.parametrize(
    ("source", "span", "shown", "carets"),
    [
        ("\tb: 2", Span(1, 1, 2), "    b: 2", "^^^^"),
        ("\tb: 2", Span(1, 2, 3), "    b: 2", "    ^"),
        ("名前: x", Span(1, 5, 6), "名前: x", "      ^"),
        ("e\u0301: x", Span(1, 5, 6), "e\u0301: x", "   ^"),
        ("a\x1b[2J: x", Span(1, 7, 8), "a\\x1b[2J: x", "         ^"),
        ("abc", Span(1, 4), "abc", "   ^"),
        ("abc", Span(1, 90, 95), "abc", "   ^"),
        ("", Span(1, 1), "", "^"),
        ("abc", Span(1, 2, 2), "abc", " ^"),
    ],
)
def test_caret_stands_under_the_place(source: str, span: Span, shown: str, carets: str) -> None:
    lines = render(error("A-B", "c", span=span, source=source), colour=False).splitlines()
    assert lines[3] == f"1 | {shown}".rstrip()
    assert lines[4] == f"  | {carets}"


@pytest.mark.parametrize("column", [1, 50, 300, 599, 600])
def test_long_line_is_cut_around_the_place(column: int) -> None:
    source = "".join(chr(ord("a") + index % 26) for index in range(600))
    lines = render(
        error("A-B", "c", span=Span(1, column, column + 1), source=source), colour=False, width=80
    ).splitlines()
    assert max(map(len, lines)) <= 80
    place = lines[4].index("^")
    assert lines[3][place] == source[column - 1]


def test_nothing_of_a_device_reaches_the_terminal_raw() -> None:
    item = error("A-B", "x\x1b[2J\ny", path="a\x07b", detail="\x1b]0;t\x07", hint="\u202eh")
    text = render(item, colour=False)
    assert not any(unicodedata.category(char) in ("Cc", "Cf") for char in text.replace("\n", ""))
    assert text.splitlines()[0] == "error[A-B]: x\\x1b[2J y"


def test_all_are_counted() -> None:
    assert summary([error("B", "late"), warning("A", "early"), error("C", "nowhere")]) == "2 errors, 1 warning"
    assert summary([error("A", "b")]) == "1 error"


@given(
    source=st.text(max_size=300),
    column=st.integers(1, 400),
    length=st.integers(0, 50),
    width=st.integers(1, 200),
)
def test_any_line_and_place_can_be_shown(source: str, column: int, length: int, width: int) -> None:
    item = Diagnostic(Severity.ERROR, "A", "b", span=Span(3, column, column + length), source=source)
    lines = render(item, colour=False, width=width).split("\n")
    assert len(lines) == 5
    assert set(lines[4][4:]) <= {" ", "^"}
    assert lines[4].endswith("^")
