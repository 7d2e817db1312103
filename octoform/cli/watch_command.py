"""One daemon from its first look to its end, and how a command leaves that made it."""

import os
from pathlib import Path
from typing import Protocol

from octoform.daemon.main import watch
from octoform.daemon.model import Status
from octoform.daemon.reconcile.supervisor import Round
from octoform.views.daemon.event_log import EXIT
from octoform.views.format import problems
from octoform.views.format.console import Console


class Shown(Protocol):
    """A view of the rounds."""

    def __call__(self, made: Round, /) -> None:
        """Show one."""

    def end(self) -> None:
        """Leave the terminal as it was."""


def watched(project: Path, screen: Console, view: Shown, *, once: bool, as_json: bool) -> tuple[int, Status | None]:
    """The exit code, and the health that the last round left.

    None where it came to no end of its own: it was refused, which is shown (1), or ended by a signal (128 + number).
    """
    try:
        done, found = watch(project, os.environ, view, once)
    finally:
        view.end()
    if done is None:
        return problems.show(screen, found, as_json=as_json), None
    if done.signal is not None:
        return 128 + done.signal, None
    health = done.last.health if done.last is not None else None
    return (1, Status.UNKNOWN) if health is None else (EXIT[health.status], health.status)
