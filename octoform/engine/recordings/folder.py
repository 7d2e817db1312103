"""The folder of a recording on disk: written as a whole, and never in place of anything else that lies there."""

import os
import re
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

from octoform.base.files import TEMPORARY, replace, sync_folder
from octoform.diagnostics import Diagnostic, error
from octoform.harness.dialect import json_object
from octoform.harness.plainfile import read_plain
from octoform.harness.recording import FILE_NAME, MOST_BYTES, NAME
from octoform.state.files import refused, shown

_NAME = re.compile(NAME)


def check_target(target: Path) -> Diagnostic | None:
    """RECORD-FOLDER unless the folder is new, empty, or a recording and nothing else."""
    if target.is_symlink() or (target.exists() and not target.is_dir()):
        return _taken(target, "it is a link, or no folder")
    if not target.exists():
        return None
    try:
        names = sorted(_below(target))
    except OSError as problem:
        return refused(problem, target)
    if not names:
        return None
    document = json_object(read_plain(target / FILE_NAME, MOST_BYTES) or b"")
    if document is None or "format" not in document or "stages" not in document:
        return _taken(target, "it holds files and is no recording")
    strange = [name for name in names if name != FILE_NAME and not _NAME.fullmatch(name)]
    return _taken(target, f"it also holds {strange[0]}, which is not of a recording") if strange else None


def write(target: Path, files: Mapping[str, bytes]) -> Diagnostic | None:
    """Put the files, and only them, into the folder; None when they stand. What was there stays if that fails."""
    draft = target.with_name(f".{target.name}.{os.urandom(6).hex()}{TEMPORARY}")
    former = draft.with_name(f"{draft.name}-former")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        for name, data in files.items():
            path = draft / name
            path.parent.mkdir(parents=True, exist_ok=True)
            replace(path, data, 0o644)
        if target.exists():
            target.rename(former)
        draft.rename(target)
        sync_folder(target.parent)
    except OSError as problem:
        if former.exists() and not target.exists():
            former.rename(target)
        return refused(problem, target)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    shutil.rmtree(former, ignore_errors=True)
    return None


def _below(folder: Path) -> Iterator[str]:
    """Every file, link and empty folder below a folder."""
    for root, folders, names in os.walk(folder):
        here = Path(root)
        yield from ((here / name).relative_to(folder).as_posix() for name in names)
        yield from ((here / name).relative_to(folder).as_posix() for name in folders if (here / name).is_symlink())


def _taken(target: Path, why: str) -> Diagnostic:
    return error(
        "RECORD-FOLDER",
        "this folder is not overwritten",
        path=shown(target),
        detail=why,
        hint="name a new folder, or one that holds a recording and nothing else",
    )
