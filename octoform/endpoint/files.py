"""Names and digests of the endpoint's own files, and their private folders.

Light: used by the observation that every plan makes.
"""

import os
import stat
from pathlib import Path
from typing import Any

from octoform.digest import of_bytes, of_value
from octoform.state.layout import Layout
from octoform.state.reading import bytes_of, json_of

CONNECTION = "connection.json"
LAUNCHER = "launch"
SERVE_SCRIPT = "serve.py"
LAUNCHER_PACKAGE = "launcher"
POLICY = "policy.json"
PACKAGE = Path(__file__).parents[1] / LAUNCHER_PACKAGE
"""The package that runs in the endpoint's process: copied as files, never imported by the core."""
CLIENTS = "clients"
MANIFEST = "manifest.json"
CHECK = "check.json"


def files_below(folder: Path) -> dict[str, str]:
    """Relative name to digest of all files below ``folder``, bytecode left out; empty when there is no folder.

    The digest is empty where a file cannot be read: an editor leaves links there that lead nowhere.
    """
    entries = {}
    for root, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if name != "__pycache__")
        for name in sorted(names):
            path = Path(root, name)
            entries[path.relative_to(folder).as_posix()] = file_digest(path) or ""
    return entries


def folder_digest(folder: Path) -> str | None:
    """Digest of names and bytes of all files below ``folder``; None when there is no folder."""
    return of_value(files_below(folder)) if folder.is_dir() else None


def file_digest(path: Path) -> str | None:
    """Digest of the bytes, or None when the file is not there or cannot be read."""
    try:
        return of_bytes(bytes_of(path))
    except OSError:
        return None


def private_folder(path: Path) -> Path:
    """Make the folder with mode 0700 (parents too, as far as they are missing) and give it back."""
    if not path.is_dir():
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        path.mkdir(mode=0o700, exist_ok=True)
    return path


def not_ours(folder: Path) -> str | None:
    """Why nothing may be written below the folder: a link or another user's; None when it is ours, or not there.

    Whether it is open to others is looked at, and repaired, by the process that is started.
    """
    try:
        status = folder.lstat()
    except FileNotFoundError:
        return None
    if stat.S_ISLNK(status.st_mode):
        return f"{folder} is a link; a folder has to stand there"
    if status.st_uid != os.geteuid():
        return f"{folder} belongs to another user (uid {status.st_uid}); nothing of it can be trusted"
    return None


def read_manifest(layout: Layout) -> dict[str, Any] | None:
    """The manifest of the applied endpoint; None when nothing is applied or the file is no manifest of ours."""
    try:
        value = json_of(layout.endpoint / MANIFEST)
    except (OSError, ValueError):
        return None
    fits = isinstance(value, dict) and value.get("format") == 1 and isinstance(value.get("files"), dict)
    return value if fits else None
