"""Making a recording of the last run: its accepted artifacts, its failures, and what the agents did. (Heavy.)

Of each stage the attempts of the latest run that ended accepted are taken, so playing them leads where the state is
now. Everything is gathered and checked in memory first; a folder is written as a whole or not at all.
"""

import os
import shutil
import stat
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from octoform import __version__
from octoform.apply.stage.acceptance import MAX_BYTES, MAX_JSON_BYTES
from octoform.apply.stage.spec_copy import FILE_NAME as SPEC_COPY
from octoform.apply.stage.spec_copy import MAX_SPEC_BYTES
from octoform.base.files import TEMPORARY, read_plain, replace, sync_folder
from octoform.diagnostics import Diagnostic, error, has_errors, warning
from octoform.engine import anonymizer
from octoform.engine.anonymizer import Anonymizer, anonymizer_of
from octoform.engine.inspect.attempts import Attempt, of_host, run_of
from octoform.harness import recording, transcript
from octoform.harness.event_parser import json_object
from octoform.harness.port import ExitReason
from octoform.harness.recording import FILE_NAME, NAME
from octoform.harness.recording import MAX_BYTES as MAX_RECORDING_BYTES
from octoform.manifest.loader import load as load_manifest
from octoform.manifest.model import FILE_NAME as MANIFEST
from octoform.patterns import regex
from octoform.records import dataclass, field
from octoform.state.files import display, read_regular, refused
from octoform.state.layout import OUTPUT_NAMES, STAGES, Layout
from octoform.state.store.lock import acquire

# The folder of a recording on disk: written as a whole, and never in place of anything else that lies there.

_NAME = regex(NAME)


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
    document = json_object(read_plain(target / FILE_NAME, MAX_RECORDING_BYTES) or b"")
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
            target.rename(former)  # whole folders change places: no file is replaced
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
        path=display(target),
        detail=why,
        hint="name a new folder, or one that holds a recording and nothing else",
    )


