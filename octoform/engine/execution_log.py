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
from octoform.diagnostics import Diagnostic, to_json
from octoform.events import AttemptProgress, Event


@contextmanager
def logging_to(path: Path, clock: Clock, show: Callable[[Event], None]) -> Iterator[Callable[[Event], None]]:
    """A sink that writes each event as one line and passes it on; progress lines are only passed on."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o600)

    def emit(event: Event) -> None:
        if not isinstance(event, AttemptProgress):
            os.write(descriptor, _line(event, clock))
        show(event)

    try:
        yield emit
    finally:
        os.close(descriptor)


def _line(event: Event, clock: Clock) -> bytes:
    fields = asdict(event)
    for name in ("diagnostics",):
        if name in fields:
            fields[name] = [to_json(item) for item in getattr(event, name) if isinstance(item, Diagnostic)]
    record = {"event": type(event).__name__, "time": clock.stamp(), "from": "octoform", **fields}
    return json.dumps(record, ensure_ascii=False).encode() + b"\n"
