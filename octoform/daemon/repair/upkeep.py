"""The short repairs on files of this machine: logs, room on the disk, where a device is. Light.

DISK_FULL: drop what octoform can make again or has more of than it needs, and report what. In this order, and only
until there is room: environments that no endpoint names, old attempts of agents, archives of logs (their errors stay),
the environment before the present one. Never an artifact, a log that is written, what a person has put there, results
that tools gave to somebody, or evidence of an edit.

ROTATE: archive a log that has grown large; `octoform.endpoint.process.log_rotation` states how nothing of it is lost.

REBIND: write down where a device is now, where that is certain. The generated server finds its devices at every call,
so a device that moved works already; what is written down is what the next move is compared with. A device that was
distinguished only because it was left over, while there is another one of its kind, is not written down: a guess must
not become what is believed. A person decides there.
"""

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from octoform.apply.repair_outcome import RepairOutcome
from octoform.base.files import remove_tree
from octoform.daemon.observe.presence import Asked
from octoform.endpoint.environment.build import prune
from octoform.endpoint.process.log_rotation import archives, drop
from octoform.endpoint.process.log_rotation import rotate as rotate_log
from octoform.endpoint.published_files import read_manifest
from octoform.patterns import regex
from octoform.state.artifact_cache import read_instances, write_instances
from octoform.state.files import mount_point
from octoform.state.layout import Layout
from octoform.state.store.lock import Waiting, acquire

WANTED = 128_000_000
"""Bytes of room at which nothing more is dropped; twice of what counts as a full disk."""
YOUNG_SECONDS = 3600.0
"""An attempt that was touched since then may be under way."""
ATTEMPTS_KEPT = 2
"""The last ones of each stage stay: they say how what is accepted came to be."""
_NAMES = ("environment", "previous_environment")
_ATTEMPT = regex(r"\d+-(?P<stage>.+)-\d+")


def free(layout: Layout, wanted: int = WANTED) -> RepairOutcome:
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
        return RepairOutcome.done("rotate.freed", text)
    return RepairOutcome.failed("rotate.disk-full", f"{text}; free some space on that disk", again=False)


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


def rotate(layout: Layout, name: str) -> RepairOutcome:
    """Archive the log ``name`` of a host; what the system refuses is reported."""
    path = layout.logs / Path(name).name
    if path.is_symlink():
        return RepairOutcome.refused("rotate.link", f"{path.name} is a link, which is left alone", again=False)
    try:
        size = rotate_log(path, held_open=path == layout.server_log)
    except FileNotFoundError:
        return RepairOutcome.done("rotate.no-log", f"there is no {path.name}")
    except OSError as problem:
        where = mount_point(path.parent)
        text = f"{path.name} cannot be moved away: {problem.strerror or problem} (on {where})"
        return RepairOutcome.failed("rotate.not-moved", text)
    return RepairOutcome.done("rotate.moved", f"{path.name} ({size // 1000} kB) was moved to {path.name}.1")


LOCK_SECONDS = 20.0
WEAK = "weak"
_ORDINAL = regex(r"-\d+$")

Where = Callable[[Sequence[str]], Mapping[str, Mapping[str, Any]] | None]
"""Device ids to the runtime's facts of each, as `octoform.runtime.where` reports them; None: it does not answer."""


def rebind(layout: Layout, device: str, where: Where | None = None) -> RepairOutcome:
    """Write down where a device is; what is in doubt is left as it is."""
    acquired = acquire(layout, "rebind", Waiting(timeout=LOCK_SECONDS))
    if acquired.lock is None:
        return RepairOutcome.refused("rebind.locked", acquired.diagnostics[0].summary)
    with acquired.lock:
        return _bound(layout, device, where or Asked(layout, os.environ))


def _bound(layout: Layout, device: str, where: Where) -> RepairOutcome:
    ledger, _ = read_instances(layout)
    known = (ledger or {}).get(device)
    if ledger is None or not isinstance(known, dict):
        text = f"{device} is not known on this machine; octoform apply -replace probe"
        return RepairOutcome.refused("rebind.unknown", text, again=False)
    answers = where([device])
    found = (answers or {}).get(device)
    if found is None:
        return RepairOutcome.refused("rebind.no-answer", f"where {device} is cannot be determined now")
    if not found["attached"]:
        return RepairOutcome.refused("rebind.not-attached", f"{device} is not attached")
    if found["doubt"]:
        return RepairOutcome.refused("rebind.doubt", f"it is left as it was: {found['doubt']}", again=False)
    if found["strength"] == WEAK and (twin := _twin(device, ledger)):
        text = f"{device} is found because it is what is left over beside {twin}, which is equal; not written down"
        text = f"{text}; octoform apply -replace probe settles it"
        return RepairOutcome.refused("rebind.twin", text, again=False)
    if (known.get("sysfs"), known.get("port")) == (found["sysfs"], found["port"]):
        return RepairOutcome.done("rebind.same", f"{device} is where it was written down: {found['port']}")
    problems = write_instances(layout, {**ledger, device: {**known, "sysfs": found["sysfs"], "port": found["port"]}})
    if problems:
        return RepairOutcome.failed("rebind.not-written", problems[0].summary)
    return RepairOutcome.done("rebind.moved", f"{device} is at {found['port']} now ({found['strength']} identity)")


def _twin(device: str, ledger: Mapping[str, object]) -> str | None:
    """Another id of the same kind."""
    kinds = {_ORDINAL.sub("", device), device}
    return next(
        (other for other in sorted(ledger) if other != device and {_ORDINAL.sub("", other), other} & kinds), None
    )
