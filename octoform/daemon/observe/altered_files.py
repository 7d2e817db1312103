"""Compares the endpoint's files with what was accepted and published; hashed only after a change. (Light.)

Names, sizes and times of a few hundred files say whether there is anything to hash, so that a look which finds nothing
new costs a millisecond.
"""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from octoform.base import digest
from octoform.base.files import read, walk
from octoform.endpoint.drift import observe
from octoform.endpoint.environment.model import MARKER, at, intact, packages_of
from octoform.endpoint.published_files import PACKAGES, read_manifest
from octoform.records import dataclass, field
from octoform.state.accepted import FileFacts, file_digest, present
from octoform.state.accepted import observe as observe_artifacts
from octoform.state.artifact_cache import kept
from octoform.state.layout import Layout
from octoform.state.store.quick_read import peek

MISSING, CHANGED, LINK, FOREIGN = "missing", "changed", "link", "foreign"
_NOT_RUNNING = "the endpoint is not running"
_MAX_FILES = 5000


@dataclass(frozen=True, slots=True)
class IntegrityReport:
    """``endpoint`` and ``environment`` are plain reasons; ``damaged`` paths below the project with what is wrong."""

    endpoint: tuple[str, ...] = ()
    environment: tuple[str, ...] = ()
    damaged: Mapping[str, str] = field(default_factory=dict)


class Standing:
    """Looks at one deployment again and again."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._signature: object = None
        self._last = IntegrityReport()
        self.hashed = 0
        """How often files were read and not only looked at."""

    def __call__(self) -> IntegrityReport:
        """How it stands now."""
        manifest = read_manifest(self._layout)
        signature = (self._signed(manifest), None if manifest is None else digest.of_value(manifest))
        if signature != self._signature:
            self._last = self._compared(manifest)
            self._signature = signature
            self.hashed += 1
        return self._last

    def _compared(self, manifest: Mapping[str, Any] | None) -> IntegrityReport:
        environment = _environment(manifest)
        reasons = observe(self._layout).reasons if manifest is not None else ()
        endpoint = [each for each in reasons if each != _NOT_RUNNING and each not in environment]
        return IntegrityReport(tuple(endpoint), environment, dict(damaged(self._layout)))

    def _signed(self, manifest: Mapping[str, Any] | None) -> tuple[object, ...]:
        layout = self._layout
        places: list[Path] = [layout.project / "state", layout.instances, layout.journal]
        if manifest is not None:
            environment = Path(str(manifest.get("environment")))
            places += [environment / MARKER, environment / "bin" / "python", packages_of(environment)]
        folders = (layout.committed, layout.endpoint, *PACKAGES)
        return (*map(_stamp, places), *(stamp for folder in folders for stamp in _stamps(folder)))


def damaged(layout: Layout) -> Iterator[tuple[str, str]]:
    """(path, what is wrong) of accepted files; nothing while the state is being changed or was never written."""
    state = peek(layout)
    if state is None:
        yield from _state(layout)
        return
    facts = observe_artifacts(layout)
    for stage, node in state["nodes"].items():
        wanted = node.get("file_digest") if isinstance(node, dict) else None
        if not wanted:  # the endpoint has no artifact
            continue
        found = facts.get(stage) or FileFacts(False, file_digest(layout, stage), False)
        if found.digest != wanted:
            yield from _files(layout, stage, str(wanted), found)
    if "probe" in state["nodes"] and not os.path.lexists(layout.instances):
        yield _below(layout, layout.instances), MISSING


def _state(layout: Layout) -> Iterator[tuple[str, str]]:
    """The damage of the state file, when no journal waits to be folded into it."""
    try:
        if layout.journal.stat(follow_symlinks=False).st_size > 0:
            return
    except OSError:
        pass  # no journal: the state file alone counts
    if layout.snapshot.is_symlink():
        yield _below(layout, layout.snapshot), LINK
    elif layout.snapshot.exists():
        yield _below(layout, layout.snapshot), CHANGED
    elif read_manifest(layout) is not None:
        yield _below(layout, layout.snapshot), MISSING


def _files(layout: Layout, stage: str, wanted: str, found: FileFacts) -> Iterator[tuple[str, str]]:
    """The very files where a copy of them is kept; else the stage's output stands for all of them."""
    accepted, folder = kept(layout, stage, wanted), layout.folder(stage)
    named: dict[str, str] = {}
    if accepted is not None and not folder.is_symlink():
        named = dict(_differing(layout, folder, accepted))
        # Which lie there beside what was accepted; whose they are is not known.
        named |= {_below(layout, folder / name): FOREIGN for name in present(folder) if name not in accepted}
    if not named:
        how = LINK if found.is_link else CHANGED if found.exists else MISSING
        named = {_below(layout, layout.output(stage)): how}
    yield from named.items()


def _differing(layout: Layout, folder: Path, accepted: Mapping[str, bytes]) -> Iterator[tuple[str, str]]:
    for name, data in accepted.items():
        path = folder / name
        if path.is_symlink():
            yield _below(layout, path), LINK
            continue
        try:
            same = read(path) == data
        except FileNotFoundError:
            yield _below(layout, path), MISSING
            continue
        except OSError:
            same = False
        if not same:
            yield _below(layout, path), CHANGED


def _environment(manifest: Mapping[str, Any] | None) -> tuple[str, ...]:
    if manifest is None:
        return ()
    environment = at(Path(str(manifest.get("environment"))))
    return ("the serving environment is missing",) if environment is None else tuple(intact(environment))


def _below(layout: Layout, path: Path) -> str:
    return path.relative_to(layout.project).as_posix()


def _stamps(folder: Path) -> Iterator[object]:
    count = 0
    for root, folders, names in walk(folder):
        folders[:] = sorted(name for name in folders if name != "__pycache__" and not name.startswith("."))
        yield _stamp(root, own=False)
        for name in sorted(names):
            count += 1
            if count > _MAX_FILES:
                return
            yield _stamp(root / name)


def _stamp(path: Path, *, own: bool = True) -> object:
    """The stamp that changes with a file: its number, size, mode and times; of a folder only the name."""
    if not own:
        return str(path)
    try:
        found = os.lstat(path)
    except OSError:
        return str(path), None
    return str(path), found.st_ino, found.st_size, found.st_mode, found.st_mtime_ns, found.st_ctime_ns
