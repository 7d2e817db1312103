"""A recorded run: what the agents of each stage did, printed, wrote and used, so that it can be played again.

A folder with ``recording.json`` and the files that it names. It is made to be given away and to lie in git, so it holds
kinds only; and anyone who plays it takes it as data of a stranger: names stay below the folder, links are not followed.
(Heavy: pydantic.)
"""

import json
import os
import stat
from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError

from octoform.base.files import parse, record
from octoform.diagnostics import Diagnostic, error
from octoform.harness.port import ExitReason
from octoform.state.files import display, read_regular
from octoform.state.model import Persisted, Usage

FORMAT = 1
FILE_NAME = "recording.json"
MAX_BYTES = 4 << 20
MAX_FILE_BYTES = 16 << 20
NAME = r"^[a-z]+-[1-9][0-9]*/[A-Za-z0-9_][A-Za-z0-9._-]*$"


class Output(Persisted):
    """The recorded output of the attempt: the content of ``file``, or something that is no file.

    ``kind``: ``file``, ``link`` (or anything else that is no plain file), ``large`` (a file of ``size`` bytes, more
    than is ever read).
    """

    kind: Literal["file", "link", "large"] = "file"
    name: str = Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9._-]*$")
    file: str | None = Field(default=None, pattern=NAME)
    size: int | None = Field(default=None, ge=0, lt=1 << 40)


class Attempt(Persisted):
    """One attempt, as in its record; ``refused`` are the codes of the errors that it was refused with.

    ``output`` is None when it wrote none; ``spec_edit`` and ``transcript`` are names of files.
    """

    reason: ExitReason
    exit_status: int | None = None
    detail: str = ""
    seconds: float = 0.0
    turns: int | None = None
    usage: Usage = Field(default_factory=Usage)
    harness: str
    model: str | None = None
    program: str | None = None
    accepted: bool = False
    refused: list[str] = Field(default_factory=list)
    output: Output | None = None
    spec_edit: str | None = Field(default=None, pattern=NAME)
    transcript: str | None = Field(default=None, pattern=NAME)

    def files(self) -> list[str]:
        """The names of its files."""
        output = self.output.file if self.output is not None else None
        return [name for name in (output, self.spec_edit, self.transcript) if name is not None]


class Recording(Persisted):
    """Stage to its attempts, in their order; ``octoform`` is the version that wrote it."""

    format: Literal[1] = 1
    octoform: str
    stages: dict[str, list[Attempt]]

    def files(self) -> list[str]:
        """The names of all files of the recording, but for its own."""
        return sorted(name for attempts in self.stages.values() for attempt in attempts for name in attempt.files())

    def attempt(self, stage: str, number: int) -> Attempt | None:
        """The attempt ``number`` (from 1) of a stage, the last one for every later number; None where there is none."""
        attempts = self.stages.get(stage, [])
        return attempts[min(max(number, 1), len(attempts)) - 1] if attempts else None


def encode(recording: Recording) -> bytes:
    """The bytes of ``recording.json``: sorted, so that equal runs are equal files."""
    value = recording.model_dump(mode="json", exclude_none=True)
    return json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False).encode() + b"\n"


def load(folder: Path) -> Recording | Diagnostic:
    """The recording of a folder, all of its files there; or why it is none."""
    data, problem = read_regular(folder / FILE_NAME, MAX_BYTES)
    if data is None:
        return problem or _missing(folder)
    try:
        value = parse(data)
    except ValueError:
        return _broken(folder, "recording.json is not JSON")
    try:
        record(value, FORMAT)
    except ValueError as problem:
        return _broken(folder, str(problem))
    try:
        recording = Recording.model_validate_json(data)
    except ValidationError as refusal:
        first = refusal.errors()[0]
        return _broken(folder, f"{'.'.join(str(part) for part in first['loc'])}: {first['msg']}")
    gone = [name for name in recording.files() if not _plain(folder, name)]
    return _broken(folder, f"{gone[0]} is missing, or is no plain file") if gone else recording


def content(folder: Path, name: str) -> bytes | None:
    """The bytes of one of its files; None when it is gone, larger than any is, or no plain file below the folder."""
    if not _plain(folder, name):
        return None
    data, _ = read_regular(folder / name, MAX_FILE_BYTES)
    return data


def _plain(folder: Path, name: str) -> bool:
    """True for a plain file in a folder of its own; the pattern of names leaves no other way out of the recording."""
    path = folder / name
    try:
        inside = stat.S_ISDIR(os.lstat(path.parent).st_mode)
        return inside and stat.S_ISREG(os.lstat(path).st_mode)
    except OSError:
        return False


def _missing(folder: Path) -> Diagnostic:
    return error(
        "HARNESS-NO-RECORDING",
        "there is no recording in this folder",
        path=display(folder),
        hint="`octoform attempts record DIR` makes one of the last run",
    )


def _broken(folder: Path, what: str) -> Diagnostic:
    return error(
        "HARNESS-RECORDING-BROKEN",
        "this recording cannot be played",
        path=display(folder / FILE_NAME),
        detail=what,
        hint="record the run again with `octoform attempts record`",
    )
