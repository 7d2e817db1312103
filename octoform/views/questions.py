"""Questions about devices and their answers, for a person and for a program."""

import sys
from collections.abc import Sequence
from dataclasses import asdict

from octoform.diagnostics import Diagnostic
from octoform.engine.questions import Answered, Asked
from octoform.engine.results import RunResult
from octoform.plan.model import OpenQuestion
from octoform.views import plan
from octoform.views.apply import RunHuman
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.format.output import document
from octoform.views.format.values import escape, one_line

WIDTH = 100
STYLES = {"+": "green", "-": "red"}
NEXT = "\nNext:  octoform plan"


def listed(console: Console, found: Asked, *, as_json: bool) -> int:
    """The open questions, then the given answers."""
    if as_json:
        questions = [asdict(item) for item in found.questions]
        return document(console, {"format": 1, "questions": questions, "answers": dict(found.answers)})
    plan.ask(found.questions, console)
    if not found.questions:
        console.line("No question is open.")
    if found.answers:
        console.line("\nAnswers:")
    for device, sentence in found.answers.items():
        mark = "" if device in found.devices else console.paint("  (no such device here)", "yellow")
        console.line(f'    {device}: "{one_line(sentence, WIDTH)}"{mark}')
    return 0


def changed(console: Console, answered: Answered, *, as_json: bool) -> int:
    """The lines of octopus.yaml that changed, and what to do next."""
    if as_json:
        return document(console, {"format": 1, **asdict(answered)})
    if not answered.lines:
        console.line("octopus.yaml has this answer already; nothing was changed.")
        return 0
    _lines(console, answered)
    console.line(NEXT)
    return 0


def _lines(console: Console, answered: Answered) -> None:
    console.line(console.paint("octopus.yaml", "bold"))
    for line in answered.lines:
        console.raw(f"  {console.paint(f'{line[:1]} {escape(line[1:])}', STYLES.get(line[:1], 'dim'))}")


def passed_over(console: Console) -> int:
    """The person was asked and gave no answer."""
    console.line("No answer was given, and nothing was changed.")
    return 0


def ask(console: Console, question: OpenQuestion | None, device: str) -> str:
    """Ask on the terminal what a device is; "" where the person passes it over."""
    if question is None:
        console.line(f"\nWhat is {device}?")
    else:
        console.line(f"\n{console.paint('?', 'cyan')} {device} ({one_line(question.seen_as, WIDTH)})")
        console.line(f"  {one_line(question.sentence, 2 * WIDTH)}")
    console.out.write("  Answer in one sentence, or press Enter to pass over: ")
    console.out.flush()
    try:
        text = input() if sys.stdin is not None else ""
    except (EOFError, UnicodeDecodeError):
        console.line()
        return ""
    return text.strip()


class AskingHuman(RunHuman):
    """The human view of a run that asks about what is still unknown."""

    def question(self, question: OpenQuestion) -> str:
        """Ask the person about one device."""
        return ask(self._console, question, question.device)

    def _questions(self, result: RunResult) -> None:
        """Nothing: each open question is asked next."""

    def answered(self, outcome: Answered | None, found: Sequence[Diagnostic]) -> None:
        """Show the lines of octopus.yaml that changed, or why none did."""
        problems.show(self._console, found)
        if outcome is not None:
            _lines(self._console, outcome)
