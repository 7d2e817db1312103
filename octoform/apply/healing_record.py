"""What a repair has replaced, kept until nobody can want it back: one file for each episode, on this machine alone.

The copy is written before anything of the artifacts changes, by octoform and not by the agent. Several repairs of one
episode are one way back: to the server that was accepted when the episode began.
"""

from dataclasses import asdict, dataclass
from pathlib import Path

from octoform import digest
from octoform.apply.settling import text_of
from octoform.base.files import parse
from octoform.diagnostics import Diagnostic
from octoform.state.disk_reserve import spending
from octoform.state.files import make_folders, read_regular, refused, write_atomic
from octoform.state.layout import Layout

FOLDER = "healed"
KEEP = 8
DAMAGED = ".damaged"


@dataclass(frozen=True, slots=True)
class Healed:
    """The repair of an episode: digests of the server before it and after it, and the text of the one before."""

    episode: str
    at: str
    tool: str
    base: str
    digest: str
    source: str


def keep(layout: Layout, healed: Healed) -> Diagnostic | None:
    """Write the copy down; None when it is durable. A former repair of the episode keeps its older way back."""
    former = read(layout, healed.episode)
    if former is not None and former.digest == healed.base:
        healed = Healed(healed.episode, healed.at, healed.tool, former.base, healed.digest, former.source)
    problem = make_folders(layout)
    if problem is not None:
        return problem
    folder = layout.local / FOLDER
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        stale = sorted(folder.glob("*.json"), key=lambda path: path.stat().st_mtime)[: -KEEP + 1]
        for path in stale:
            path.unlink(missing_ok=True)
    except OSError as refusal:
        return refused(refusal, folder)
    path = _path(layout, healed.episode)
    return spending(layout, lambda: write_atomic(path, text_of({"format": 1, **asdict(healed)}), 0o600))


def read(layout: Layout, episode: str) -> Healed | None:
    """The repair of an episode; None where there is none, or what is there is not whole (it is set aside then)."""
    path = _path(layout, episode)
    data, _ = read_regular(path)
    if data is None:
        return None
    try:
        told = parse(data)
        names = ("episode", "at", "tool", "base", "digest", "source")
        found = Healed(*(str(told[name]) for name in names))
        whole = told["format"] == 1 and found.episode == episode
    except (ValueError, LookupError, TypeError):
        found, whole = None, False
    if found is not None and whole and digest.of_bytes(found.source.encode()) == found.base:
        return found
    path.replace(path.with_suffix(DAMAGED))
    return None


def _path(layout: Layout, episode: str) -> Path:
    """An episode's id comes from outside: it is no part of a path."""
    return layout.local / FOLDER / f"{digest.short(digest.of_value(episode))}.json"
