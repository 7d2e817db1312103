"""Another endpoint for a client whose endpoint ended: whoever starts it, and by ourselves when nobody does.

After a crash the daemon starts the next one, after a restart or an apply these do. Where the client waits and nobody
has done it for a while, this does, as it would for a client that comes anew. What a person stopped, or what was
destroyed, is left alone, and the client's pipe ends.
"""

import socket
import threading
import time
from collections.abc import Callable

from octoform.base import shortage
from octoform.diagnostics import Diagnostic
from octoform.endpoint.files import LAUNCHER
from octoform.endpoint.process.desired_state import is_marked
from octoform.endpoint.proxy.dial import started
from octoform.endpoint.sockets import greeted
from octoform.state.layout import Layout

PATIENCE_SECONDS = 2.0
"""How long a client that waits leaves the start to others."""
GREETING_SECONDS = 1.0
Start = Callable[[Layout], Diagnostic | None]


class Returning:
    """Asked again and again by a pipe (`octoform.endpoint.proxy.stdio.Again`)."""

    def __init__(self, layout: Layout, begin: Start | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._layout = layout
        self._begin = begin or started
        self._clock = clock
        self._since: float | None = None
        self._starting: threading.Thread | None = None
        self._failed: Diagnostic | None = None

    def __call__(self, waits: bool) -> socket.socket | str | None:
        """A connection; None while there is none yet; why there is none; empty when there is to be none."""
        if is_marked(self._layout) or not (self._layout.endpoint / LAUNCHER).is_file():
            return ""
        connection = self._knock()
        if connection is not None:
            self._since = None
            return connection
        if self._starting is not None:
            return None if self._starting.is_alive() else self._ended()
        if not waits:
            self._since = None
            return None
        now = self._clock()
        self._since = now if self._since is None else self._since
        if now - self._since >= PATIENCE_SECONDS:
            starting = threading.Thread(target=self._run, name="start", daemon=True)
            try:
                shortage.start(starting)
            except BlockingIOError:
                return shortage.TEXT
            self._starting = starting
        return None

    def _knock(self) -> socket.socket | None:
        try:
            return greeted(self._layout.socket, GREETING_SECONDS)
        except OSError:
            return None

    def _run(self) -> None:
        self._failed = self._begin(self._layout)

    def _ended(self) -> str | None:
        """The start is over: it was no use, or the endpoint can be reached at the next time."""
        self._starting = self._since = None
        problem, self._failed = self._failed, None
        return None if problem is None else ": ".join(filter(None, (problem.summary, problem.detail)))
