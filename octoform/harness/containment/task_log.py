"""The log of one attempt: everything the agent printed, within bounds and without the secrets it was given.

Written while the agent runs. Bounded, because an agent may print permanently; private (0600), because it holds what the
agent saw; and redacted before it is written, because a log is what the next prompt quotes.
"""

import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from octoform.redaction import Redactor

DEFAULT_LIMIT = 16 << 20
LINE_LIMIT = 200
LINES_LOOKED_AT = 8
PROGRESS_INTERVAL = 0.2
SILENCE_INTERVAL = 10.0


class Progress:
    """Lines of the agent's standard output for a person: short, printable, and not more than five a second.

    A silent agent is notified of too, by an empty text every ten seconds, so that no one wonders whether it still runs.
    """

    def __init__(self, sink: Callable[[str, float], None], clock: Callable[[], float] = time.monotonic) -> None:
        self._sink = sink
        self._clock = clock
        self._began = clock()
        self._written_at = float("-inf")
        self._line = b""
        self._pending: str | None = None

    def feed(self, data: bytes) -> None:
        """Take a piece of output; only the newest line of a burst is shown."""
        # From the right and only a few: of a flood just the newest line is shown, and the rest costs nothing.
        *whole, rest = data.rsplit(b"\n", LINES_LOOKED_AT)
        if whole:
            lines = [self._line + whole[0].rpartition(b"\n")[2], *whole[1:]]
            self._line = b""
            shown = next((text for text in map(printable, reversed(lines)) if text), None)
            self._pending = shown or self._pending
        self._line = (self._line + rest)[: 4 * LINE_LIMIT]
        self.tick()

    def tick(self) -> None:
        """Show a waiting line when enough time has passed since the last."""
        now = self._clock()
        if self._pending is None and now - max(self._written_at, self._began) >= SILENCE_INTERVAL:
            self._pending = ""
        if self._pending is not None and now - self._written_at >= PROGRESS_INTERVAL:
            self._show(now)

    def finish(self) -> None:
        """Show the last line, whole or not."""
        self._pending = printable(self._line) or self._pending
        if self._pending is not None:
            self._show(self._clock())

    def _show(self, now: float) -> None:
        text, self._pending, self._written_at = self._pending, None, now
        if text is not None:
            self._sink(text, now - self._began)


def printable(line: bytes) -> str:
    """A line as one that can be shown on any terminal: undecodable and control characters replaced, cut to size."""
    text = line[: 4 * LINE_LIMIT].decode("utf-8", "replace").strip()
    return "".join(sign if sign.isprintable() else "\ufffd" for sign in text)[:LINE_LIMIT]


class TaskLog:
    """The log file, as a context manager; ``written`` and ``dropped`` count bytes."""

    def __init__(self, path: Path, secrets: Mapping[str, str], limit: int = DEFAULT_LIMIT) -> None:
        self._path = path
        self._limit = limit
        self._redactors = {name: Redactor(secrets) for name in ("stdout", "stderr")}
        self._descriptor = -1
        self.written = 0
        self.dropped = 0

    def __enter__(self) -> Self:
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        self._descriptor = os.open(self._path, flags, 0o600)
        os.fchmod(self._descriptor, 0o600)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        for stream in self._redactors:
            self.rest(stream)
        if self.dropped:
            note = f"\n[octoform: the log is limited to {self._limit} bytes; {self.dropped} more were dropped]\n"
            os.write(self._descriptor, note.encode())
        os.close(self._descriptor)

    @property
    def full(self) -> bool:
        """True once the limit is reached: the rest is counted only."""
        return self.dropped > 0

    def feed(self, stream: str, data: bytes) -> bytes:
        """Write a piece of ``stdout`` or ``stderr``; the redacted bytes."""
        shown = self._redactors[stream].feed(data)
        self._write(shown)
        return shown

    def rest(self, stream: str) -> bytes:
        """Write what was held back of a stream that has ended; the redacted bytes."""
        shown = self._redactors[stream].flush()
        self._write(shown)
        return shown

    def _write(self, data: bytes) -> None:
        room = max(0, self._limit - self.written)
        kept = memoryview(data)[:room]
        self.dropped += len(data) - len(kept)
        while kept:
            count = os.write(self._descriptor, kept)
            self.written += count
            kept = kept[count:]
