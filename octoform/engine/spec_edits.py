"""Edited specs: what an agent made of its instructions in a run, shown, made permanent, or dropped. (Heavy.)

An edit serves the run in which it was made. Only a person makes it part of ``protocol/``; and since the accepted
output was made with exactly that text, promoting it makes nothing again.
"""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from octoform.apply.stage.spec_copy import unified
from octoform.base import digest, files
from octoform.base.escaping import is_hidden
from octoform.diagnostics import Diagnostic, did_you_mean, error, has_errors
from octoform.engine.inspect.state import Found, change, open_project
from octoform.engine.plan.configuration import Compiled
from octoform.protocol import DUTIES, STAGES, STEP, Spec, own_path, step_paths
from octoform.protocol.spec_loader import load_one, load_step
from octoform.records import dataclass, replace
from octoform.state import attempts
from octoform.state.accepted import keyed
from octoform.state.attempts import PendingEdit
from octoform.state.files import write_atomic
from octoform.state.model import NodeState


@dataclass(frozen=True, slots=True)
class EditView:
    """A waiting edit beside the spec of today.

    ``diff`` are the lines of a unified diff. ``moved``: the spec is no longer the one that was edited. ``accepted``:
    the stage's accepted output was made with it.
    """

    stage: str
    path: str
    diff: tuple[str, ...]
    attempt: str
    accepted: bool
    moved: bool


def waiting(
    project: Path, environ: Mapping[str, str], stage: str | None
) -> tuple[tuple[EditView, ...] | None, list[Diagnostic]]:
    """Every waiting edit, or that of one stage; None with the reason when the project or the name is wrong."""
    opened, found = open_project(project, environ)
    found += _unknown(project, stage)
    if opened is None or has_errors(found):
        return None, found
    known = opened.compiled.specs
    edits = [
        edit
        for edit in attempts.waiting_edits(opened.compiled.layout)
        if edit.stage in known and stage in (None, edit.stage)
    ]
    return tuple(_view_of(opened, edit) for edit in edits), found


def promote(project: Path, environ: Mapping[str, str], stage: str) -> list[Diagnostic]:
    """Write the edit into the project's ``protocol/``; an output that was made with it stays accepted."""

    def step(opened: Found) -> list[Diagnostic]:
        compiled = opened.compiled
        edit = attempts.read_edit(compiled.layout, stage)
        if edit is None:
            return [_nothing(stage)]
        spec = compiled.specs.get(stage)
        if spec is None:
            return [_switched_off(stage)]
        found = _unproved(opened, edit) + _in_the_way(spec, edit, project) + _illegal(compiled, edit)
        if has_errors(found):
            return found
        path = project / "protocol" / own_path(stage)
        for folder in dict.fromkeys((project / "protocol", path.parent)):
            if folder.is_symlink():
                return [_linked(folder)]
            folder.mkdir(exist_ok=True)
        problem = write_atomic(path, edit.text.encode("utf-8"))
        if problem is not None:
            return [problem]
        attempts.drop(compiled.layout, stage)
        known = opened.snapshot.nodes.get(stage)
        if known is None or not _made_with(known, edit):
            return []
        return opened.store.success(stage, _rekeyed(known, edit))

    return _unknown(project, stage) or change(project, environ, "spec promote", step)


def reset(project: Path, environ: Mapping[str, str], stage: str | None) -> tuple[tuple[str, ...], list[Diagnostic]]:
    """Drop the waiting edit of one stage, or of all; the stages whose edit is gone."""
    edits, found = waiting(project, environ, stage)
    if edits is None:
        return (), found
    if stage is not None and not edits:
        return (), [_nothing(stage)]

    def step(opened: Found) -> list[Diagnostic]:
        for edit in edits:
            attempts.drop(opened.compiled.layout, edit.stage)
        return []

    found = change(project, environ, "spec reset", step)
    return (() if has_errors(found) else tuple(edit.stage for edit in edits)), found


def _unknown(project: Path, stage: str | None) -> list[Diagnostic]:
    if stage is None or stage in (*STAGES, *DUTIES):
        return []
    known = (*STAGES, *DUTIES, *(f"{STEP}{name}" for name in step_paths(project / "protocol")))
    if stage in known:
        return []
    near = did_you_mean(stage, known)
    hint = f"did you mean {near}?" if near else f"there are {', '.join(known)}"
    return [error("SPEC-NO-STAGE", f"there is no stage {stage!r}", hint=hint)]


