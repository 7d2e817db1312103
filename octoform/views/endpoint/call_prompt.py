"""What a person sees and is asked while a call runs: on standard error, because standard output is the answer's."""

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from shutil import get_terminal_size
from typing import Any

from octoform.views.format.console import Console
from octoform.views.format.values import escape, one_line

PATIENCE_SECONDS = 1.0
"""A call that is done sooner needs no sign of life."""


class Attended:
    """The person at the terminal, if there is one; ``approved`` when they said yes beforehand."""

    def __init__(self, console: Console, *, approved: bool, clock: Callable[[], float] = time.monotonic) -> None:
        self._console = console
        self._approved = approved
        self._clock = clock
        self._began = clock()
        self._shown = 0

    def waiting(self) -> None:
        """Tell of a start that takes its time."""
        starting(self._console)

    def progress(self, done: float, total: float | None, message: str) -> None:
        """One moving line on a terminal, once the call has taken more than a second."""
        if not self._console.err.isatty() or self._clock() - self._began < PATIENCE_SECONDS:
            return
        text = f"{done:.12g}" if total is None else f"{done:.12g} of {total:.12g}"
        width = get_terminal_size((80, 24)).columns - 1
        self._draw(one_line(f"  {text}  {message}".rstrip(), width))

    def approves(self, tool: str, arguments: Mapping[str, Any], message: str) -> bool | None:
        """Show the call and ask; None where there is no terminal to ask at."""
        if self._approved:
            return True
        if sys.stdin is None or not sys.stdin.isatty() or not self._console.err.isatty():
            return None
        self.clear()
        lines = [f"{tool} wants an approval:"]
        lines += [f"  {name} = {json.dumps(value, ensure_ascii=False)}" for name, value in arguments.items()]
        lines += [f"  {line}" for line in message.splitlines()]
        self._console.problem("\n".join(escape(line).replace("\n", "\\n") for line in lines))
        self._console.err.write("Approve this one call? [y/N] ")
        self._console.err.flush()
        try:
            answer = sys.stdin.readline()
        except UnicodeDecodeError:
            answer = ""
        if not answer.endswith("\n"):
            self._console.problem("")
        self._began = self._clock()
        return answer.strip().lower() in ("y", "yes")

    def clear(self) -> None:
        """Take the moving line away."""
        if self._shown:
            self._draw("")
            self._console.err.write("\r")
            self._console.err.flush()

    def _draw(self, text: str) -> None:
        # Overwritten with blanks, which every terminal understands.
        self._console.err.write("\r" + text.ljust(self._shown))
        self._console.err.flush()
        self._shown = len(text)


@contextmanager
def attended(console: Console, *, approved: bool) -> Iterator[Attended]:
    """The person for the time of one call; nothing is left on their terminal behind it."""
    person = Attended(console, approved=approved)
    try:
        yield person
    finally:
        person.clear()


def starting(console: Console) -> None:
    """The endpoint is being started, and that takes more than a second."""
    console.problem("octoform: the endpoint is not running; starting it ...")
