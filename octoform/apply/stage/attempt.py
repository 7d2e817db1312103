"""One attempt: a fresh folder with prompt, spec copy and task, then the agent, within its limits.

The folder is the whole of what an attempt leaves: prompt, log, transcript, output, usage and verdict stay there as the
record of what the stage knew. Nothing of a failed attempt is read by anything but the next prompt (a bounded tail of
its log, and its copy of the spec where it was asked to correct that).
"""

import json
import threading
from collections.abc import Callable, Mapping
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any, Self

from octoform import events
from octoform.apply.context import Context, accepted
from octoform.apply.stage import spec_copy
from octoform.apply.stage.acceptance import offered, read_output
from octoform.apply.stage.assignment import Assignment
from octoform.apply.stage.secret_scan import leaked, without_secrets
from octoform.base import files, shortage
from octoform.base.digest import of_large_file
from octoform.base.files import parse, private_folder, replace
from octoform.diagnostics import Diagnostic, has_errors, to_json
from octoform.harness.port import (
    AgentEvent,
    Excerpt,
    Harness,
    ModelProblem,
    Outcome,
    Output,
    Task,
    TaskLimits,
    ToolCalled,
    Totals,
    Turn,
    Usage,
)
from octoform.manifest.model import MODEL_FREE
from octoform.patterns import regex
from octoform.profiles import Profile, briefing, devices_of, for_task, packaging
from octoform.protocol import Prompt, render_prompt
from octoform.protocol.prompt import MAX_TAIL_BYTES, findings
from octoform.records import dataclass, field
from octoform.state.attempts import folders
from octoform.state.layout import OUTPUT_NAMES

# ``check``: a program in an attempt's folder that holds the output against its contract before the agent ends.
#
# It only asks. The supervisor of the attempt judges, with the code that will judge the output in the end, and writes
# what it found beside the program; so neither a contract nor another artifact nor a secret is within the agent's reach.
# What only running an output can show (a server's tools, a set of packages) is not looked at.

PROGRAM, REQUEST, SAID = "check", "check.asked", "check.said"
MAX_CHECKS = 30
"""How often an attempt may ask: enough to fix one thing after the other, and no way to try every value."""
PAUSE_SECONDS = 0.1
_WAIT_TENTHS = 600
_KEY = regex(rb"[0-9a-zA-Z.-]{1,80}")
_SCRIPT = f"""#!/bin/sh
# Holds the output against its contract, as it will be held when you have ended. Status 0: it would be accepted.
cd "$(dirname "$0")" || exit 2
key="$$-$(date +%s.%N)"
echo "$key" > {REQUEST}.new && mv {REQUEST}.new {REQUEST} || exit 2
tenths=0
while [ "$(head -n 1 {SAID} 2>/dev/null)" != "$key" ]; do
    tenths=$((tenths + 1))
    [ "$tenths" -gt {_WAIT_TENTHS} ] && echo "no one has answered; end when you are done" && exit 2
    sleep 0.1
done
tail -n +3 {SAID}
[ "$(sed -n 2p {SAID})" = accepted ]
"""


class Checks:
    """Answers the program of one attempt while the block lasts; ``count`` is how often it has.

    ``judge`` gives the findings on the output as it is now, as text; empty when it would be accepted.
    """

    def __init__(self, folder: Path, judge: Callable[[], str]) -> None:
        self.count = 0
        self._folder, self._judge = folder, judge
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="check", daemon=True)

    def __enter__(self) -> Self:
        """OSError when the program cannot be written."""
        files.replace(self._folder / PROGRAM, _SCRIPT.encode(), 0o755, synced=False)
        shortage.start(self._thread)
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(PAUSE_SECONDS):
            # A folder that the agent has made away with, or a full disk: it goes without an answer, and its end reports
            # it.
            with suppress(OSError):
                key = files.head(self._folder / REQUEST, 100).strip()
                (self._folder / REQUEST).unlink()
                if _KEY.fullmatch(key):
                    files.replace(self._folder / SAID, key + b"\n" + self._answer().encode(), 0o644, synced=False)

    def _answer(self) -> str:
        if self.count == MAX_CHECKS:
            return f"refused\nthis was asked {MAX_CHECKS} times; no more is judged before you end\n"
        self.count += 1
        found = self._judge()
        left = f"({MAX_CHECKS - self.count} {'check' if MAX_CHECKS - self.count == 1 else 'checks'} left)"
        if found:
            return f"refused\nit would be refused {left}:\n{found}\n"
        return f"accepted\nit would be accepted, as far as that shows without running it {left}\n"