STAGE_ROLE = "stage"


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recording that stands: attempts by stage, how many files and bytes it has."""

    folder: Path
    stages: Mapping[str, int]
    files: int
    size: int


@dataclass(slots=True)
class _Gathered:
    """The files to write: file name to bytes; ``accepted`` are the names of files that are in git already."""

    files: dict[str, bytes] = field(default_factory=dict)
    accepted: set[str] = field(default_factory=set)
    stages: dict[str, list[recording.Attempt]] = field(default_factory=dict)


def record(
    project: Path, environ: Mapping[str, str], target: Path, first: int = 1
) -> tuple[Recorded | None, list[Diagnostic]]:
    """Write the recording into ``target``; only runs that began with attempt ``first`` or later are looked at."""
    manifest, found = load_manifest(project / MANIFEST, environ)
    if manifest is None:
        return None, list(found)
    problem = check_target(target)
    if problem is not None:
        return None, [*found, problem]
    layout = Layout(project, manifest.host)
    acquired = acquire(layout, "attempts record")
    if acquired.lock is None:
        return None, [*found, *acquired.diagnostics]
    with acquired.lock:
        try:
            secrets = anonymizer.secret_values(manifest.variables, environ)
            gathered, more = _gather(layout, environ, first, secrets)
        except OSError as refusal:
            return None, [*found, refused(refusal, layout.local)]
    found = [*found, *more]
    if not has_errors(found):
        found += _secrets(gathered, secrets)
    if has_errors(found):
        return None, found
    files = {name: gathered.files[name] for name in sorted(gathered.files)}
    problem = write(target, files)
    if problem is not None:
        return None, [*found, problem]
    counts = {stage: len(attempts) for stage, attempts in gathered.stages.items()}
    return Recorded(target, counts, len(files), sum(map(len, files.values()))), found


def runs(attempts: Sequence[Attempt], first: int = 1) -> dict[str, list[Attempt]]:
    """Stage to the attempts of its latest run that ended accepted and of which every attempt has its record.

    Numbers of attempts begin at 1 with every run. A run of which the first attempts were cleared away, or one that was
    interrupted, is no whole run.
    """
    own = [item for item in attempts if item.record is None or item.record.role == STAGE_ROLE]
    found = {}
    for stage in STAGES:
        ends = [item for item in own if item.stage == stage and item.record is not None and item.record.accepted]
        whole = [run for run in (run_of(own, end) for end in ends) if _whole(run, first)]
        if whole:
            found[stage] = whole[-1]
    return found


def _whole(run: Sequence[Attempt], first: int) -> bool:
    numbered = [item.attempt for item in run] == list(range(1, len(run) + 1))
    return numbered and run[0].number >= first and all(item.record is not None for item in run)


def _gather(
    layout: Layout, environ: Mapping[str, str], first: int, secrets: Mapping[str, str]
) -> tuple[_Gathered, list[Diagnostic]]:
    gathered = _Gathered()
    chosen = runs(of_host(layout), first)
    if not chosen:
        hint = "octoform apply makes attempts; only those that it has kept and that ended accepted can be recorded"
        return gathered, [error("RECORD-NOTHING", "there is no accepted run of any stage to record", hint=hint)]
    covering = anonymizer_of(layout, environ, [_output_bytes(item) for item in chosen.get("probe", [])], secrets)
    found = []
    for stage in STAGES:
        if stage not in chosen:
            found.append(_missing(stage))
            continue
        problem = _stage(layout, stage, chosen[stage], covering, gathered)
        found += [problem] if problem is not None else []
    document = recording.Recording(octoform=__version__, stages=gathered.stages)
    gathered.files[recording.FILE_NAME] = recording.encode(document)
    return gathered, [*found, *_instances(gathered, covering)]


def _stage(
    layout: Layout, stage: str, run: Sequence[Attempt], covering: Anonymizer, gathered: _Gathered
) -> Diagnostic | None:
    for item in run:
        folder = f"{stage}-{item.attempt}"
        within = covering.within(str(item.folder))
        if item is run[-1]:
            data, problem = read_regular(layout.output(stage))
            if data is None:
                summary = f"the accepted artifact of {stage} is not there"
                return problem or error("ARTIFACT-MISSING", summary, path=display(layout.output(stage)))
            output: recording.Output | None = recording.Output(name=layout.output(stage).name)
            gathered.accepted.add(f"{folder}/{layout.output(stage).name}")
        else:
            output, data = _left(item, within)
        gathered.stages.setdefault(stage, []).append(_attempt(item, folder, within, (output, data), gathered))
    return None


def _attempt(
    item: Attempt, folder: str, within: Anonymizer, left: tuple[recording.Output | None, bytes], gathered: _Gathered
) -> recording.Attempt:
    """The entry of one attempt; its files join the others."""
    record, (output, data) = item.record, left
    assert record is not None  # a run without a record is not chosen

    def add(name: str, content: bytes) -> str:
        gathered.files[f"{folder}/{name}"] = content
        return f"{folder}/{name}"

    if output is not None and output.kind == "file":
        output = output.model_copy(update={"file": add(output.name, data)})
    edited = read_plain(item.folder / SPEC_COPY, MAX_SPEC_BYTES) if record.spec_edit is not None else None
    moments = transcript.read(item.folder / "transcript.jsonl")
    return recording.Attempt(
        reason=ExitReason(record.reason),
        exit_status=record.exit_status,
        detail=within.talk(record.detail),
        seconds=record.seconds,
        turns=record.turns,
        usage=record.usage,
        harness=record.harness,
        model=record.model,
        program=record.program,
        accepted=record.accepted,
        refused=item.codes,
        output=output,
        spec_edit=add(SPEC_COPY, _anonymized(edited, within)) if edited is not None else None,
        transcript=add("transcript.jsonl", _veiled(moments, within)) if moments else None,
    )


def _anonymized(data: bytes, within: Anonymizer) -> bytes:
    return within.text(data.decode("utf-8", "replace")).encode("utf-8")


def _veiled(moments: Sequence[transcript.Moment], within: Anonymizer) -> bytes:
    return transcript.encode(
        transcript.Moment(item.at, transcript.with_text(item.event, within.talk(transcript.text_of(item.event))))
        for item in moments
    )


def _left(item: Attempt, within: Anonymizer) -> tuple[recording.Output | None, bytes]:
    """The output file of a rejected attempt."""
    name = OUTPUT_NAMES.get(item.stage, "output.json")
    try:
        facts = (item.folder / name).lstat()
    except OSError:
        return None, b""
    if not stat.S_ISREG(facts.st_mode) or facts.st_nlink > 1:
        return recording.Output(kind="link", name=name), b""
    if facts.st_size > MAX_BYTES.get(item.stage, MAX_JSON_BYTES):
        return recording.Output(kind="large", name=name, size=facts.st_size), b""
    text = _output_bytes(item).decode("utf-8", "surrogateescape")
    exchanged = within.refused(text, probe=item.stage == "probe")
    return recording.Output(name=name), exchanged.encode("utf-8", "surrogateescape")


def _output_bytes(item: Attempt) -> bytes:
    """The output of an attempt; empty when it is no readable file."""
    return read_plain(item.folder / OUTPUT_NAMES.get(item.stage, "output.json"), MAX_JSON_BYTES) or b""


def _missing(stage: str) -> Diagnostic:
    hint = "apply it again with -replace to record it; a replay of this recording cannot make it"
    return warning("RECORD-INCOMPLETE", f"there is no whole accepted run of {stage}; it is skipped", hint=hint)


def _instances(gathered: _Gathered, covering: Anonymizer) -> list[Diagnostic]:
    return [
        error(
            "RECORD-PERSONAL",
            "something of this one host would be in the recording; nothing was written",
            path=name,
            hint="look at that file of the attempt; replace the stage and record again",
        )
        for name, data in sorted(gathered.files.items())
        if name not in gathered.accepted and covering.shows(data)
    ]


def _secrets(gathered: _Gathered, values: Mapping[str, str]) -> list[Diagnostic]:
    return [
        error(
            "RECORD-SECRET",
            f"{what} would be in the recording; nothing was written",
            path=name,
            hint="replace the stage and record again; if an agent has printed a secret, change that secret",
        )
        for name, data in sorted(gathered.files.items())
        for what in anonymizer.secrets_in(data, values)
    ]
