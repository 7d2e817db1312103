"""The JSON form of long operations: one object a line, versioned.

The first line has type ``version``; a minor step of ``ui`` only adds, a major step may take away. Every line has
``@level``, ``@message``, ``@timestamp`` (RFC 3339, UTC) and ``type``; a reader that meets an unknown type shows
its message.
"""

import json
from collections.abc import Callable, Mapping
from datetime import UTC, datetime

import octoform
from octoform.diagnostics import Diagnostic, to_json
from octoform.escaping import escaped_json
from octoform.views.format.console import Console

UI_VERSION = "1.1"


def _now() -> datetime:
    return datetime.now(UTC)


class JsonStream:
    """Writes the lines; ``clock`` gives the time, UTC."""

    def __init__(self, console: Console, clock: Callable[[], datetime] = _now) -> None:
        self._console = console
        self._clock = clock
        self.emit("version", f"octoform {octoform.__version__}", octoform=octoform.__version__, ui=UI_VERSION)

    def emit(self, kind: str, message: str, *, level: str = "info", **fields: object) -> None:
        """One line of type ``kind``."""
        stamp = self._clock().isoformat(timespec="milliseconds").replace("+00:00", "Z")
        head: Mapping[str, object] = {"@level": level, "@message": message, "@timestamp": stamp, "type": kind}
        self._console.raw(escaped_json(json.dumps({**head, **fields}, ensure_ascii=False)))

    def diagnostics(self, items: list[Diagnostic] | tuple[Diagnostic, ...]) -> None:
        """One line of type ``diagnostic`` for each."""
        for item in items:
            level = "error" if item.severity == "error" else "warn"
            self.emit("diagnostic", f"{item.code}: {item.summary}", level=level, diagnostic=to_json(item))