KEEP = 100
FORMER = "former-"
"""Begins the name of the copy of an output that is to be corrected."""
FIRST = "probe"
ASKED = "identify"
PACKAGES = "deploy"


@dataclass(frozen=True, slots=True)
class Failed:
    """The feedback of a failed attempt to the next one: why it was refused, its log, the spec as it is in this run.

    ``former`` is the output to be corrected: the last one that could be read, or an accepted one that a later stage
    found at fault. ``found`` is what is wrong with it, whichever attempt wrote it, and ``right`` states what is not.
    ``standing`` is what the later stage found: it stands until that has tried another one, however many are refused.
    ``changed`` is what has changed in the input since ``former`` was accepted: no attempt failed, and it is a draft.
    """

    diagnostics: tuple[Diagnostic, ...]
    log: Path | None
    spec: str
    former: bytes | None = None
    found: tuple[Diagnostic, ...] = ()
    right: str = ""
    standing: tuple[Diagnostic, ...] = ()
    changed: tuple[str, ...] = ()

    @property
    def retries(self) -> bool:
        """Whether there is anything that went wrong."""
        return bool(self.diagnostics or self.log or self.standing)

    @property
    def more(self) -> tuple[Diagnostic, ...]:
        """Problems of the output to be corrected that are not the reason for the last failure."""
        return tuple(item for item in self.found if item not in self.diagnostics)


@dataclass(frozen=True, slots=True)
class Prepared:
    """An attempt about to begin: the task, the spec's text that it was given, whether it may correct it.

    ``given`` has the digests of what the agent is given, by name. ``usage`` is what its preparation has cost (a summary
    of the failed attempt's log), ``changed`` as in `Failed`.
    """

    task: Task
    spec: str
    editable: bool
    given: Mapping[str, str] = field(default_factory=dict)
    usage: Usage = field(default_factory=Usage)
    changed: tuple[str, ...] = ()


@dataclass(slots=True)
class SoFar:
    """The facts of a running attempt, for the record of one that is interrupted.

    ``began`` is in seconds of the run's clock; ``outcome`` stands once the agent has ended, and ``checks`` is how often
    it has held its output against the contract before.
    """

    began: float
    turns: int | None = None
    usage: Usage = field(default_factory=Usage)
    outcome: Outcome | None = None
    checks: int = 0


def prepare(
    context: Context, assignment: Assignment, number: int, limits: TaskLimits, failed: Failed | None
) -> Prepared:
    """Make the folder of attempt ``number`` and everything in it."""
    task = new_task(context, assignment, number, limits)
    spec = failed.spec if failed else context.specs[task.stage].text
    editable = failed is not None and failed.retries and assignment.budget.edit_specs
    spec_copy.give(task.workdir, spec, editable=editable)
    if assignment.given is not None:
        replace(task.workdir / "input.json", assignment.given, 0o644, synced=False)
    for name, data in assignment.beside.items():
        (task.workdir / name).parent.mkdir(parents=True, exist_ok=True)
        replace(task.workdir / name, data, 0o644, synced=False)
    if failed is not None and failed.former is not None:
        replace(_former(task), failed.former, 0o644, synced=False)
    document = _document(context, assignment, task, failed)
    text = json.dumps(document, indent=2, ensure_ascii=False) + "\n"
    replace(task.document, text.encode(), 0o644, synced=False)
    excerpt = _excerpt(context, task, failed)
    prompt = _prompt(context, assignment, task, failed, excerpt)
    replace(task.prompt, prompt.encode(), 0o644, synced=False)
    changed = failed.changed if failed is not None else ()
    return Prepared(task, spec, editable, _given(context, assignment, task), excerpt.usage, changed)


