"""Attempts as a person asks for them: which there were, how they ended, and all that is known of one. (Heavy.)

What octoform wrote at the end of an attempt is its record. An attempt without one runs now or was killed, and only
the lock and the supervisor's process show which; its task and its transcript show who is at work and what was used.
"""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from octoform.apply.stage.attempt_record import state_usage
from octoform.apply.stage.spec_copy import FILE_NAME as SPEC_COPY
from octoform.apply.stage.spec_copy import MAX_SPEC_BYTES, unified
from octoform.base.clock import stamp
from octoform.base.files import read_plain
from octoform.base.processes import is_alive
from octoform.diagnostics import Diagnostic, Severity, error, from_json
from octoform.harness import transcript
from octoform.harness.containment import orphans
from octoform.harness.event_parser import field, json_object
from octoform.harness.port import Closed, ExitReason, ModelProblem, ToolCalled, ToolReturned
from octoform.manifest.loader import load as load_manifest
from octoform.manifest.model import FILE_NAME as MANIFEST
from octoform.protocol import STEP, step_paths
from octoform.protocol.spec_loader import load as load_specs
from octoform.records import dataclass
from octoform.state import attempts as records
from octoform.state.attempts import AttemptRecord
from octoform.state.layout import Layout
from octoform.state.store.lock import Holder, Liveness, liveness, myself, read_holder

RUNNING = "running"
INTERRUPTED = "interrupted"
ACCEPTED = "accepted"
REFUSED = "refused"
REUSE = "reuse"
"""The role of an attempt without an agent: another host's output was tried."""
MAX_TASK_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class Attempt:
    """One attempt.

    ``state`` is ``accepted``, ``refused`` (its run was well, its output was not), the reason that its run ended for
    (``timeout``, ``auth`` ...), ``running`` or ``interrupted``. ``began`` is RFC 3339 in UTC. ``facts`` is the record,
    and where there is none as much of it as the task and the transcript hold.
    """

    number: int
    stage: str
    attempt: int
    folder: Path
    state: str
    began: str
    record: AttemptRecord | None
    facts: AttemptRecord

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """The gate's diagnostics about it."""
        return [from_json(item) for item in self.record.diagnostics] if self.record is not None else []

    @property
    def codes(self) -> list[str]:
        """The codes of the errors it was refused with, each once, in their order."""
        return list(dict.fromkeys(item.code for item in self.diagnostics if item.severity is Severity.ERROR))


@dataclass(frozen=True, slots=True)
class SpecDiff:
    """The agent's edit of its copy of the spec; ``certain`` is False when the spec that it was given is no more."""

    added: int
    removed: int
    permitted: bool
    lines: tuple[str, ...]
    certain: bool


@dataclass(frozen=True, slots=True)
class Detail:
    """All that is known of one attempt; texts are foreign. Sizes are bytes, None where there is no file."""

    attempt: Attempt
    spec: SpecDiff | None
    moments: tuple[transcript.Moment, ...]
    sizes: Mapping[str, int | None]

    @property
    def calls(self) -> list[tuple[float, ToolCalled]]:
        """The agent's tool calls, each with the seconds since the start."""
        return [(item.at, item.event) for item in self.moments if isinstance(item.event, ToolCalled)]

    @property
    def calls_failed(self) -> int:
        """How many of them failed, as the program saw it."""
        return sum(1 for item in self.moments if isinstance(item.event, ToolReturned) and item.event.failed)

    @property
    def problems(self) -> list[tuple[float, ModelProblem | Closed]]:
        """The problems of the model's side, and the program's closing message after a failure."""
        return [
            (item.at, item.event)
            for item in self.moments
            if isinstance(item.event, ModelProblem) or (isinstance(item.event, Closed) and not item.event.ok)
        ]


def listed(
    project: Path, environ: Mapping[str, str], stage: str | None = None
) -> tuple[list[Attempt] | None, list[Diagnostic]]:
    """The attempts of the folder's host, oldest first; None with the diagnostics when the manifest cannot be read."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    return [item for item in of_host(layout) if stage in (None, item.stage)], found


def detail(project: Path, environ: Mapping[str, str], number: int) -> tuple[Detail | None, list[Diagnostic]]:
    """One attempt, or ATTEMPT-UNKNOWN."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    attempts = of_host(layout)
    chosen = next((item for item in attempts if item.number == number), None)
    if chosen is None:
        return None, [*found, _unknown(number, attempts)]
    moments = transcript.read(chosen.folder / "transcript.jsonl")
    names = ("prompt.md", "agent.log", "transcript.jsonl")
    sizes = {name: _size(chosen.folder / name) for name in names}
    return Detail(chosen, _spec(project, attempts, chosen), tuple(moments), sizes), found


def layout_of(project: Path, environ: Mapping[str, str]) -> tuple[Layout | None, list[Diagnostic]]:
    """Where the host's files lie; only the manifest is read."""
    manifest, found = load_manifest(project / MANIFEST, environ)
    return (Layout(project, manifest.host) if manifest is not None else None), list(found)


def of_host(layout: Layout) -> list[Attempt]:
    """Every attempt that there is, oldest first."""
    folders = records.folders(layout)
    held = _held(layout)
    return [_attempt(folder, live=held and folder == folders[-1]) for folder in folders]


def _held(layout: Layout) -> bool:
    """True while an apply works on this host."""
    holder = read_holder(layout)
    return isinstance(holder, Holder) and liveness(holder.process, myself()) in (Liveness.ALIVE, Liveness.HIDDEN)


