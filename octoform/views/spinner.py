"""The moving line of a run on a terminal: spinner, node, what it does, elapsed time. (Heavy: imports rich.)"""

import time
from types import TracebackType
from typing import Self, TextIO

from rich.console import Console as RichConsole
from rich.live import Live
from rich.spinner import Spinner
from rich.text import Text

from octoform.views.format.values import one_line


class MovingLine:
    """A context in which one line at the bottom moves and finished lines scroll above it."""

    def __init__(self, out: TextIO) -> None:
        self._console = RichConsole(file=out, highlight=False, soft_wrap=True)
        self._node = ""
        self._what = ""
        self._since = time.monotonic()
        self._spinner = Spinner("dots")
        self._live = Live(get_renderable=self._draw, console=self._console, refresh_per_second=8, transient=True)

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._node = ""
        self._live.stop()

    def update(self, node: str, what: str) -> None:
        """Another node, or the same at something else; the clock restarts with the node."""
        if node != self._node:
            self._since = time.monotonic()
        self._node, self._what = node, what

    def above(self, text: str) -> None:
        """A finished line (it may hold colour codes)."""
        self._console.print(Text.from_ansi(text))

    def _draw(self) -> Text | Spinner:
        if not self._node:
            return Text("")
        elapsed = time.monotonic() - self._since
        room = max(20, self._console.width - 30)
        self._spinner.update(text=f"{self._node:<10} {elapsed:5.1f} s  {one_line(self._what, room)}")
        return self._spinner
