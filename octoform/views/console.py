"""Where views print: standard output for results, standard error for problems, colour only where a person looks.

Light: no terminal library is imported here; a plan with nothing to do must not wait for one.
"""

import os
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from io import TextIOWrapper
from shutil import get_terminal_size
from typing import TextIO

STYLES = {"bold": "1", "dim": "2", "red": "31", "green": "32", "yellow": "33", "cyan": "36"}
_PAINT = re.compile(r"\x1b\[[\d;]*m")


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
        """Columns of the terminal, at least 60; 160 where nobody looks."""
        return max(60, get_terminal_size((160, 24)).columns) if self.out.isatty() else 160

    def paint(self, text: str, *styles: str) -> str:
        """``text`` in the named styles, or as it is where colour is off."""
        if not self.colour or not text:
            return text
        return f"\x1b[{';'.join(STYLES[style] for style in styles)}m{text}\x1b[0m"

    def line(self, text: str = "") -> None:
        """One line on standard output."""
        self.out.write(text + "\n")
        self.out.flush()

    def wrapped(self, lead: str, text: str, *, indent: int) -> None:
        """A text behind ``lead``: on a terminal broken between words, further lines ``indent`` in; in a pipe one line.

        ``lead`` may be painted: it counts as wide as it looks.
        """
        if not self.out.isatty():
            return self.line(f"{lead}{text}".rstrip())
        import textwrap  # a few milliseconds that a plan without changes need not wait

        room, seen = max(20 + indent, self.width), len(_PAINT.sub("", lead))
        wrapper = textwrap.TextWrapper(room, " " * seen, " " * indent, break_long_words=False, break_on_hyphens=False)
        first, *rest = wrapper.wrap(text) or [""]
        self.line(f"{lead}{first[seen:]}".rstrip())
        for line in rest:
            self.line(line)
        return None

    def problem(self, text: str) -> None:
        """Text on standard error."""
        self.err.write(text + "\n")
        self.err.flush()


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
