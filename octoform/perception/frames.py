"""The record of the pictures: the last two, why there is none, and a summary that never grows.

A judge of a host gets this instead of a film: two pictures at most and a few lines. A look without a picture makes
the last one old at once: what a camera showed before states nothing about what it would show now. (Heavy: pydantic.)
"""

import base64
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from octoform.base.clock import epoch
from octoform.base.digest import of_bytes
from octoform.base.escaping import escaped
from octoform.base.files import move, private_folder
from octoform.base.locks import held_folder
from octoform.diagnostics import Diagnostic, error, has_errors, warning
from octoform.endpoint.client.jsonrpc import ending_of
from octoform.endpoint.published_files import not_ours
from octoform.perception.capture import (
    CHANGED,
    Complaint,
    Picture,
    Taken,
    complaint,
    difference,
    frozen,
    noisy,
    repeated,
)
from octoform.state.files import display, make_folders, read_regular, refused, write_atomic
from octoform.state.layout import Layout

MAX_CHANGES = 40
MAX_BYTES = 2048
"""Of all lines about changes together, in UTF-8."""
REASON_CHARS = 200


class _Kept(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Camera(_Kept):
    """A device and the call that takes its picture."""

    device: str
    tool: str
    arguments: dict[str, Any] = {}


class Frame(_Kept):
    """One picture: where it lies in the folder of frames, when it was taken and through which camera, what it shows.

    ``complaint`` is ``black`` or ``uniform``; ``difference`` compares it with the picture before of the same camera
    (None: there is none). ``repeats`` is how many pictures before it, the first at ``since``, had the very same pixels;
    ``frozen`` is None while it is not known whether the camera stands still. ``thumb`` is base64 of 48 rows of 64 grey
    bytes, ``pixels`` and ``grain`` are those of `Picture`.
    """

    file: str
    digest: str
    at: str
    camera: Camera
    mime: str
    size: int
    width: int
    height: int
    mean: float
    spread: float
    complaint: Complaint | None
    frozen: bool | None
    difference: float | None
    thumb: str
    pixels: str = ""
    grain: float = 0.0
    repeats: int = 0
    since: str | None = None

    @property
    def picture(self) -> Picture:
        """The figures that are compared."""
        return Picture(self.mean, self.spread, base64.b64decode(self.thumb), self.pixels, self.grain)

    @property
    def problem(self) -> str | None:
        """Why the picture shows nothing: ``black``, ``uniform``, ``frozen``; None for one that shows something."""
        return self.complaint or ("frozen" if self.frozen else None)

    @property
    def suspected(self) -> bool:
        """True when a sensor's picture came again and a few more are needed to find whether the camera is frozen."""
        return self.complaint is None and self.repeats > 0 and self.frozen is None and noisy(self.picture)


class Absence(_Kept):
    """No picture: since the look at ``since``, still so at ``last``; code and words of the last reason."""

    since: str
    last: str
    code: str
    reason: str


class Summary(_Kept):
    """Counts of looks since ``since``, and the last changes as short lines, the newest last."""

    since: str
    looks: int = 0
    absences: int = 0
    black: int = 0
    uniform: int = 0
    frozen: int = 0
    changes: tuple[str, ...] = ()


class Record(_Kept):
    """All that is kept of the looks at one host. While ``absent`` is set, ``current`` is None."""

    format: Literal[1] = 1
    current: Frame | None = None
    previous: Frame | None = None
    absent: Absence | None = None
    summary: Summary


def with_picture(record: Record | None, taken: Taken, camera: Mapping[str, Any], at: str) -> Record:
    """The record after a picture; ``camera`` is ``{"device", "tool", "arguments"}``, ``at`` the time (RFC 3339)."""
    known = record or Record(summary=Summary(since=at))
    before = known.current or known.previous
    frame = _frame(taken, Camera.model_validate(camera), at, before)
    summary = known.summary
    counted = {
        "looks": summary.looks + 1,
        **{name: getattr(summary, name) + (frame.problem == name) for name in ("black", "uniform", "frozen")},
        "changes": _bounded([*summary.changes, *_changes(known, before, frame)]),
    }
    previous = before.model_copy(update={"file": _name("previous", before.mime)}) if before else None
    return Record(current=frame, previous=previous, summary=summary.model_copy(update=counted))


def with_absence(record: Record | None, problem: Diagnostic, at: str) -> Record:
    """The record after a look without a picture: what was current is the last picture that there was."""
    known = record or Record(summary=Summary(since=at))
    since = known.absent.since if known.absent else at
    counted = {"looks": known.summary.looks + 1, "absences": known.summary.absences + 1}
    last = known.current
    previous = last.model_copy(update={"file": _name("previous", last.mime)}) if last else known.previous
    return Record(
        previous=previous,
        absent=Absence(since=since, last=at, code=problem.code, reason=reason_of(problem)),
        summary=known.summary.model_copy(update=counted),
    )


def reason_of(problem: Diagnostic) -> str:
    """A problem in one short line; text of a device or a tool is escaped in it."""
    words = f"{problem.summary}: {problem.detail}" if problem.detail else problem.summary
    flat = escaped(" ".join(words.split())).rstrip(".")
    return flat if len(flat) <= REASON_CHARS else flat[: REASON_CHARS - 1] + "…"


def words(record: Record) -> str:
    """The record in a few lines, at most 3 KB. Of the physical state it states nothing while no picture shows it."""
    summary = record.summary
    pictures = summary.looks - summary.absences
    counts = f"black {summary.black}, uniform {summary.uniform}, frozen {summary.frozen}"
    lines = [
        f"{summary.looks} looks since {summary.since}: {pictures} pictures ({counts}), {summary.absences} without."
    ]
    last = record.current or record.previous
    if record.absent is not None:
        unknown = f"since the picture of {last.at}" if last else "at any time"
        lines.append(f"No picture since {record.absent.since} because {record.absent.reason}.")
        lines.append(f"The physical state is unknown {unknown}.")
    elif last is not None and last.problem:
        lines.append(f"The picture of {last.at} through {last.camera.device} shows nothing: it is {last.problem}.")
        lines.append("The physical state is unknown.")
    elif last is not None:
        figures = f"mean {last.mean:g}, spread {last.spread:g}"
        compared = "" if last.difference is None else f", difference to the one before {last.difference:g}"
        lines.append(f"The picture of {last.at} through {last.camera.device}: {figures}{compared}.")
        lines += summary.changes
    return "\n".join(lines)


def _frame(taken: Taken, camera: Camera, at: str, before: Frame | None) -> Frame:
    alike = before if before is not None and before.camera == camera else None
    repeats, since = _repeats(alike, taken.picture, at)
    return Frame(
        file=_name("current", taken.mime),
        digest=of_bytes(taken.data),
        at=at,
        camera=camera,
        mime=taken.mime,
        size=len(taken.data),
        width=taken.width,
        height=taken.height,
        mean=taken.picture.mean,
        spread=taken.picture.spread,
        complaint=complaint(taken.picture),
        frozen=frozen(taken.picture, repeats, _seconds(since, at)) if alike else None,
        difference=difference(alike.picture, taken.picture) if alike else None,
        thumb=base64.b64encode(taken.picture.thumb).decode(),
        pixels=taken.picture.pixels,
        grain=taken.picture.grain,
        repeats=repeats,
        since=since,
    )


def _repeats(before: Frame | None, picture: Picture, at: str) -> tuple[int, str]:
    """How many pictures in a row had these pixels before, and since when."""
    if before is None or not repeated(before.picture, picture):
        return 0, at
    return before.repeats + 1, before.since or before.at


def _seconds(since: str, at: str) -> float:
    begin, end = epoch(since), epoch(at)
    return end - begin if begin is not None and end is not None else 0.0


def _changes(known: Record, before: Frame | None, frame: Frame) -> list[str]:
    """The changes for the summary: an absence that ended, a problem that came or went, another camera or scene."""
    found = []
    if known.absent is not None:
        found.append(f"{known.absent.since} to {frame.at}: no picture because {known.absent.reason}")
    if before is None:
        return [*found, f"{frame.at}: first picture through {frame.camera.device}"]
    if frame.camera != before.camera:
        found.append(f"{frame.at}: another view, {frame.camera.device}")
    if frame.problem != before.problem:
        found.append(f"{frame.at}: {frame.problem or 'it shows something again'}")
    elif frame.problem is None and frame.difference is not None and frame.difference >= CHANGED:
        found.append(f"{frame.at}: changed by {frame.difference:g}")
    return found


def _bounded(lines: list[str]) -> tuple[str, ...]:
    """The newest of the lines, as many as may be kept."""
    kept: list[str] = []
    size = 0
    for line in reversed(lines[-MAX_CHANGES:]):
        size += len(line.encode("utf-8", "surrogatepass")) + 1
        if size > MAX_BYTES:
            break
        kept.append(line)
    return tuple(reversed(kept))


def _name(stem: str, mime: str) -> str:
    return f"{stem}.{ending_of(mime)}"


# The folder of frames: at most two pictures and their record, on this machine alone, each written as a whole.
#
# Several may look at once (a person, a heartbeat), so the folder is locked for the moment in which it changes. A
# picture whose bytes are not those of its record is none: a run may have been killed between the two.

RECORD = "frames.json"
_STEMS = ("current.", "previous.", ".")


def read(layout: Layout) -> tuple[Record | None, list[Diagnostic]]:
    """The record of the last looks; (None, []) when no one has looked yet."""
    path = layout.frames / RECORD
    data, problem = read_regular(path)
    if data is None:
        return None, [problem] if problem is not None else []
    try:
        return Record.model_validate_json(data), []
    except ValidationError:
        summary = "this is no record of frames; it is begun again"
        return None, [warning("PERCEPTION-FRAMES", summary, path=display(path), hint="nothing has to be done")]


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
        move(old, new)
    except FileNotFoundError:
        return  # it was removed by hand; the record's digest shows it


def _sweep(folder: Path, record: Record) -> None:
    """Remove pictures that no record names: of another kind, or half written by a run that was killed."""
    names = {frame.file for frame in (record.current, record.previous) if frame is not None}
    for path in folder.iterdir():
        if path.name.startswith(_STEMS) and path.name not in names and not path.is_dir():
            path.unlink(missing_ok=True)


@contextmanager
def _locked(folder: Path) -> Iterator[Path]:
    """The folder for one writer at a time, closed to everybody else."""
    with held_folder(folder) as descriptor:
        os.fchmod(descriptor, 0o700)
        yield folder
