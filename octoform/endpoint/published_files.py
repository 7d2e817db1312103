"""Names and digests of the endpoint's own files, and their private folders.

Light: used by the observation that every plan makes.
"""

import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from octoform.base.digest import of_bytes, of_value
from octoform.base.files import read, read_json, record, walk
from octoform.base.shape import fits
from octoform.diagnostics import Diagnostic, error
from octoform.state.layout import Layout

CONNECTION = "connection.json"
LAUNCHER = "launch"
SERVE_SCRIPT = "serve.py"
PROGRAM = "octoform"
"""The folder of what runs in the endpoint's process: the launcher and what it stands on, named as here."""
POLICY = "policy.json"
_SOURCE = Path(__file__).parents[1]
_PACKAGES = ("server", "policy", "base")
_RECORDS = _SOURCE / "records.py"
PACKAGES = tuple(_SOURCE / name for name in _PACKAGES)
"""The packages that are copied there as files; the core never imports the launcher."""
CLIENTS = "clients"
MANIFEST = "manifest.json"
_MANIFEST = {
    "format": int,
    "files": {str: str},
    "environment": str,
    "previous_environment": (str, None),
    "lock": str,
    "tools": [str],
    "server": str,
    "runtime": (str, None),
    "launcher": (str, None),
}
CHECK = "check.json"
_TOOL = {
    "effect": str,
    "decision": (str, None),
    "timeout": (float, None),
    "buses": ([str], None),
    "limits": ([dict], None),
}
_POLICY = {"mode": (str, None), "tools": {str: _TOOL}}


def files_below(folder: Path) -> dict[str, str]:
    """Relative name to digest of all files below ``folder``, bytecode omitted; empty when there is no folder.

    The digest is empty where a file cannot be read: an editor leaves links there that lead nowhere.
    """
    entries = {}
    start = len(f"{folder}/")
    for root, folders, names in walk(folder):
        folders[:] = sorted(name for name in folders if name != "__pycache__")
        for name in sorted(names):
            entries[f"{root}/{name}"[start:]] = file_digest(root / name) or ""
    return entries


def program_paths() -> dict[str, Path]:
    """Name below the endpoint's folder to this octoform's own file, for each file of the program around the server."""
    modules = (_SOURCE / "__init__.py", _RECORDS)
    paths = [*modules, *(path for folder in PACKAGES for path in sorted(folder.rglob("*.py")))]
    return {f"{PROGRAM}/{path.relative_to(_SOURCE).as_posix()}": path for path in paths}


def program_files() -> dict[str, bytes]:
    """The same names to the bytes of these files; OSError when one cannot be read."""
    return {name: read(path) for name, path in program_paths().items()}


def program_digest() -> str:
    """Digest of the program that this octoform publishes."""
    return of_value([files_below(folder) for folder in PACKAGES] + [file_digest(_RECORDS)])


def folder_digest(folder: Path) -> str | None:
    """Digest of names and bytes of all files below ``folder``; None when there is no folder."""
    return of_value(files_below(folder)) if folder.is_dir() else None


def file_digest(path: Path) -> str | None:
    """Digest of the bytes, or None when the file is not there or cannot be read."""
    try:
        return of_bytes(read(path))
    except OSError:
        return None


def not_ours(folder: Path) -> str | None:
    """Why nothing may be written below the folder: a link or another user's; None when it is ours, or not there.

    Whether it is open to others is looked at, and repaired, by the process that is started.
    """
    try:
        status = folder.lstat()
    except FileNotFoundError:
        return None
    if stat.S_ISLNK(status.st_mode):
        return f"{folder} is a symlink; it must be a folder"
    if status.st_uid != os.geteuid():
        return f"{folder} belongs to another user (uid {status.st_uid}); nothing of it can be trusted"
    return None


def written_for(layout: Layout) -> Path | None:
    """The project that this endpoint's files name, where that is another folder; None where it is this one.

    They hold absolute paths, so those of a copied or renamed project lead to the place where they were written. None
    also where nothing is applied, or the descriptor cannot be read, which a start reports.
    """
    try:
        run = Path(read_json(layout.endpoint / CONNECTION)["paths"]["run"])
    except (OSError, ValueError, LookupError, TypeError):
        return None
    try:
        return None if run.parent.samefile(layout.local) else run.parents[2]
    except (OSError, IndexError):
        return run.parents[2] if len(run.parents) > 2 else run


def is_copy(layout: Layout) -> bool:
    """Whether the folder that the endpoint's files name is there: else this one was renamed, or moved here."""
    other = written_for(layout)
    return other is not None and Layout(other, layout.host).endpoint.is_dir()


def of_another(layout: Layout) -> Diagnostic | None:
    """ENDPOINT-ELSEWHERE where the endpoint's files were written for another folder."""
    other = written_for(layout)
    if other is None:
        return None
    there = is_copy(layout)
    what = f"that of {other}, of which this folder is a copy" if there else f"written for {other}, which is not there"
    hint = "octoform start or octoform apply gives this folder its own endpoint"
    hint += f"; for the original: octoform -chdir={other} ..." if there else ""
    return error("ENDPOINT-ELSEWHERE", f"the endpoint of {layout.host} is {what}", path=str(layout.endpoint), hint=hint)


def read_manifest(layout: Layout) -> dict[str, Any] | None:
    """The manifest of the applied endpoint; None when nothing is applied or the file is no manifest of ours."""
    try:
        value = record(read_json(layout.endpoint / MANIFEST), 1)
    except (OSError, ValueError):
        return None
    return value if fits(value, _MANIFEST) else None


def read_policy(layout: Layout) -> dict[str, Any] | None:
    """The resolved policy as it was published; None where there is none, or none that can be used.

    For who looks: what may be called is decided by the endpoint's own process, which refuses the whole of such a file.
    """
    try:
        value = read_json(layout.endpoint / POLICY)
    except (OSError, ValueError):
        return None
    return value if fits(value, _POLICY) else None


# The devices behind the endpoint's tools, and the nodes of them that its user may not use. Light.


def describe_closed(refused: Mapping[str, str]) -> str:
    """One sentence on a node from `octoform.runtime.where.refused`, with the command that helps."""
    return (
        f"this user may not {refused['lacks']} {refused['node']} (mode {refused['mode']}, group {refused['group']}): "
        f"{refused['remedy']}"
    )


def served_nodes(layout: Layout) -> dict[str, bool]:
    """The devices of the endpoint's tools by id, each with whether a tool acts on it; none without an endpoint."""
    found: dict[str, bool] = {}
    try:
        for tool in read_json(layout.endpoint / CONNECTION)["tools"]:
            for each in tool.get("devices") or ():
                found[str(each)] = found.get(str(each), False) or tool.get("effect") != "read"
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}
    return dict(sorted(found.items()))
