"""Other hosts of the same repository whose accepted outputs may serve this one.

Artifacts hold kinds and no instances, so an output that was accepted under the very same key for another host is the
output that this host's agent would be asked for. It is code that will be run, so it comes from this repository alone:
not from another one that lies in it (a submodule, a clone, a worktree), nor from what git ignores. Looked up only when
an agent would have to run. (Heavy: pydantic, git.)
"""

import os
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path

from octoform.records import dataclass
from octoform.state.git_access import repository
from octoform.state.git_repository import kept
from octoform.state.layout import Layout
from octoform.state.model import NodeState, Status
from octoform.state.store.snapshot import read_snapshot

STAGES = ("identify", "interface", "serve", "deploy")
"""PROBE is omitted: it lists the instances of its own host, which no other host can."""
MAX_FOLDERS = 20_000
MAX_HOSTS = 1_000
MAX_DEPTH = 6


@dataclass(frozen=True, slots=True)
class ReusableOutput:
    """One accepted output of another host; ``serial`` is that of the state that vouches for it."""

    layout: Layout
    serial: int
    state: NodeState

    @property
    def host(self) -> str:
        """The name of the host that it was made for."""
        return self.layout.host


Donors = Mapping[str, Mapping[str, tuple[ReusableOutput, ...]]]
"""Stage to key to all that have it, always in the same order."""


def find(layout: Layout) -> Donors:
    """Every accepted output of the repository's other hosts (outside a repository: of the project's own ``state/``)."""
    own = Layout(layout.project.resolve(), layout.host)
    where = repository(own.project)
    folders = _folders(where.root) if where is not None else [own.project / "state"]
    others = [other for other in islice(_hosts(folders), MAX_HOSTS) if other != own]
    files = kept(own.project, [other.committed for other in others]) if where is not None else None
    found: dict[str, dict[str, tuple[ReusableOutput, ...]]] = {stage: {} for stage in STAGES}
    for other in others:
        for stage, donor in _reusable(other, files):
            had = found[stage].get(donor.state.key, ())
            found[stage][donor.state.key] = (*had, donor)
    return found


def _reusable(other: Layout, files: frozenset[Path] | None) -> Iterator[tuple[str, ReusableOutput]]:
    """The reusable outputs of a host; ``files`` are those that count (None: all)."""
    if files is not None and other.snapshot not in files:
        return
    snapshot, _ = read_snapshot(other)
    # A state that cannot be read is its own host's problem; here it only lends nothing.
    for stage in STAGES if snapshot is not None else ():
        state = snapshot.nodes.get(stage) if snapshot is not None else None
        if state is not None and _is_equal(state) and (files is None or other.output(stage) in files):
            yield stage, ReusableOutput(other, snapshot.serial if snapshot is not None else 0, state)


def _is_equal(state: NodeState) -> bool:
    """Whether the key covers all inputs of the output: a spec that an agent corrected is in no key."""
    accepted = state.status is Status.ACCEPTED and bool(state.key) and not state.tainted
    return accepted and "spec_edit" not in state.detail


def _hosts(folders: Iterable[Path]) -> Iterator[Layout]:
    """The hosts with a state in those of the folders that are called ``state``."""
    for folder in folders:
        if folder.name != "state" or folder.is_symlink():
            continue
        for name in _within(folder):
            host = Layout(folder.parent, name)
            foreign = os.path.lexists(host.committed / ".git")
            if not foreign and os.access(host.snapshot, os.R_OK):
                yield host


def _within(folder: Path) -> list[str]:
    """The names of the folders in it, links omitted; none where it is not there or no one may look."""
    try:
        with os.scandir(folder) as entries:
            return sorted(entry.name for entry in entries if entry.is_dir(follow_symlinks=False))
    except OSError:
        return []


def _folders(root: Path) -> Iterator[Path]:
    """The repository's visible folders in a fixed order, bounded in number and depth; links are not followed."""
    left = MAX_FOLDERS
    for place, names, files in os.walk(root):
        folder = Path(place)
        foreign = folder != root and (".git" in names or ".git" in files)
        depth = len(folder.relative_to(root).parts)
        names[:] = sorted(name for name in names if not name.startswith(".") and name != "node_modules")
        if foreign or depth >= MAX_DEPTH or folder.name == "state":
            names.clear()
        left -= 1
        if left < 0:
            return
        if not foreign:
            yield folder
