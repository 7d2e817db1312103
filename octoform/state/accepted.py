"""The accepted artifacts on disk: put in place as a whole, and looked at without trusting what lies there.

Git checkouts, editors and stray processes all write into ``state/<host>``, so a stage's files are compared by name and
bytes with what was accepted; a link among them is never followed, whatever it points to. Light: every plan looks.
"""

import os
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from octoform.base import digest
from octoform.base.files import TEMPORARY, create, publish, sync_folder
from octoform.diagnostics import Diagnostic
from octoform.graph.model import key_of
from octoform.records import dataclass
from octoform.state.files import (
    Checkpoint,
    make_folders,
    pass_by,
    read_regular,
    refused,
    spending,
    unreadable,
)
from octoform.state.layout import STAGES, STEP, Layout

MAX_FILES = 1000


@dataclass(frozen=True, slots=True)
class FileFacts:
    """The accepted files of one stage.

    ``exists``: its main output is a regular file. ``digest`` is `file_digest` (None when anything is in the way),
    ``is_link`` shows that the folder or something in it is a symbolic link, ``problem`` why it cannot be read.
    """

    exists: bool
    digest: str | None
    is_link: bool
    problem: Diagnostic | None = None


def keyed(parts: Mapping[str, str]) -> dict[str, Any]:
    """The members of an accepted node's state about its inputs: their hash, and the parts that it is over."""
    return {"key": key_of(parts), "key_parts": dict(parts)}


class _LinkError(Exception):
    """A symbolic link among the files of a stage."""


def observe(layout: Layout) -> dict[str, FileFacts]:
    """The facts of every stage, and of every privileged step (``step.arm``) that left something; reads only."""
    return {stage: _facts(layout, stage) for stage in (*STAGES, *_steps(layout))}


def _steps(layout: Layout) -> list[str]:
    try:
        return sorted(f"{STEP}{path.name}" for path in layout.steps.iterdir() if not path.name.startswith("."))
    except OSError:
        return []  # there are none; what cannot be read is reported for the step that the state knows of


def _facts(layout: Layout, stage: str) -> FileFacts:
    output, folder = layout.output(stage), layout.folder(stage)
    if stage.startswith(STEP) and layout.steps.is_symlink():
        return FileFacts(False, None, True)
    try:
        names = _names(folder)
    except _LinkError:
        return FileFacts(False, None, True)
    except OSError as problem:
        return FileFacts(False, None, False, unreadable(problem, folder))
    if output.name not in names:
        return FileFacts(False, None, False)
    digests = {}
    for name in names:
        data, trouble = read_regular(folder / name)
        if data is None:
            return FileFacts(name != output.name, None, False, trouble)
        digests[name] = digest.of_bytes(data)
    return FileFacts(True, digest.of_value(digests), False)


def file_digest(layout: Layout, stage: str) -> str | None:
    """Digest over names and bytes of a stage's committed files; None when there is no output or a link among them."""
    return _facts(layout, stage).digest


def contents(layout: Layout, stage: str) -> dict[str, bytes] | None:
    """The committed files of a stage by relative name; None when one is a link or cannot be read."""
    folder, found = layout.folder(stage), {}
    try:
        names = _names(folder)
    except (_LinkError, OSError):
        return None
    for name in names:
        data, _ = read_regular(folder / name)
        if data is None:
            return None
        found[name] = data
    return found


def present(folder: Path) -> list[str]:
    """Relative names of all files and links in a stage's folder, sorted; empty where it cannot be read."""
    try:
        return sorted(path.relative_to(folder).as_posix() for path in _walk(folder))
    except OSError:
        return []


def _names(folder: Path) -> list[str]:
    """Relative names of the files in a stage's folder, sorted; `_LinkError` when one is a link."""
    if folder.is_symlink():
        raise _LinkError(folder)
    names = []
    for path in _walk(folder) if folder.is_dir() else ():
        if path.is_symlink():
            raise _LinkError(path)
        names.append(path.relative_to(folder).as_posix())
        if len(names) > MAX_FILES:
            raise OSError(None, f"more than {MAX_FILES} files lie here")
    return sorted(names)


def _walk(folder: Path) -> Iterator[Path]:
    """Every file and link below a folder, without what Python, editors and octoform leave beside the files proper."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith(".") or entry.name == "__pycache__":
                continue
            if entry.is_dir(follow_symlinks=False):
                yield from _walk(folder / entry.name)
            else:
                yield folder / entry.name


def accept(
    layout: Layout, stage: str, files: Mapping[str, bytes], checkpoint: Checkpoint = pass_by
) -> list[Diagnostic]:
    """Make ``files`` (relative name to bytes) the files of a stage, and the only ones; empty list when that is done.

    All are written and synced to a draft first, so a full disk or a kill before the first rename changes nothing; a
    kill between two renames leaves a node that the journal calls interrupted. A link in the way is replaced, never
    followed. Checkpoints: ``artifact.start``, ``artifact.written``, ``artifact.renamed``, ``artifact.done``.
    """
    for name in files:
        _check_name(name)
    if layout.output(stage).name not in files:
        raise ValueError(f"the files of {stage} lack {layout.output(stage).name}")
    problem = make_folders(layout)
    problem = problem or spending(layout, lambda: _replace(layout, stage, files, checkpoint))
    return [problem] if problem is not None else []


def _check_name(name: str) -> None:
    path = PurePosixPath(name)
    plain = path.as_posix() == name != "." and not path.is_absolute() and "\0" not in name
    if not plain or any(part.startswith(".") or part == "__pycache__" for part in path.parts):
        raise ValueError(f"no name for an artifact: {name!r}")


def _replace(layout: Layout, stage: str, files: Mapping[str, bytes], checkpoint: Checkpoint) -> Diagnostic | None:
    folder = layout.folder(stage)
    draft = layout.committed / f".{stage}.{os.urandom(6).hex()}{TEMPORARY}"
    try:
        checkpoint("artifact.start")
        draft.mkdir()
        for number, data in enumerate(files.values()):
            create(draft / str(number), data, 0o644)
        checkpoint("artifact.written")
        _make_room(layout.steps if stage.startswith(STEP) else folder, folder, files)
        for number, name in enumerate(files):
            publish(draft / str(number), folder / name)
            checkpoint("artifact.renamed")
        _remove_others(folder, set(files))
        for place in {folder, folder.parent, layout.committed, *((folder / name).parent for name in files)}:
            sync_folder(place)
        checkpoint("artifact.done")
    except OSError as problem:
        return refused(problem, folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return None


def _make_room(above: Path, folder: Path, files: Mapping[str, bytes]) -> None:
    """Make the folders that the files need; a link or a file in a folder's place goes, and so does the reverse."""
    wanted = {above, folder}
    for name in files:
        wanted.update(folder / parent for parent in PurePosixPath(name).parents)
    for place in sorted(wanted):
        if place.is_symlink() or place.is_file():
            place.unlink()
        place.mkdir(exist_ok=True)
    for name in files:
        target = folder / name
        if target.is_dir() and not target.is_symlink():
            shutil.rmtree(target)


def _remove_others(folder: Path, wanted: set[str]) -> None:
    for path in list(_walk(folder)):
        if path.relative_to(folder).as_posix() not in wanted:
            path.unlink()
    for place in sorted((item for item in folder.rglob("*") if item.is_dir() and not item.is_symlink()), reverse=True):
        if place.name != "__pycache__" and not any(place.iterdir()):
            place.rmdir()
