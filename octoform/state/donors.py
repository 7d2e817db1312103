"""Other hosts of the same repository whose accepted outputs may serve this one.

Artifacts hold kinds and no instances, so an output that was accepted under the very same key for another host is the
output that this host's agent would be asked for. Looked up only when an agent would have to run. (Heavy: pydantic.)
"""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from octoform.state.layout import Layout
from octoform.state.model import NodeState, Status
from octoform.state.reader import read_snapshot
from octoform.state.revision import repository

STAGES = ("identify", "interface", "serve", "deploy")
"""PROBE is left out: it tells the instances of its own host, which no other host can."""
MOST_FOLDERS = 20_000
MOST_HOSTS = 1_000
DEEPEST = 6


@dataclass(frozen=True, slots=True)
class Donor:
    """One accepted output of another host; ``serial`` is that of the state that vouches for it."""

    layout: Layout
    serial: int
    state: NodeState

    @property
    def host(self) -> str:
        """The name of the host that it was made for."""
        return self.layout.host


Donors = Mapping[str, Mapping[str, Donor]]
"""Stage to key to donor."""


def find(layout: Layout) -> Donors:
    """Every accepted output of the other hosts of the repository (of the project, outside a repository)."""
    found: dict[str, dict[str, Donor]] = {stage: {} for stage in STAGES}
    where = repository(layout.project)
    for other in _others(where.root if where is not None else layout.project, layout):
        snapshot, _ = read_snapshot(other)
        # A state that cannot be read is its own host's problem; here it only lends nothing.
        for stage in STAGES if snapshot is not None else ():
            state = snapshot.nodes.get(stage) if snapshot is not None else None
            if state is not None and state.status is Status.ACCEPTED and state.key and not state.tainted:
                found[stage].setdefault(state.key, Donor(other, snapshot.serial if snapshot else 0, state))
    return found


def _others(root: Path, own: Layout) -> Iterator[Layout]:
    hosts = 0
    for folder in _folders(root):
        if folder.name != "state":
            continue
        for place in sorted(folder.iterdir()):
            other = Layout(folder.parent, place.name)
            if place.is_dir() and not place.is_symlink() and other.snapshot.is_file() and other != own:
                hosts += 1
                if hosts > MOST_HOSTS:
                    return
                yield other


def _folders(root: Path) -> Iterator[Path]:
    """The visible folders below ``root`` in a fixed order, bounded in number and depth; links are not followed."""
    left = MOST_FOLDERS
    for place, names, _ in os.walk(root):
        depth = len(Path(place).relative_to(root).parts)
        names[:] = sorted(name for name in names if not name.startswith(".") and name != "node_modules")
        if depth >= DEEPEST or Path(place).name == "state":
            names.clear()
        left -= 1
        if left < 0:
            return
        yield Path(place)
