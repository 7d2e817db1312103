"""The folder of frames: at most two pictures and their record, on this machine alone, each written as a whole.

Several may look at once (a person, a heartbeat), so the folder is locked for the moment in which it changes. A picture
whose bytes are not those of its record is none: a run may have been killed between the two.
"""

import fcntl
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from octoform.diagnostics import Diagnostic, error, has_errors, warning
from octoform.digest import of_bytes
from octoform.endpoint.files import not_ours, private_folder
from octoform.perception.capture import Taken
from octoform.perception.frames import Frame, Record, with_absence, with_picture
from octoform.state.files import make_folders, read_regular, refused, shown, write_atomic
from octoform.state.layout import Layout

RECORD = "frames.json"
_STEMS = ("current.", "previous.", ".")


def read(layout: Layout) -> tuple[Record | None, list[Diagnostic]]:
    """The record of the last looks; (None, []) when nobody has looked yet."""
    path = layout.frames / RECORD
    data, problem = read_regular(path)
    if data is None:
        return None, [problem] if problem is not None else []
    try:
        return Record.model_validate_json(data), []
    except ValidationError:
        summary = "this is no record of frames; it is begun anew"
        return None, [warning("PERCEPTION-FRAMES", summary, path=shown(path), hint="nothing has to be done")]


def keep(
    layout: Layout, camera: Mapping[str, Any], outcome: Taken | Diagnostic, at: str
) -> tuple[Record | None, list[Diagnostic]]:
    """Note a look: its picture, or why there is none; gives the record after it, None where it cannot be kept.

    ``camera`` is ``{"device", "tool", "arguments"}``, ``at`` the time of the look (RFC 3339, UTC).
    """
    if trouble := not_ours(layout.frames):
        return None, [error("PERCEPTION-FRAMES", "frames cannot be kept", detail=trouble, hint="remove what is there")]
    if (unmade := make_folders(layout)) is not None:
        return None, [unmade]
    try:
        with _locked(private_folder(layout.frames)) as folder:
            return _kept(layout, folder, camera, outcome, at)
    except OSError as problem:
        return None, [refused(problem, layout.frames)]


def picture_of(layout: Layout, frame: Frame) -> bytes | None:
    """The bytes of a kept picture; None when they are gone or are those of another one."""
    data, _ = read_regular(layout.frames / frame.file)
    return data if data is not None and of_bytes(data) == frame.digest else None


def _kept(
    layout: Layout, folder: Path, camera: Mapping[str, Any], outcome: Taken | Diagnostic, at: str
) -> tuple[Record | None, list[Diagnostic]]:
    known, found = read(layout)
    if has_errors(found):
        return None, found
    new = (
        with_absence(known, outcome, at)
        if isinstance(outcome, Diagnostic)
        else with_picture(known, outcome, camera, at)
    )
    if known is not None and known.current is not None and new.previous is not None:
        _moved(folder / known.current.file, folder / new.previous.file)
    problem = None
    if isinstance(outcome, Taken) and new.current is not None:
        problem = write_atomic(folder / new.current.file, outcome.data, 0o600)
    text = new.model_dump_json(indent=1) + "\n"
    problem = problem or write_atomic(folder / RECORD, text.encode("utf-8", "surrogatepass"), 0o600)
    if problem is not None:
        return None, [*found, problem]
    _sweep(folder, new)
    return new, found


def _moved(old: Path, new: Path) -> None:
    try:
        old.replace(new)
    except FileNotFoundError:
        return  # it was removed by hand; the record's digest tells


def _sweep(folder: Path, record: Record) -> None:
    """Remove pictures that no record tells of: of another kind, or half written by a run that was killed."""
    told = {frame.file for frame in (record.current, record.previous) if frame is not None}
    for path in folder.iterdir():
        if path.name.startswith(_STEMS) and path.name not in told and not path.is_dir():
            path.unlink(missing_ok=True)


@contextmanager
def _locked(folder: Path) -> Iterator[Path]:
    """The folder for one writer at a time, closed to everybody else."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        os.fchmod(descriptor, 0o700)
        yield folder
    finally:
        os.close(descriptor)
