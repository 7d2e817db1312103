"""A connection to the endpoint of a host, which is started first where nothing runs yet. Light."""

import socket
from collections.abc import Callable

from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.process.desired_state import refusal, unmark
from octoform.endpoint.process.lifecycle import start, stop
from octoform.endpoint.sockets import greeted
from octoform.state.files import refused
from octoform.state.layout import Layout

CONNECT_SECONDS = 5.0
PATIENCE_SECONDS = 1.0
"""How long a start may take before whoever waits is told of it."""


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


def down(why: str) -> Diagnostic:
    """The endpoint does not answer, and why."""
    hint = "octoform plan tells what differs from what was applied; octoform apply repairs it"
    return error("ENDPOINT-DOWN", "the endpoint does not answer", detail=why, hint=hint)