def _given(context: Context, assignment: Assignment, task: Task) -> dict[str, str]:
    """The agent's initial files, each by its digest; the agent may change the files in its folder."""
    own = (task.prompt, task.document, task.workdir / spec_copy.FILE_NAME, _former(task))
    paths: dict[str, Path | None] = {path.name: path for path in own}
    paths |= {name: task.workdir / name for name in assignment.beside}
    paths |= {"input": assignment.input(context, task.workdir), "schema": context.specs[task.stage].schema}
    found = {name: of_large_file(path) for name, path in paths.items() if path is not None}
    return {name: digest for name, digest in sorted(found.items()) if digest is not None}


def _former(task: Task) -> Path:
    """The copy of the output that is to be corrected."""
    return task.workdir / f"{FORMER}{task.output.name}"


def _excerpt(context: Context, task: Task, failed: Failed | None) -> Excerpt:
    """The excerpt of the failed log for a retry: nothing here, or a summary where the manifest has a model for that."""
    settings = context.manifest.housekeeping
    if failed is None or failed.log is None or settings is None:
        return Excerpt("")
    # Imported here: few manifests name such a model, and what talks to it takes long to load.
    from octoform.harness.llm.completion import LiteLLMCompletion, condense

    excerpt = condense(failed.log, MAX_TAIL_BYTES, LiteLLMCompletion(settings, context.environ))
    if excerpt.reason:
        context.emit(
            events.Notice(task.stage, f"the log is not condensed, the next attempt gets its end: {excerpt.reason}")
        )
    return excerpt


def new_task(context: Context, assignment: Assignment, number: int, limits: TaskLimits) -> Task:
    """The task of an attempt, with its new and empty folder."""
    stage = assignment.stage
    workdir = _folder(context, stage, number)
    return Task(
        stage=stage,
        attempt=number,
        workdir=workdir,
        prompt=workdir / "prompt.md",
        output=workdir / OUTPUT_NAMES.get(stage, "output.json"),
        log=workdir / "agent.log",
        document=workdir / "task.json",
        model=assignment.model_name(context),
        environment=context.environ,
        limits=limits,
        secrets=context.manifest.variables,
        price=assignment.price(context),
    )


def run(context: Context, assignment: Assignment, harness: Harness, task: Task, so_far: SoFar) -> Outcome:
    """Let the agent work; what it does becomes events, and ``so_far`` follows it."""

    def judge() -> str:
        data, found = read_output(task)
        if not found:
            _, found = assignment.judge(context, task, data)
            found = [*found, *leaked(task, data)]
        return findings(without_secrets(task, found)) if has_errors(found) else ""

    def progress(event: AgentEvent, elapsed: float, used: Usage) -> None:
        so_far.usage = used
        match event:
            case Output():
                context.emit(events.AttemptProgress(task.stage, event.text, elapsed))
            case ToolCalled():
                # What begins with these folders, as most of its paths do, would leave no room for their names.
                text = event.text.replace(f"{task.workdir}/", "").replace(f"{context.layout.project}/", "")
                context.emit(events.AgentActed(task.stage, event.tool, text, elapsed))
            case Turn() | Totals():
                turns = so_far.turns = (so_far.turns or 0) + isinstance(event, Turn)
                tokens = (used.input_tokens, used.output_tokens)
                context.emit(events.AgentSpent(task.stage, turns, *tokens, used.cost_usd, elapsed))
            case ModelProblem():
                context.emit(events.AttemptProgress(task.stage, f"the model's side: {event.text}", elapsed))

    with nullcontext() if assignment.harness.name in MODEL_FREE else Checks(task.workdir, judge) as checks:
        so_far.outcome = harness.run(task, progress)
    so_far.checks = checks.count if checks is not None else 0
    return so_far.outcome


def _folder(context: Context, stage: str, number: int) -> Path:
    private_folder(context.layout.attempts)
    present = folders(context.layout)
    for path in present[: max(0, len(present) - KEEP)]:
        files.remove_tree(path)
    latest = int(present[-1].name.partition("-")[0]) if present else 0
    folder = context.layout.attempts / f"{latest + 1:06d}-{stage}-{number}"
    folder.mkdir(mode=0o700)
    return folder


