"""DISK_FULL: drop what octoform can make again or has more of than it needs, and report what. Light.

In this order, and only until there is room: environments that no endpoint names, old attempts of agents, archives of
logs (their errors stay), the environment before the present one. Never an artifact, a log that is written, what a
person has put there, results that tools gave to somebody, or evidence of an edit.

ROTATE: archive a log that has grown large. Light; `octoform.endpoint.process.log_rotation` states how nothing
of it is lost.
"""

import os
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from octoform.base.files import remove_tree
from octoform.daemon.model import Done
from octoform.endpoint.environment.build import prune
from octoform.endpoint.process.log_rotation import archives, drop
from octoform.endpoint.process.log_rotation import rotate as rotate_log
from octoform.endpoint.published_files import read_manifest
from octoform.patterns import regex
from octoform.state.files import mount_point
from octoform.state.layout import Layout

WANTED = 128_000_000
"""Bytes of room at which nothing more is dropped; twice of what counts as a full disk."""
YOUNG_SECONDS = 3600.0
"""An attempt that was touched since then may be under way."""
ATTEMPTS_KEPT = 2
"""The last ones of each stage stay: they say how what is accepted came to be."""
_NAMES = ("environment", "previous_environment")
_ATTEMPT = regex(r"\d+-(?P<stage>.+)-\d+")


def free(layout: Layout, wanted: int = WANTED) -> Done:
    """Make room, until the disk of the project has ``wanted`` bytes."""
    dropped: list[str] = []
    before = room(layout)
    things = _droppable(layout)
    while room(layout) < wanted and (what := next(things, None)) is not None:
        dropped.append(what)
    after = room(layout)
    message = f"dropped {', '.join(dropped)}" if dropped else "octoform has no more files to delete"
    text = f"{message}; {after // 1_000_000} MB are free now, {max(0, after - before) // 1_000_000} MB more than before"
    if after >= wanted:
        return Done(True, text)
    return Done(False, f"{text}; free some space on that disk", again=False)


def room(layout: Layout) -> int:
    """Bytes that this user may still write where the project is."""
    facts = os.statvfs(layout.local if layout.local.is_dir() else layout.project)
    return facts.f_bavail * facts.f_frsize


def _droppable(layout: Layout) -> Iterator[str]:
    """Drops one thing after the other and names it; the caller stops asking when there is room enough."""
    manifest = read_manifest(layout) or {}
    present, before = (Path(str(manifest[name])) if manifest.get(name) else None for name in _NAMES)
    if present is not None:
        for path in prune(layout, {path for path in (present, before) if path is not None}):
            yield f"the environment {path.name}"
    for path in _old_attempts(layout):
        with suppress(OSError):
            remove_tree(path)
        yield f"the attempt {path.name}"
    for path in archives(layout):
        drop(path)
        yield f"the log {path.name}"
    if present is not None and before is not None and before != present:
        for path in prune(layout, {present}):
            yield f"the environment {path.name}, which served before the present one"


def _old_attempts(layout: Layout) -> list[Path]:
    """Attempts but the last ones of each stage, oldest first."""
    try:
        found = sorted(path for path in layout.attempts.iterdir() if path.is_dir() and not path.is_symlink())
    except OSError:
        return []
    by_stage: dict[str, list[Path]] = {}
    for path in found:
        if match := _ATTEMPT.fullmatch(path.name):
            by_stage.setdefault(match["stage"], []).append(path)
    spare = [path for paths in by_stage.values() for path in paths[:-ATTEMPTS_KEPT]]
    limit = time.time() - YOUNG_SECONDS
    return sorted(path for path in spare if path.stat().st_mtime < limit)


def rotate(layout: Layout, name: str) -> Done:
    """Archive the log ``name`` of a host; what the system refuses is reported."""
    path = layout.logs / Path(name).name
    if path.is_symlink():
        return Done(False, f"{path.name} is a link, which is left alone", again=False)
    try:
        size = rotate_log(path, held_open=path == layout.server_log)
    except FileNotFoundError:
        return Done(True, f"there is no {path.name}")
    except OSError as problem:
        where = mount_point(path.parent)
        return Done(False, f"{path.name} cannot be moved away: {problem.strerror or problem} (on {where})")
    return Done(True, f"{path.name} ({size // 1000} kB) was moved to {path.name}.1")
