"""A person's stop: a mark that lasts until the endpoint is wanted again, so that nothing starts it by itself. Light.

``octoform stop`` makes it. ``start`` and ``apply`` take it away, and so does a client whose command line its owner gave
``-start``. Every other client is refused and told of the stop. The daemon leaves a marked endpoint alone, also after a
reboot.
"""

import json
import os
import pwd
from dataclasses import dataclass
from datetime import UTC, datetime

from octoform.base.files import parse
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.files import private_folder
from octoform.escaping import escaped
from octoform.state.files import read_regular, refused, write_atomic
from octoform.state.layout import Layout

_LIMIT = 64 * 1024
_LONGEST_WORDS = 200
HINT = "octoform start starts it; a client whose command has -start may, too"


@dataclass(frozen=True, slots=True)
class Stop:
    """Who stopped the endpoint and when (RFC 3339, empty where the mark does not say)."""

    by: str = "a person"
    at: str = ""

    def describe(self, host: str) -> str:
        """One sentence for whoever finds it stopped."""
        return f"the endpoint of {host} was stopped by {self.by}" + (f" at {self.at}" if self.at else "")


def mark(layout: Layout) -> Diagnostic | None:
    """Say that a person wants the endpoint stopped; why it could not be said, None when it is."""
    document = {"format": 1, "by": _person(), "at": datetime.now(UTC).isoformat(timespec="seconds")}
    try:
        private_folder(layout.run)
    except OSError as problem:
        return refused(problem, layout.run)
    return write_atomic(layout.stop_mark, json.dumps(document).encode(), 0o600)


def unmark(layout: Layout) -> None:
    """The endpoint is wanted again. OSError when the system refuses."""
    layout.stop_mark.unlink(missing_ok=True)


def is_marked(layout: Layout) -> bool:
    """True while a person wants it stopped; whatever stands in the mark's place counts."""
    return os.path.lexists(layout.stop_mark)


def read(layout: Layout) -> Stop | None:
    """The stop that holds; None when there is none. A mark that cannot be read holds without a name."""
    if not is_marked(layout):
        return None
    data, _ = read_regular(layout.stop_mark, _LIMIT)
    try:
        document = parse(data or b"")
        return Stop(*(escaped(str(text)[:_LONGEST_WORDS]) for text in (document["by"], document.get("at", ""))))
    except (ValueError, LookupError, TypeError, AttributeError):
        return Stop()


def refusal(layout: Layout) -> Diagnostic | None:
    """Why nothing may start the endpoint unasked; None when no person stopped it."""
    stop = read(layout)
    return None if stop is None else error("ENDPOINT-STOPPED", stop.describe(layout.host), hint=HINT)


def _person() -> str:
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return f"uid {os.getuid()}"
