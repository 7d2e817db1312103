"""Unforeseen refusals of the operating system, reported as a diagnostic.

A person who meets a full or closed disk must read which file it was, why, and what to do; a traceback helps no one.
"""

import errno
import os
import traceback
from pathlib import Path

from octoform.base import shortage
from octoform.diagnostics import Diagnostic, error
from octoform.state.files import IN_THE_WAY, MOVE_AWAY, display, mount_point, name_of, reason_of

_PACKAGE = Path(__file__).resolve().parents[1]
_CLOSED = (errno.EACCES, errno.EPERM)
_FULL = (errno.ENOSPC, errno.EDQUOT)


def refusal(problem: OSError) -> Diagnostic:
    """SYSTEM-REFUSED: the operating system's error, about which file, and where octoform met it.

    A refused process or thread is SYSTEM-NO-PROCESSES.
    """
    if shortage.is_shortage(problem):
        return _no_processes(problem)
    path = Path(os.fsdecode(problem.filename)) if isinstance(problem.filename, str | bytes) else None
    reason = reason_of(problem) or type(problem).__name__
    return error(
        "SYSTEM-REFUSED",
        f"the operating system refused: {reason}",
        path=display(path) if path is not None else None,
        detail=_place(problem),
        hint=_hint(problem, path),
    )


def _no_processes(problem: OSError) -> Diagnostic:
    return error(
        "SYSTEM-NO-PROCESSES",
        shortage.TEXT,
        detail="; ".join(filter(None, (shortage.limits(), _place(problem)))) or None,
        hint="end some of your processes, or raise the limit, and run the same command again",
    )


def _hint(problem: OSError, path: Path | None) -> str:
    if path is None or not path.is_absolute():
        return "octoform explain SYSTEM-REFUSED explains what can be done"
    if problem.errno in _CLOSED:
        owner = _owner(path)
        if owner is not None and owner != os.geteuid():
            return f"it belongs to user {name_of(owner)}; run it as that user"
        return "look at its owner and mode"
    if problem.errno in _FULL:
        return f"free some space on {mount_point(path.parent)} and run the same command again"
    if problem.errno in IN_THE_WAY:
        return MOVE_AWAY
    if problem.errno == errno.EROFS:
        return "its file system is mounted read-only; mount it for writing, or use a copy that is writable"
    return "octoform explain SYSTEM-REFUSED explains what can be done"


def _owner(path: Path) -> int | None:
    """The owner of the file, or of the nearest folder above it that is readable."""
    for place in (path, *path.parents):
        try:
            return place.stat().st_uid
        except OSError:
            continue
    return None


def _place(problem: OSError) -> str | None:
    """The innermost line of octoform's own that met it: without it a bug looks like a bad disk."""
    frames = [frame for frame in traceback.extract_tb(problem.__traceback__) if _ours(frame.filename)]
    if not frames:
        return None
    last = frames[-1]
    return f"met in {last.name} ({Path(last.filename).relative_to(_PACKAGE.parent)}, line {last.lineno})"


def _ours(name: str) -> bool:
    return Path(name).is_relative_to(_PACKAGE)
