"""The revision that a folder's repository is at, read from git's own files.

A plan names the revision it reads; starting git or importing a library for that would cost more than the rest of a plan
with nothing to do. What these files do not have (an unborn branch, a ref store of another kind) is None. Light.
"""

import os
import re
from pathlib import Path

from octoform.base.files import head, read
from octoform.records import dataclass

_REVISION = re.compile(r"^(?:[0-9a-f]{40}|[0-9a-f]{64})$")
_DEPTH = 5


def head_revision(project: Path) -> str | None:
    """The commit that HEAD names in the repository that holds ``project``; None outside one or before the first."""
    found = repository(project)
    if found is None:
        return None
    folder = found.folder
    text = _line(folder / "HEAD")
    for _ in range(_DEPTH):
        if text is None or _REVISION.match(text):
            return text
        if not text.startswith("ref: ") or ".." in text:
            return None
        text = _reference(folder, text.removeprefix("ref: ").strip())
    return None


def on_branch(folder: Path) -> bool:
    """Whether a repository's own folder names a branch as HEAD: a commit then moves that, and leaves the name."""
    return (_line(folder / "HEAD") or "").startswith("ref: ")


@dataclass(frozen=True, slots=True)
class Repository:
    """``root`` is the top of the working tree, ``folder`` where git keeps its files for it."""

    root: Path
    folder: Path


def repository(project: Path) -> Repository | None:
    """The nearest repository with a working tree at or above ``project``; a ``.git`` file is followed."""
    start = project.resolve()
    for place in (start, *start.parents):
        entry = place / ".git"
        if not os.path.lexists(entry):
            continue
        if (entry / "HEAD").is_file():
            return Repository(place, entry)
        target = _line(entry)
        if target is not None and target.startswith("gitdir: "):
            folder = place / target.removeprefix("gitdir: ")
            return Repository(place, folder) if (folder / "HEAD").is_file() else None
    return None


def _reference(folder: Path, name: str) -> str | None:
    """A ref's text: of this worktree, else of the repository that it shares, loose before packed."""
    shared = _line(folder / "commondir")
    common = folder / shared if shared is not None else folder
    return _line(folder / name) or _line(common / name) or _packed(common, name)


def _packed(common: Path, name: str) -> str | None:
    try:
        for line in read(common / "packed-refs").decode("utf-8", "replace").splitlines():
            revision, _, ref = line.partition(" ")
            if ref == name and _REVISION.match(revision):
                return revision
    except OSError:
        return None  # no packed refs
    return None


def _line(path: Path) -> str | None:
    """The first line of a small file, or None when it is not there."""
    try:
        return head(path, 4096, follow=True).decode("utf-8", "replace").partition("\n")[0].strip() or None
    except OSError:
        return None
