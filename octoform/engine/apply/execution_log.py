"""The orchestrator's lines in the host's one execution log, beside those of the tools.

One stream, so that whoever reads it later sees in one order what was done to the host and what was called on it.
"""

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from octoform.apply.context import Clock
from octoform.base.files import make_way, write_all
from octoform.diagnostics import Diagnostic, to_json
from octoform.events import AttemptProgress, Event, Notice


@contextmanager
def logging_to(path: Path, clock: Clock, show: Callable[[Event], None]) -> Iterator[Callable[[Event], None]]:
    """A sink that writes each event as one line and passes it on; progress lines are only passed on.

    A log that cannot be written (a full disk) stops no run: that it is incomplete is shown, once.
    """
    log = _Log(path, show)

    def emit(event: Event) -> None:
        if not isinstance(event, AttemptProgress):
            log.write(_line(event, clock))
        show(event)

    try:
        yield emit
    finally:
        log.close()


class _Log:
    """The open file; None after the system has refused it."""

    def __init__(self, path: Path, show: Callable[[Event], None]) -> None:
        self._show = show
        self._torn = False
        self._told = False
        self._descriptor: int | None = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            make_way(path)
            how = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOFOLLOW
            self._descriptor = os.open(path, how, 0o600)
        except OSError as problem:
            self._tell(problem)

    def write(self, line: bytes) -> None:
        if self._descriptor is None:
            return
        try:
            write_all(self._descriptor, b"\n" + line if self._torn else line)
            self._torn = False
        except OSError as problem:
            self._torn = True  # some of it may stand there; the next line must not be glued to it
            self._tell(problem)

    def _tell(self, problem: OSError) -> None:
        if not self._told:
            self._told = True
            self._show(Notice("", f"the execution log is incomplete: {problem.strerror}"))

    def close(self) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)


def _line(event: Event, clock: Clock) -> bytes:
    fields = asdict(event)
    for name in ("diagnostics",):
        if name in fields:
            fields[name] = [to_json(item) for item in getattr(event, name) if isinstance(item, Diagnostic)]
    record = {"event": type(event).__name__, "time": clock.stamp(), "from": "octoform", **fields}
    return json.dumps(record, ensure_ascii=False).encode() + b"\n"
