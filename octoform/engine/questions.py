"""Questions and answers: what is open on this host, and a person's sentence on its way into octopus.yaml. (Heavy.)"""

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.engine.apply.apply import Options, apply
from octoform.engine.inspect.state import Found, open_project
from octoform.engine.plan import device_knowledge
from octoform.engine.plan.configuration import MANIFEST
from octoform.engine.plan.plan import Request
from octoform.engine.plan.refresh import read_artifacts
from octoform.engine.results import RunResult, RunView
from octoform.manifest import setting_writer
from octoform.plan.model import OpenQuestion
from octoform.records import dataclass, field
from octoform.state.accepted import observe
from octoform.state.store.lock import acquire

TABLE = "answers"
Environ = Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Asked:
    """The questions of a host to its person: open ones, answers, the devices that can be spoken of."""

    questions: tuple[OpenQuestion, ...]
    answers: Mapping[str, str]
    devices: tuple[str, ...] = field(default=())

    def about(self, device: str) -> OpenQuestion | None:
        """The open question about a device."""
        return next((item for item in self.questions if item.device == device), None)


@dataclass(frozen=True, slots=True)
class Answered:
    """An edit of octopus.yaml: the answer about a device before and after it, and the lines that changed."""

    device: str
    before: str | None
    after: str | None
    lines: tuple[str, ...]


class AskingView(RunView, Protocol):
    """A view of a run that can also ask what a device is."""

    def question(self, question: OpenQuestion) -> str:
        """Ask the person; an empty text passes the question over."""

    def answered(self, answered_now: Answered | None, found: list[Diagnostic]) -> None:
        """Show what became of the answer."""


def asked(project: Path, environ: Environ) -> tuple[Asked | None, list[Diagnostic]]:
    """The questions and answers of a project folder; ANSWER-NO-PROBE before anything is known of its devices."""
    opened, found = open_project(project, environ)
    return (None, found) if opened is None else _asked(opened)


def _asked(opened: Found) -> tuple[Asked | None, list[Diagnostic]]:
    compiled = opened.compiled
    files = {stage: facts.digest for stage, facts in observe(compiled.layout).items()}
    artifacts = read_artifacts(compiled, opened.store.snapshot, files)
    answers = compiled.manifest.answers
    if "probe" not in artifacts:
        hint = "`octoform apply` finds them; each unknown device becomes a question"
        return None, [error("ANSWER-NO-PROBE", "nothing is known of this host's devices yet", hint=hint)]
    devices = tuple(item["id"] for item in artifacts["probe"]["devices"] if item.get("context") is not True)
    return Asked(device_knowledge.questions(artifacts, answers), answers, devices), []


def answer(project: Path, environ: Environ, device: str, sentence: str) -> tuple[Answered | None, list[Diagnostic]]:
    """Write what a device is into octopus.yaml; comments, order and every other line stay."""
    opened, found = open_project(project, environ)
    if opened is None:
        return None, found
    known, found = _asked(opened)
    if known is None:
        return None, found
    if device not in known.devices:
        near = did_you_mean(device, known.devices)
        hint = f"did you mean {near}?" if near else "`octoform answer` lists the devices that are asked about"
        summary = f"PROBE lists no device {device} of this host"
        return None, [error("ANSWER-UNKNOWN-DEVICE", summary, hint=hint)]
    return _change(opened, environ, known.answers, device, sentence.strip())


def take_back(project: Path, environ: Environ, device: str) -> tuple[Answered | None, list[Diagnostic]]:
    """Take an answer out of octopus.yaml; also one about a device that is not there."""
    opened, found = open_project(project, environ)
    if opened is None:
        return None, found
    answers = opened.compiled.manifest.answers
    if device not in answers:
        near = did_you_mean(device, list(answers))
        hint = f"did you mean {near}?" if near else "`octoform answer` lists the answers"
        return None, [error("ANSWER-NOT-THERE", f"octopus.yaml has no answer about {device}", hint=hint)]
    return _change(opened, environ, answers, device, None)


def _change(
    opened: Found, environ: Environ, answers: Mapping[str, str], device: str, sentence: str | None
) -> tuple[Answered | None, list[Diagnostic]]:
    """The edit, under the lock: a running apply undoes every change of octopus.yaml, as its agent may have made it."""
    layout = opened.compiled.layout
    acquired = acquire(layout, "answer")
    if acquired.lock is None:
        return None, list(acquired.diagnostics)
    with acquired.lock:
        edited, found = setting_writer.change(layout.project / MANIFEST, (TABLE, device), sentence, environ)
    if edited is None:
        return None, found
    lines = difflib.unified_diff(edited.before.splitlines(), edited.after.splitlines(), lineterm="", n=0)
    shown = tuple(line for line in list(lines)[2:] if not line.startswith("@@"))
    return Answered(device, answers.get(device), sentence, shown), []


def apply_asking(request: Request, options: Options, view: AskingView) -> RunResult:
    """Apply, ask once about each device that is still unknown, and apply once more what the answers change."""
    result = apply(request, options, view)
    if result.failed or not result.questions:
        return result
    lines = [_ask(request, question, view) for question in result.questions]
    return apply(request, options, view) if any(lines) else result


def _ask(request: Request, question: OpenQuestion, view: AskingView) -> bool:
    """Whether there is an answer to a question now; it is written as soon as it is given."""
    sentence = view.question(question)
    if not sentence:
        return False
    result, found = answer(request.project, request.environ, question.device, sentence)
    view.answered(result, found)
    return result is not None
