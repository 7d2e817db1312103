"""The record of one attempt: what was asked of an agent, what it used, how it ended and the gate's verdict.

It stands as ``attempt.json`` in the attempt's own folder, beside prompt, log, transcript and output. (Heavy: pydantic.)
"""

import json
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

from octoform.base.files import private_folder
from octoform.diagnostics import Diagnostic
from octoform.protocol.model import DUTIES
from octoform.state.files import read_regular, write_atomic
from octoform.state.layout import STAGES, STEP, Layout
from octoform.state.model import Persisted, Usage

FILE_NAME = "attempt.json"
MAX_BYTES = 1 << 20


class SpecEdit(Persisted):
    """An agent's edit of its copy of the spec; ``permitted`` is False when it was not asked to touch it."""

    digest: str
    permitted: bool
    added: int
    removed: int


class AttemptRecord(Persisted):
    """``number`` counts all attempts of a host, ``attempt`` those of a stage in one run; ``seconds`` are wall time.

    ``role`` is ``stage``, ``escalate`` for the agent that got what the first left unknown, or ``reuse`` for an output
    that was reused from another host (no agent ran; ``attempt`` is 0). ``checks`` is how often the agent held its
    output against the contract before it ended. ``diagnostics`` are as
    `octoform.diagnostics.to_json` gives them; ``files`` are what the agent left in its folder. ``digests`` are those of
    what the attempt was given and left, by the file's name: prompt, input, log, transcript, spec, output.
    ``changed`` is what had changed in the input of the accepted output that the attempt began with, if with any.
    """

    format: Literal[1] = 1
    number: int
    stage: str
    attempt: int
    role: str = "stage"
    harness: str
    model: str | None = None
    program: str | None = None
    started_at: str
    seconds: float
    reason: str
    exit_status: int | None = None
    detail: str = ""
    turns: int | None = None
    checks: int = 0
    usage: Usage = Field(default_factory=Usage)
    prompt_bytes: int = 0
    accepted: bool = False
    diagnostics: list[dict[str, Any]] = Field(default_factory=list)
    files: list[str] = Field(default_factory=list)
    digests: dict[str, str] = Field(default_factory=dict)
    changed: list[str] = Field(default_factory=list)
    spec_edit: SpecEdit | None = None
    survivors_killed: int = 0
    unconfined: str = ""


def write(folder: Path, record: AttemptRecord) -> Diagnostic | None:
    """Write the record into the attempt's folder; None when it stands."""
    text = json.dumps(record.model_dump(mode="json"), indent=1, ensure_ascii=False)
    return write_atomic(folder / FILE_NAME, f"{text}\n".encode("utf-8", "replace"), 0o600)


def read(folder: Path) -> AttemptRecord | None:
    """The record of an attempt; None while it runs, when it was interrupted, or when the file is none of ours."""
    data, _ = read_regular(folder / FILE_NAME, MAX_BYTES)
    try:
        return AttemptRecord.model_validate_json(data) if data is not None else None
    except ValidationError:
        return None


def folders(layout: Layout) -> list[Path]:
    """The attempts' folders, oldest first."""
    if not layout.attempts.is_dir():
        return []
    return sorted(path for path in layout.attempts.iterdir() if path.name.partition("-")[0].isdigit())


# Edited specs that wait for a person: what an agent made of a stage's spec in the last run that edited it.
#
# They lie on the machine, not in git: an edit serves one run. ``octoform spec`` shows, promotes or drops them. (Heavy:
# pydantic.)

MAX_EDIT_BYTES = 512 * 1024


class PendingEdit(Persisted):
    """``base`` is the digest of the spec that was edited, ``digest`` that of ``text``, which is the whole edited spec.

    ``attempt`` names the attempt's folder.
    """

    format: Literal[1] = 1
    stage: str
    base: str
    digest: str
    text: str
    attempt: str


def keep_edit(layout: Layout, edit: PendingEdit) -> Diagnostic | None:
    """Keep an edit in place of the stage's former one; None when it stands."""
    path = layout.spec_edit(edit.stage)
    private_folder(path.parent)
    return write_atomic(path, edit.model_dump_json(indent=1).encode() + b"\n", 0o600)


def read_edit(layout: Layout, stage: str) -> PendingEdit | None:
    """The waiting edit of a stage; None when there is none that can be read."""
    data, _ = read_regular(layout.spec_edit(stage), MAX_EDIT_BYTES)
    try:
        return PendingEdit.model_validate_json(data) if data is not None else None
    except ValidationError:
        return None


def waiting_edits(layout: Layout) -> list[PendingEdit]:
    """Every waiting edit, in the order of the stages, then of background tasks, those of privileged steps last."""
    steps = sorted(path.stem for path in layout.spec_edits.glob(f"{STEP}*.json"))
    return [edit for edit in (read_edit(layout, stage) for stage in (*STAGES, *DUTIES, *steps)) if edit is not None]


def drop(layout: Layout, stage: str) -> None:
    """Forget the edit of a stage."""
    layout.spec_edit(stage).unlink(missing_ok=True)
