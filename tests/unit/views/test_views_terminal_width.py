"""Problems and pages on a terminal: as wide as it is, whatever the other stream leads to."""

import fcntl
import io
import os
import pty
import struct
import termios
from collections.abc import Iterator

import pytest

from octoform.diagnostics import Diagnostic, Severity, Span, codes, page_of
from octoform.views.format.console import Console, broken
from octoform.views.format.output import page
from octoform.views.format.problems import show

COLUMNS = 80


@pytest.fixture
def console(monkeypatch: pytest.MonkeyPatch) -> Iterator[Console]:
    monkeypatch.delenv("COLUMNS", raising=False)
    leader, follower = pty.openpty()
    fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", 24, COLUMNS, 0, 0))
    attributes = termios.tcgetattr(follower)
    attributes[1] &= ~termios.OPOST
    termios.tcsetattr(follower, termios.TCSANOW, attributes)
    with os.fdopen(follower, "w", encoding="utf-8") as err:
        yield Console(io.StringIO(), err, False, False, False)
    os.close(leader)


def test_a_problem_is_as_wide_as_its_terminal_where_output_is_piped(
    console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    monkeypatch.setattr(console.err, "write", said.append)
    source = "harness: claude-code     # or another one " + "of the very many " * 5
    problem = Diagnostic(
        Severity.WARNING, "X-CODE", "word " * 30, path="octopus.yaml", span=Span(2, 10, 21), source=source
    )
    show(console, [problem])
    lines = "".join(said).splitlines()
    assert max(map(len, lines)) <= COLUMNS, lines
    assert [line for line in lines if line.startswith("2 | harness: claude-code") and line.endswith("...")]
    assert console.width == 160


class Terminal(io.StringIO):
    """A terminal of 70 columns."""

    def isatty(self) -> bool:
        return True


def test_a_page_is_as_wide_as_its_terminal_and_as_it_is_written_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "70")
    for code in codes():
        text = page_of(code)
        assert text is not None
        terminal, pipe = Terminal(), io.StringIO()
        for out in (terminal, pipe):
            assert page(Console(out, io.StringIO(), False, False, False), code, text, as_json=False) == 0
        shown = terminal.getvalue()
        assert pipe.getvalue() == text and shown.split() == text.split() and shown.endswith("\n")
        assert shown.split("```")[1::2] == text.split("```")[1::2]
        prose = [line for part in shown.split("```")[::2] for line in part.splitlines()]
        assert [line for line in prose if len(line) > 70 and " " in line.strip()] == [], code


def test_a_line_of_help_continues_below_its_beginning() -> None:
    row = "  answer         answer the question about a device; without DEVICE, list the open questions"
    assert broken(row, 60).splitlines() == [
        "  answer         answer the question about a device; without",
        "                 DEVICE, list the open questions",
    ]
    wide = f"  {'a' * 30}   what is said of it is longer than the terminal is wide"
    assert broken(wide, 60).splitlines()[1].startswith("    l")
