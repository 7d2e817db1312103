"""Problems on a terminal: as wide as it is, whatever standard output leads to, with the source line cut."""

import fcntl
import io
import os
import pty
import struct
import termios
from collections.abc import Iterator

import pytest

from octoform.diagnostics import Diagnostic, Severity, Span
from octoform.views.format.console import Console
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
