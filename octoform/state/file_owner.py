"""Whose the private folders of a host are: another user's are closed, and nothing in them can be told from nothing.

A command that took what it may not see for what is not there would tell a second user that nothing runs, or advise him
to apply or to remove files. Light: the pipe of every client asks this.
"""

import os
from pathlib import Path

from octoform.diagnostics import Diagnostic, error
from octoform.state.layout import Layout


def foreign(layout: Layout) -> Diagnostic | None:
    """PROJECT-FOREIGN when what octoform keeps of this host is another user's and closed to this one."""
    return closed(layout.local.parent) or closed(layout.local)


def foreign_among(project: Path, host: str | None = None) -> Diagnostic | None:
    """The same for one host of a folder, or for the first of all that it is true of."""
    kept = project / ".octoform"
    folders = [kept, *([kept / host] if host is not None else sorted(kept.glob("*/")))]
    return next(filter(None, map(closed, folders)), None)


def closed(folder: Path) -> Diagnostic | None:
    """The same for one folder; None for one that is open, and for one that is not there."""
    try:
        owner = folder.stat().st_uid
    except OSError:
        return None  # not there, or behind a closed folder; who needs it finds out
    if owner == os.geteuid() or os.access(folder, os.R_OK | os.X_OK):
        return None
    summary = f"{folder} belongs to user {name_of(owner)}, and is closed to others"
    return error("PROJECT-FOREIGN", summary, path=str(folder), hint="run the same command as that user")


def name_of(user: int) -> str:
    """The name of a user id, or the id where it has none."""
    import pwd  # only a refusal pays for it

    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return str(user)
