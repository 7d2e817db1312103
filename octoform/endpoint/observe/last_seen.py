"""Keep what was just seen of the live endpoint, so that the next plan knows of it.

A plan starts nothing, so it can only tell a dead endpoint from a live one by what was seen last. Whoever asks the
endpoint therefore leaves word when it is other than the last check found it: a plan that still said "no changes"
after a person was told that the endpoint is down would lead nowhere.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime

from octoform.base import files
from octoform.endpoint.files import CHECK, read_manifest
from octoform.state.files import write_atomic
from octoform.state.layout import Layout


@dataclass(frozen=True, slots=True)
class Sight:
    """What was just seen: whether the endpoint answered, else why not, and the names of the tools that it listed."""

    answered: bool
    error: str | None = None
    tools: tuple[str, ...] = ()


def published(layout: Layout) -> str | None:
    """What tells one published endpoint from the next: the folder of its environment; None when there is none."""
    manifest = read_manifest(layout)
    return str(manifest["environment"]) if manifest and "environment" in manifest else None


def seen_of(tools: Iterable[str]) -> Sight:
    """An endpoint that answered with these tools."""
    return Sight(True, None, tuple(sorted(tools)))


def record_sight(layout: Layout, asked: str | None, sight: Sight) -> None:
    """Bring the record of the last check up to date where ``sight`` differs from it; the trial calls stay.

    ``asked`` is what was `published` when it was asked: when another is published meanwhile, its own check is the
    newer word. A record that cannot be written changes nothing for the person who asked, so that is no problem of
    theirs.
    """
    path = layout.endpoint / CHECK
    try:
        known = files.read_json(path)
    except (OSError, ValueError):
        return  # never checked: a plan says so already
    if not isinstance(known, dict) or published(layout) != asked:
        return
    seen = {"answered": sight.answered, "error": sight.error, "tools": list(sight.tools)}
    if {key: known.get(key) for key in ("answered", "tools")} == {key: seen[key] for key in ("answered", "tools")}:
        return
    document = {**known, **seen, "at": datetime.now(UTC).isoformat(timespec="seconds")}
    write_atomic(path, (json.dumps(document, indent=2) + "\n").encode(), 0o600)