def _attempt(folder: Path, *, live: bool) -> Attempt:
    number, stage, attempt = _parts(folder.name)
    process = orphans.read(folder)
    record = records.read(folder)
    if record is not None and (record.number, record.stage) != (number, stage):
        record = None  # not written by octoform: it contradicts its folder's name
    if record is None:
        running = live or (process is not None and not process.ended and is_alive(process.pid, process.start))
        found = _so_far(folder, RUNNING if running else INTERRUPTED)
        return Attempt(number, stage, attempt, folder, found.reason, found.started_at, None, found)
    return Attempt(number, stage, record.attempt, folder, _state(record), record.started_at, record, record)


def _so_far(folder: Path, state: str) -> AttemptRecord:
    """The attempt's facts by its files, without a record; an agent may have written them, so all of it is foreign."""
    number, stage, attempt = _parts(folder.name)
    task = json_object(read_plain(folder / "task.json", MAX_TASK_BYTES) or b"")
    role, harness, model = (_word(field(task, name)) for name in ("role", "harness", "model"))
    moments = transcript.read(folder / "transcript.jsonl")
    turns, used = transcript.used(moments)
    began = _began(folder)
    seconds = moments[-1].at if moments else 0.0
    if state == RUNNING:
        seconds = max(seconds, (datetime.now(UTC) - began).total_seconds())
    return AttemptRecord(
        number=number,
        stage=stage,
        attempt=attempt,
        role=role or "stage",
        harness=harness or "",
        model=model,
        started_at=stamp(began),
        seconds=round(seconds, 3),
        reason=state,
        turns=turns,
        usage=state_usage(used),
    )


def _word(value: object) -> str | None:
    return value if isinstance(value, str) else None


def _state(record: AttemptRecord) -> str:
    if record.accepted:
        return ACCEPTED
    well = record.role == REUSE or record.reason == ExitReason.FINISHED.value
    return REFUSED if well else record.reason


def _parts(name: str) -> tuple[int, str, int]:
    """Number, stage and try of a folder called ``NNNNNN-<stage>-<k>``."""
    number, _, rest = name.partition("-")
    stage, _, attempt = rest.rpartition("-")
    return int(number), stage, int(attempt) if attempt.isdecimal() else 0


def _began(folder: Path) -> datetime:
    began = datetime.fromtimestamp(folder.lstat().st_ctime, UTC)
    task = folder / "task.json"
    if task.is_file():
        began = datetime.fromtimestamp(task.lstat().st_mtime, UTC)
    return began


def _size(path: Path) -> int | None:
    return path.lstat().st_size if path.is_file() and not path.is_symlink() else None


def _unknown(number: int, attempts: Sequence[Attempt]) -> Diagnostic:
    there = f"there are {attempts[0].number} to {attempts[-1].number}" if attempts else "there is none yet"
    hint = f"{there}; `octoform attempts` lists them" if attempts else f"{there}; octoform apply makes the first"
    return error("ATTEMPT-UNKNOWN", f"there is no attempt {number}", hint=hint)


def run_of(attempts: Sequence[Attempt], chosen: Attempt) -> list[Attempt]:
    """The attempts of the same stage, role and run up to this one; numbers begin at 1 again with every run."""
    role = chosen.record.role if chosen.record is not None else None
    run: list[Attempt] = []
    for item in attempts:
        same = item.stage == chosen.stage and (item.record is None or role is None or item.record.role == role)
        if not same or item.number > chosen.number:
            continue
        if not run or item.attempt <= run[-1].attempt:
            run = []
        run.append(item)
    return run


def _spec(project: Path, attempts: Sequence[Attempt], chosen: Attempt) -> SpecDiff | None:
    record = chosen.record
    copy = _text(chosen.folder)
    if record is None or record.spec_edit is None or copy is None:
        return None
    edit = record.spec_edit
    given = _given(run_of(attempts, chosen)[:-1])
    if given is None:
        given = _today(project, chosen.stage)
    lines = unified(given, copy)
    counts = (_count(lines, "+"), _count(lines, "-"))
    return SpecDiff(edit.added, edit.removed, edit.permitted, lines, counts == (edit.added, edit.removed))


def _today(project: Path, stage: str) -> str:
    """The text of a stage's or step's spec as it is now; empty where it cannot be read."""
    if not stage.startswith(STEP):
        specs, _ = load_specs(project / "protocol")
        return specs[stage].text if stage in specs else ""
    path = step_paths(project / "protocol").get(stage.removeprefix(STEP))
    data = read_plain(path, MAX_SPEC_BYTES) if path is not None else None
    return data.decode("utf-8", "replace") if data is not None else ""


def _given(before: Sequence[Attempt]) -> str | None:
    """The text that an attempt was given, from the copies of those before it; None for the spec of the project."""
    for item in reversed(before):
        edit: Any = item.record.spec_edit if item.record is not None else None
        if item.record is not None and (edit is None or edit.permitted):
            return _text(item.folder)
    return None


def _text(folder: Path) -> str | None:
    data = read_plain(folder / SPEC_COPY, MAX_SPEC_BYTES)
    return data.decode("utf-8", "replace") if data is not None else None


def _count(lines: Sequence[str], sign: str) -> int:
    return sum(1 for line in lines if line.startswith(sign) and not line.startswith(sign * 3))
