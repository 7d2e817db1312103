"""Edited specs that wait for a person: what an agent made of a stage's spec in the last run that edited it.

They lie on the machine, not in git: an edit serves one run. ``octoform spec`` shows, promotes or drops them. (Heavy:
pydantic.)
"""

from typing import Literal

from pydantic import ValidationError

from octoform.diagnostics import Diagnostic
from octoform.protocol.model import DUTIES
from octoform.state.files import read_regular, write_atomic
from octoform.state.layout import STAGES, STEP, Layout
from octoform.state.model import Persisted

MOST_BYTES = 512 * 1024


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


def keep(layout: Layout, edit: PendingEdit) -> Diagnostic | None:
    """Keep an edit in place of the stage's former one; None when it stands."""
    path = layout.spec_edit(edit.stage)
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    return write_atomic(path, edit.model_dump_json(indent=1).encode() + b"\n", 0o600)


def read(layout: Layout, stage: str) -> PendingEdit | None:
    """The waiting edit of a stage; None when there is none that can be read."""
    data, _ = read_regular(layout.spec_edit(stage), MOST_BYTES)
    try:
        return PendingEdit.model_validate_json(data) if data is not None else None
    except ValidationError:
        return None


def waiting(layout: Layout) -> list[PendingEdit]:
    """Every waiting edit, in the order of the stages, then of duties, those of privileged steps last."""
    steps = sorted(path.stem for path in layout.spec_edits.glob(f"{STEP}*.json"))
    return [edit for edit in (read(layout, stage) for stage in (*STAGES, *DUTIES, *steps)) if edit is not None]


def drop(layout: Layout, stage: str) -> None:
    """Forget the edit of a stage."""
    layout.spec_edit(stage).unlink(missing_ok=True)
