"""How the deployment is, for anyone who asks the HTTP door: the daemon's word, and what this process sees by itself.

What the daemon wrote is believed while the daemon lives, the record is fresh, and nothing plain contradicts it. Without
a daemon no one has looked at logs, files and sensors, so nothing is healthy; what is plainly bad is reported all the
same.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from octoform.base.clock import boottime
from octoform.base.files import read_json
from octoform.base.health_status import FILE, Status, basis, believed, worst
from octoform.base.locks import is_locked

LOCK = "daemon.lock"
SECONDS = 1.0
"""How long a verdict is given again: strangers may ask as often as they like."""
MAX_BYTES = 4_000_000


class Verdict:
    """Asked for one word. ``folder`` is the daemon's, ``instance`` this start of the endpoint.

    ``engaged`` shows whether the emergency stop is engaged, ``lacks`` whether a device is absent, closed to the
    user, or was reported outside of its range.
    """

    def __init__(self, folder: Path, instance: str, latched: Callable[[], bool], lacks: Callable[[], bool]) -> None:
        self._folder = folder
        self._instance = instance
        self._is_engaged = latched
        self._lacks = lacks
        self._known: tuple[float, bool, Status] | None = None

    def __call__(self) -> str:
        """``healthy``, ``unknown``, ``degraded``, ``error`` or ``down``."""
        now, latched = time.monotonic(), self._is_engaged()
        if self._known is None or now - self._known[0] >= SECONDS or self._known[1] is not latched:
            own = Status.DEGRADED if latched or self._lacks() else Status.HEALTHY
            self._known = (now, latched, worst((own, self._of_daemon(engaged=latched))))
        return self._known[2]

    def _of_daemon(self, *, engaged: bool) -> Status:
        """The word of the daemon; ``unknown`` where none lives, or where its record is not of now."""
        here = basis(self._instance, stopped=False, engaged=engaged)
        found = believed(self._record(), boottime(), here) if self._is_alive() else None
        return found or Status.UNKNOWN

    def _record(self) -> Any:
        try:
            return read_json(self._folder / FILE, MAX_BYTES, follow=False, any_text=True)
        except (OSError, ValueError):
            return None

    def _is_alive(self) -> bool:
        """True while a daemon holds its lock, which the kernel gives back however it ends."""
        try:
            return is_locked(self._folder / LOCK)
        except OSError:
            return False
