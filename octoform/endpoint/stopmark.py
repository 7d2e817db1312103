"""A person's stop: a mark that lasts until the endpoint is wanted again, so that nothing starts it by itself. Light.

``octoform stop`` makes it. ``start``, ``restart`` and ``apply`` take it away, and so does a client that connects, since
a client that starts is as much a person's wish. The daemon leaves a marked endpoint alone, also after a reboot.
"""

import json
import os
import pwd
from datetime import UTC, datetime

from octoform.diagnostics import Diagnostic
from octoform.endpoint.files import private_folder
from octoform.state.files import refused, write_atomic
from octoform.state.layout import Layout


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


def _person() -> str:
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return f"uid {os.getuid()}"
