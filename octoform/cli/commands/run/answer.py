"""``answer``: say in a sentence what a device is; without a device, list the questions that are open."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.options import UsageError
from octoform.diagnostics import error
from octoform.engine import questions
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.run import questions as views

USAGE = "usage: octoform answer [-json] [-remove] [DEVICE] [SENTENCE]"


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when the manifest was to be changed and was not."""
    if arguments.remove and (arguments.device is None or arguments.sentence is not None):
        raise UsageError("-remove takes back what was said of one DEVICE", USAGE)
    if arguments.device is None:
        return _list(arguments, project, screen)
    if arguments.remove:
        told, found = questions.take_back(project, os.environ, arguments.device)
    else:
        sentence = arguments.sentence
        if sentence is None:
            return _ask(arguments, project, screen)
        told, found = questions.answer(project, os.environ, arguments.device, sentence)
    if told is None:
        return problems.show(screen, found, as_json=arguments.json)
    return views.changed(screen, told, as_json=arguments.json)


def _list(arguments: Namespace, project: Path, screen: Console) -> int:
    known, found = questions.asked(project, os.environ)
    if known is None:
        return problems.show(screen, found, as_json=arguments.json)
    return views.listed(screen, known, as_json=arguments.json)


def _ask(arguments: Namespace, project: Path, screen: Console) -> int:
    """The sentence from the terminal."""
    if arguments.json or not screen.interactive:
        hint = f'give it as an argument: octoform answer {arguments.device} "..."'
        missing = error("ANSWER-NO-SENTENCE", "there is no sentence, and no terminal to ask for one", hint=hint)
        return problems.show(screen, [missing], as_json=arguments.json)
    known, found = questions.asked(project, os.environ)
    if known is None:
        return problems.show(screen, found)
    sentence = ""
    if arguments.device in known.devices:
        sentence = views.ask(screen, known.about(arguments.device), arguments.device)
        if not sentence:
            return views.passed_over(screen)
    told, found = questions.answer(project, os.environ, arguments.device, sentence)
    return problems.show(screen, found) if told is None else views.changed(screen, told, as_json=False)
