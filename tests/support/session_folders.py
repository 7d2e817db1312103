"""Folders outside of pytest's own that a whole process of the tests uses, and that go with its last test.

A worker of xdist ends without what Python does at its exit, so a finalizer alone would leave each of them behind.
"""

import atexit
import os
import shutil
import tempfile
from pathlib import Path

_made: dict[int, list[Path]] = {}
"""By the process that made them: a fork of it must not take them away."""


def session_folder(name: str) -> Path:
    """A new folder below the system's own for temporary files; ``name`` is a part of its name."""
    folder = Path(tempfile.mkdtemp(prefix=f"octoform-{name}-"))
    _made.setdefault(os.getpid(), []).append(folder)
    return folder


def remove_session_folders() -> None:
    """Take away all that this process has made."""
    for folder in _made.pop(os.getpid(), []):
        shutil.rmtree(folder, ignore_errors=True)


atexit.register(remove_session_folders)
