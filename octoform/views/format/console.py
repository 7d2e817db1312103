"""Where views print: standard output for results, standard error for problems, colour only where a person looks.

Light: no terminal library is imported here; a plan with nothing to do must not wait for one.
"""

import os
import sys
from collections.abc import Mapping
from io import TextIOWrapper
from typing import TextIO

from octoform.patterns import regex
from octoform.records import dataclass, replace

STYLES = {"bold": "1", "dim": "2", "red": "31", "green": "32", "yellow": "33", "cyan": "36"}
_PAINT = regex(r"\x1b\[[\d;]*m")
_SOURCE = regex(r" *\d* \|")
_WORD = regex(r"( *)([^ ]+)")
_TERM = regex(r" +[^ ]+(?: [^ ]+)*   *")
"""The term of a line such as `  stop         stop the endpoint`."""


@dataclass(frozen=True, slots=True)
class Console:
    """Output streams and what they can show."""

    out: TextIO
    err: TextIO
    colour: bool
    colour_err: bool
    interactive: bool

    @property
    def width(self) -> int:
        """Columns of the terminal, at least 60; 160 where no one looks."""
        return _columns(self.out, 160)

    @property
    def width_err(self) -> int:
        """Columns of the terminal that shows problems, at least 60; 120 where no one looks."""
        return _columns(self.err, 120)

    def uncoloured(self) -> "Console":
        """The same without colour."""
        return replace(self, colour=False, colour_err=False)

    def paint(self, text: str, *styles: str) -> str:
        """``text`` in the named styles, or as it is where colour is off."""
        if not self.colour or not text:
            return text
        return f"\x1b[{';'.join(STYLES[style] for style in styles)}m{text}\x1b[0m"

    def line(self, text: str = "") -> None:
        """A sentence or a row on standard output; on a terminal what is wider than it is broken between words."""
        self.raw(broken(text, self.width) if self.out.isatty() else text)

    def raw(self, text: str) -> None:
        """A line that somebody copies, such as JSON or a line of a file: never broken."""
        self.out.write(text + "\n")
        self.out.flush()

    def wrapped(self, lead: str, text: str, *, indent: int) -> None:
        """A string behind ``lead``: on a terminal broken between words, further lines ``indent`` in; else one line.

        ``lead`` may be painted: it counts as wide as it looks.
        """
        if not self.out.isatty():
            return self.raw(f"{lead}{text}".rstrip())
        room = max(20 + indent, self.width)
        return self.raw("\n".join(_pieces(lead, " ".join(text.split()), room, " " * indent)))

    def problem(self, text: str) -> None:
        """Text on standard error; on a terminal broken as on standard output, but for lines of a source."""
        self.err.write((broken(text, self.width_err) if self.err.isatty() else text) + "\n")
        self.err.flush()


def _columns(stream: TextIO, elsewhere: int) -> int:
    """How wide the terminal of a stream is, whatever the other streams lead to."""
    if not stream.isatty():
        return elsewhere
    given = os.environ.get("COLUMNS", "")
    try:
        columns = int(given) if given.isdecimal() else os.get_terminal_size(stream.fileno()).columns
    except OSError:
        columns = 0
    return max(60, columns or elsewhere)


def broken(text: str, width: int) -> str:
    """The text with each line at most ``width`` wide, broken between words; what goes on is indented further.

    The text behind a term, such as the help of a command, continues below its beginning. A line of a source with its
    number or its mark stays whole, and so does a word that is wider than the terminal, unless it is a call, which is
    broken behind its bracket.
    """
    if all(len(line) <= width for line in text.split("\n")):
        return text
    made = []
    for line in text.split("\n"):
        if _seen(line) <= width or _SOURCE.match(_PAINT.sub("", line)):
            made.append(line)
            continue
        lead = line[: len(line) - len(line.lstrip(" "))]
        plain = _PAINT.sub("", line)
        term = _TERM.match(plain)
        hang = lead + ("      " if plain.lstrip().startswith("help: ") else "  ")
        if term and term.end() <= width // 3:
            hang = " " * term.end()
        made += _pieces(lead, line[len(lead) :], width, hang)
    return "\n".join(made)


def _pieces(lead: str, text: str, width: int, hang: str) -> list[str]:
    """The lines of a string behind ``lead``; the spaces between two words of a line stay as they are."""
    lines, used, empty = [lead], _seen(lead), True
    for gap, word in _WORD.findall(text):
        parts = [word]
        if len(hang) + _seen(word) > width and "(" in word[:-1]:
            head, tail = word.split("(", 1)
            parts = [f"{head}(", tail]
        for part in parts:
            between = gap if part is parts[0] else ""
            if not empty and used + len(between) + _seen(part) > width:
                lines.append(hang)
                used, between = len(hang), ""
            lines[-1] += between + part
            used += len(between) + _seen(part)
            empty = False
    return [line.rstrip() for line in lines]


def _seen(text: str) -> int:
    """How many columns a string takes that may be painted."""
    return len(_PAINT.sub("", text))


def for_process(environ: Mapping[str, str] | None = None) -> Console:
    """The console of this process; ``NO_COLOR`` (any value that is not empty) and ``TERM=dumb`` turn colour off."""
    environ = os.environ if environ is None else environ
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal without UTF-8 must not end a run
    plain = bool(environ.get("NO_COLOR")) or environ.get("TERM") == "dumb"
    return Console(
        out=sys.stdout,
        err=sys.stderr,
        colour=sys.stdout.isatty() and not plain,
        colour_err=sys.stderr.isatty() and not plain,
        interactive=sys.stdout.isatty() and sys.stdin is not None and sys.stdin.isatty(),
    )