def _document(context: Context, assignment: Assignment, task: Task, failed: Failed | None) -> dict[str, object]:
    given = assignment.input(context, task.workdir)
    schema = context.specs[task.stage].schema
    return {
        "format": 1,
        "stage": task.stage,
        "attempt": task.attempt,
        "host": context.layout.host,
        "input": str(given) if given else None,
        "schema": str(schema) if schema else None,
        "spec": str(task.workdir / spec_copy.FILE_NAME),
        "prompt": str(task.prompt),
        "output": str(task.output),
        "role": assignment.role,
        "harness": assignment.harness.name,
        "model": assignment.model,
        "limits": {"wall_seconds": task.limits.wall_seconds, "tools": assignment.budget.tools},
        "profiles": [for_task(profile, ids) for profile, ids in _held(context, assignment)],
        "answers": dict(_answers(context, assignment)),
        "diagnostics": [to_json(item) for item in _findings(failed)],
    }


def _findings(failed: Failed | None) -> tuple[Diagnostic, ...]:
    return (*failed.diagnostics, *failed.more, *failed.standing) if failed is not None else ()


def _prompt(context: Context, assignment: Assignment, task: Task, failed: Failed | None, excerpt: Excerpt) -> str:
    return render_prompt(
        Prompt(
            spec=context.specs[task.stage],
            output=task.output,
            input=assignment.input(context, task.workdir),
            workdir=task.workdir,
            own_spec=task.workdir / spec_copy.FILE_NAME,
            editable=assignment.budget.edit_specs,
            tools=assignment.budget.tools,
            wall_seconds=task.limits.wall_seconds,
            profiles=_briefings(context, assignment),
            answers=_answers(context, assignment),
            offered=_offered(context, assignment),
            failed_log=failed.log if failed else None,
            former=_former(task) if failed and failed.former else None,
            summary=excerpt.text if excerpt.condensed else "",
            diagnostics=failed.diagnostics if failed else (),
            of_former=failed.more if failed else (),
            right=failed.right if failed else "",
            standing=failed.standing if failed else (),
            changed=failed.changed if failed else (),
        )
    )


def _briefings(context: Context, assignment: Assignment) -> tuple[str, ...]:
    """The prose of the profiles, each with the devices of this host that it matches; else empty.

    DEPLOY chooses packages: it is given what they say of packages and files.
    """
    found = packaging if assignment.stage == PACKAGES else briefing
    return tuple(text for profile, devices in _held(context, assignment) if (text := found(profile, devices)))


def _answers(context: Context, assignment: Assignment) -> Mapping[str, str]:
    """A person's answers about the devices that the agent is asked about; only IDENTIFY uses them."""
    if assignment.stage != ASKED or not context.manifest.answers:
        return {}
    listed = {device["id"] for device in _asked_of(context, assignment)["devices"]}
    return {device: sentence for device, sentence in context.manifest.answers.items() if device in listed}


def _offered(context: Context, assignment: Assignment) -> Mapping[str, str]:
    """By device the profile that matches and is not chosen: a contract that an agent cannot see would reject it."""
    if assignment.stage != ASKED:
        return {}
    return offered(context.profiles, _asked_of(context, assignment), context.manifest.answers)


def _asked_of(context: Context, assignment: Assignment) -> Mapping[str, Any]:
    """PROBE's artifact, or the part of it that IDENTIFY's second agent is asked about."""
    probe: Mapping[str, Any] = parse(assignment.given) if assignment.given is not None else accepted(context, FIRST)
    return probe


def _held(context: Context, assignment: Assignment) -> list[tuple[Profile, frozenset[str]]]:
    """The profiles that hold for a device of this host, each with its devices; PROBE gets none."""
    if assignment.stage == FIRST or not context.profiles:
        return []
    probe, only = accepted(context, FIRST), assignment.profiles
    chosen = [profile for profile in context.profiles if only is None or profile.name in only]
    held = [(profile, devices_of(profile, probe, context.manifest.answers)) for profile in chosen]
    return [(profile, devices) for profile, devices in held if devices]
