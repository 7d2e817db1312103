"""Room kept on the disk, so that the end of a step that has begun can always be told.

An agent may work for minutes and fill the disk while it does. What it made is worth more than 512 KiB, so these are
taken before it starts and given back when a write of the state finds no room. Light.
"""

import contextlib
import os
from collections.abc import Callable
from pathlib import Path

from octoform.diagnostics import Diagnostic
from octoform.base.files import create
from octoform.state.files import refused
from octoform.state.layout import Layout

RESERVE_BYTES = 512 * 1024


def reserve_path(layout: Layout) -> Path:
    """The file that takes the room."""
    return layout.local / "reserve"


def hold(layout: Layout) -> Diagnostic | None:
    """Take the room, if it is not held already; STATE-DISK-FULL when there is none."""
    path = reserve_path(layout)
    if path.exists():
        return None
    try:
        create(path, os.urandom(RESERVE_BYTES))  # not zeros: a file system may store those as nothing
    except OSError as problem:
        return refused(problem, path)
    return None


def give_back(layout: Layout) -> Diagnostic | None:
    """Free the room."""
    path = reserve_path(layout)
    try:
        path.unlink(missing_ok=True)
    except OSError as problem:
        return refused(problem, path)
    return None


def spending(layout: Layout, write: Callable[[], Diagnostic | None]) -> Diagnostic | None:
    """Do a write that leaves the former file intact when it fails; on a full disk free the room and try once more."""
    problem = write()
    if problem is None or problem.code != "STATE-DISK-FULL" or not reserve_path(layout).exists():
        return problem
    return give_back(layout) or write()
