"""Rewrites of what moves a device, kept until a person has read them: one file for each, on this machine alone.

Limits are compared with the caller's arguments. Code between the caller and the device can make more of it (``steps *
10``), and no test by reading shows that: it would have to move. So a person decides whether such a rewrite is served.
"""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from octoform.apply.rewrite.scope import Unit, divided
from octoform.apply.stage.artifact_writer import text_of
from octoform.base import digest
from octoform.base.files import parse, record
from octoform.diagnostics import Diagnostic, error
from octoform.records import dataclass
from octoform.state.files import make_folders, read_regular, refused, spending, write_atomic
from octoform.state.layout import Layout

FOLDER = "rewrites"
KEEP = 16
_NAMES = ("id", "episode", "target", "tool", "moves", "at", "base", "source")


@dataclass(frozen=True, slots=True)
class Rewrite:
    """``moves`` are the actuating tools whose code it changes; ``base`` the text of the server that it was made of."""

    id: str
    episode: str
    target: str
    tool: str
    moves: str
    at: str
    base: str
    source: str

    def difference(self) -> list[str]:
        """Its changes, line by line."""
        before, after = self.base.splitlines(), self.source.splitlines()
        return list(difflib.unified_diff(before, after, "server.py", "server.py", lineterm=""))


def actuated(accepted: str, interface: Mapping[str, Any], functions: frozenset[str]) -> tuple[str, ...]:
    """The tools that move something and whose code these functions of the accepted server are, alone or with others."""
    units = divided(accepted, frozenset(item["name"] for item in interface["tools"])).inside
    acting = [item["name"] for item in interface["tools"] if item["effect"] != "read"]
    return tuple(name for name in acting if functions & _used_by(name, units))


def _used_by(tool: str, units: Sequence[Unit]) -> frozenset[str]:
    """The names of all that the code of a tool is made of, what it shares with other tools too."""
    found = [unit for unit in units if tool in unit.tools]
    for unit in found:  # grows while it is read
        found += [other for other in units if other not in found and other.names & unit.uses]
    return frozenset(name for unit in found for name in unit.names)


def identity_of(source: str) -> str:
    """The id under which a rewrite waits: the same for the same text."""
    return f"r{digest.short(digest.of_bytes(source.encode()))[:8]}"


def keep(layout: Layout, rewrite: Rewrite) -> Diagnostic | None:
    """Write it down; None when it is durable. The oldest give way."""
    problem = make_folders(layout)
    if problem is not None:
        return problem
    folder = layout.local / FOLDER
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        for path in sorted(folder.glob("*.json"), key=lambda path: path.stat().st_mtime)[: -KEEP + 1]:
            path.unlink(missing_ok=True)
    except OSError as refusal:
        return refused(refusal, folder)
    data = text_of({"format": 1, **asdict(rewrite)})
    return spending(layout, lambda: write_atomic(_path(layout, rewrite.id), data, 0o600))


def read(layout: Layout, identity: str) -> Rewrite | None:
    """The rewrite that waits under an id; None where none does, or its file is not whole."""
    found = _whole(_path(layout, identity))
    return found if found is not None and found.id == identity else None


def waiting(layout: Layout) -> list[Rewrite]:
    """All that wait, the oldest first."""
    kept = [found for path in (layout.local / FOLDER).glob("*.json") if (found := _whole(path)) is not None]
    return sorted(kept, key=lambda rewrite: (rewrite.at, rewrite.id))


def _whole(path: Path) -> Rewrite | None:
    """The rewrite of a file; None where it is not whole, or not what its id states."""
    data, _ = read_regular(path)
    try:
        fields = record(parse(data or b"{}"), 1)
        found = Rewrite(*(str(fields[name]) for name in _NAMES))
        whole = found.id == identity_of(found.source)
    except (ValueError, LookupError, TypeError):
        return None
    return found if whole else None


def forget(layout: Layout, identity: str) -> Diagnostic | None:
    """It waits no more; what the file system refused, else None."""
    try:
        _path(layout, identity).unlink(missing_ok=True)
    except OSError as refusal:
        return refused(refusal, _path(layout, identity))
    return None


def waits(rewrite: Rewrite) -> Diagnostic:
    """Why it is not in service."""
    return error(
        "HEAL-ACTUATES",
        f"the rewrite {rewrite.id} changes what moves a device ({rewrite.moves}), so it waits for a person",
        hint=f"octoform confirm {rewrite.id} shows what it changes and puts it in service; -reject drops it",
    )


def _path(layout: Layout, identity: str) -> Path:
    """An id comes from a person's command line: it is no part of a path."""
    return layout.local / FOLDER / f"{digest.short(digest.of_value(identity))}.json"