def _switched_off(stage: str) -> Diagnostic:
    summary = f"{stage} is not switched on, so its spec is not in use"
    return error("SPEC-NO-STAGE", summary, hint="name it under privileged_steps first")


def _nothing(stage: str) -> Diagnostic:
    hint = "`octoform spec diff` shows every edit that waits; `octoform attempts` what the agents did"
    return error("SPEC-NO-EDIT", f"no agent's edit of the spec of {stage} waits here", hint=hint)


def _view_of(opened: Found, edit: PendingEdit) -> EditView:
    spec, known = opened.compiled.specs[edit.stage], opened.snapshot.nodes.get(edit.stage)
    return EditView(
        stage=edit.stage,
        path=f"protocol/{own_path(edit.stage)}",
        diff=unified(spec.text, edit.text),
        attempt=edit.attempt,
        accepted=known is not None and _made_with(known, edit),
        moved=spec.digest != edit.base,
    )


def _linked(folder: Path) -> Diagnostic:
    summary = "protocol/ is a link; what an agent wrote is not put behind it"
    return error("STATE-LINK", summary, path=folder.name, hint="write the edit there by hand, if that is what you want")


def _unproved(opened: Found, edit: PendingEdit) -> list[Diagnostic]:
    """An edit counts when the record of its attempt, or the state, states that the agent was asked for it."""
    known = opened.snapshot.nodes.get(edit.stage)
    record = attempts.read(opened.compiled.layout.attempts / edit.attempt)
    made = record.spec_edit if record is not None and record.stage == edit.stage else None
    asked = made is not None and made.permitted and made.digest == edit.digest
    intact = digest.of_bytes(edit.text.encode("utf-8")) == edit.digest
    if intact and (asked or (known is not None and _made_with(known, edit))):
        return []
    summary = f"nothing shows that an agent was asked to edit the spec of {edit.stage}"
    hint = f"look at `octoform spec diff {edit.stage}`; `octoform spec reset {edit.stage}` drops it"
    return [error("SPEC-UNPROVED", summary, hint=hint)]


def _in_the_way(spec: Spec, edit: PendingEdit, project: Path) -> list[Diagnostic]:
    """A person's own change of the spec is never written over."""
    if spec.digest in (edit.base, edit.digest):
        return []
    summary = f"the spec of {edit.stage} has changed since the agent edited it"
    hint = f"copy by hand what `octoform spec diff {edit.stage}` shows, then `octoform spec reset {edit.stage}`"
    path = spec.path.relative_to(project) if spec.path.is_relative_to(project) else spec.path
    return [error("SPEC-MOVED", summary, path=str(path), hint=hint)]


def _illegal(compiled: Compiled, edit: PendingEdit) -> list[Diagnostic]:
    """Why the edited text is no spec of its stage (an agent may have spoilt the front matter)."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / own_path(edit.stage).name
        files.replace(path, edit.text.encode(), synced=False)
        if edit.stage in compiled.steps:
            _, found = load_step(compiled.steps[edit.stage].name, path, compiled.schemas.parent)
        else:
            _, found = load_one(edit.stage, path, compiled.schemas)
    if any(is_hidden(sign) and sign not in "\n\t\r" for sign in edit.text):
        summary = "the edited spec holds control, invisible or direction-changing characters"
        found.append(error("PROTOCOL-HIDDEN", summary, hint="copy by hand what is worth keeping"))
    return [replace(item, path=f"the edited spec of {edit.stage}") for item in found]


def _made_with(known: NodeState, edit: PendingEdit) -> bool:
    made = known.detail.get("spec_edit")
    return isinstance(made, dict) and made.get("digest") == edit.digest and known.key_parts.get("spec") == edit.base


def _rekeyed(known: NodeState, edit: PendingEdit) -> NodeState:
    parts = {**known.key_parts, "spec": edit.digest}
    detail = {name: value for name, value in known.detail.items() if name != "spec_edit"}
    return known.model_copy(update={**keyed(parts), "detail": detail})
