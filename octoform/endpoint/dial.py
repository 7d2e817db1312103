"""A connection to the endpoint of a host, started first where nothing runs yet, and a client's pipe to it. Light."""

import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path

from octoform.base import shortage
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.process.record import is_marked, refusal, running, unmark
from octoform.endpoint.process.start_stop import is_stopped, start, stop
from octoform.endpoint.published_files import LAUNCHER
from octoform.endpoint.sockets import greeted
from octoform.endpoint.stdio import pipe, refuse
from octoform.manifest.model_url import is_legal_host
from octoform.state.files import foreign_among, refused
from octoform.state.layout import Layout

CONNECT_SECONDS = 5.0
_HALT_LOOKS, _HALT_SECONDS = 5, 0.1
PATIENCE_SECONDS = 1.0
"""How long a start may take before it is reported to the waiting client."""


def reach(
    layout: Layout, waiting: Callable[[], None] | None = None, *, revive: bool = False
) -> socket.socket | Diagnostic:
    """A connected socket, or why there is none; ``waiting`` is called when a start takes more than a second.

    What a person stopped is started with ``revive`` alone, which also ends the stop.
    """
    try:
        return greeted(layout.socket, CONNECT_SECONDS)
    except OSError:
        pass  # nothing runs, or nothing that takes clients: `start` knows
    problem = _revived(layout) if revive else None
    problem = problem or _started(layout, waiting)
    if problem is not None:
        return problem
    try:
        return greeted(layout.socket, CONNECT_SECONDS)
    except OSError as fault:
        return down(f"it was started and takes no client ({fault.strerror})")


def started(layout: Layout) -> Diagnostic | None:
    """Start the endpoint unless a person stopped it; why it does not run, None when it does."""
    stopped = refusal(layout)
    if stopped is not None:
        return stopped
    problem = start(layout)[1]
    stopped = refusal(layout)
    if stopped is not None:  # the person was faster than the process, and found none to stop
        stop(layout)
    return stopped or problem


def _revived(layout: Layout) -> Diagnostic | None:
    try:
        unmark(layout)
    except OSError as problem:
        return refused(problem, layout.stop_mark)
    return None


def _started(layout: Layout, waiting: Callable[[], None] | None) -> Diagnostic | None:
    if waiting is None:
        return started(layout)
    import threading  # here, so that a pipe to a running endpoint does not load it

    timer = threading.Timer(PATIENCE_SECONDS, waiting)
    timer.daemon = True
    timer.start()
    try:
        return started(layout)
    finally:
        timer.cancel()


def knock(layout: Layout) -> socket.socket | Diagnostic:
    """A connected socket of the endpoint that runs, or why there is none; nothing is started."""
    try:
        return greeted(layout.socket, CONNECT_SECONDS)
    except OSError as fault:
        return down(f"nothing takes clients ({fault.strerror or fault})")


def halted(layout: Layout) -> Diagnostic | None:
    """ENDPOINT-DOWN for a process that a signal has stopped: the kernel accepts clients for it, and nothing answers.

    A debugger stops a process for moments; only one that stays so counts.
    """
    found = running(layout)
    if found is None:
        return None
    for _ in range(_HALT_LOOKS):
        if not is_stopped(found.pid):
            return None
        time.sleep(_HALT_SECONDS)
    return down(f"its process is stopped; kill -CONT {found.pid} lets it go on, octoform restart starts another")


def down(why: str) -> Diagnostic:
    """The endpoint does not answer, and why."""
    hint = "octoform plan shows what differs from what was applied; octoform apply repairs it"
    return error("ENDPOINT-DOWN", "the endpoint does not answer", detail=why, hint=hint)


# Another endpoint for a client whose endpoint ended: started by another process, or by this one when none does.
#
# After a crash the daemon starts the next one, after a restart or an apply these do. Where the client waits and no
# process has done it for a while, this does, as it would for a new client. What a person stopped, or what was
# destroyed, is left alone, and the client's pipe ends.

RECONNECT_SECONDS = 2.0
"""How long a client that waits leaves the start to others."""
GREETING_SECONDS = 1.0
Start = Callable[[Layout], Diagnostic | None]


class Returning:
    """Asked again and again by a pipe (`octoform.endpoint.stdio.Again`)."""

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
        if now - self._since >= RECONNECT_SECONDS:
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


def connect(project: Path, host: str | None, *, revive: bool = False) -> str | None:
    """Carry a client's bytes until it is done; the reason in one line when it ended otherwise.

    A refused client gets the reason in the answer to its first request too. ``revive``: it may end a person's stop.
    """
    layout = _layout(project, host)
    if isinstance(layout, str):
        return _refused(layout)
    connection = reach(layout, revive=revive)
    if isinstance(connection, Diagnostic):
        hint = connection.hint if connection.code == "ENDPOINT-STOPPED" else None
        return _refused(": ".join(filter(None, (connection.summary, connection.detail, hint))))
    with connection:
        return (
            None if pipe(connection, again=lambda: Returning(layout)) else f"the endpoint of {layout.host} was stopped"
        )


def _refused(why: str) -> str:
    refuse(why)
    return why


def _layout(project: Path, host: str | None) -> Layout | str:
    """The host that is meant, or why none is."""
    if host is not None and not is_legal_host(host):
        return f"{host!r} is no name of a host"
    applied = sorted(path.parents[1].name for path in project.glob(f".octoform/*/endpoint/{LAUNCHER}"))
    if host in applied:
        return Layout(project, host)
    if host is None and len(applied) == 1:
        return Layout(project, applied[0])
    if (host is not None or not applied) and (shut := foreign_among(project, host)):
        return shut.summary
    if host is not None:
        return f"{host} has no endpoint in {project}; run octoform apply"
    known = f"; name one: {', '.join(applied)}" if applied else "; run octoform apply"
    return f"{project} has {len(applied) or 'no'} endpoint{'s' if len(applied) > 1 else ''}{known}"
