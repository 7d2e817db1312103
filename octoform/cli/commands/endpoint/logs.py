"""``logs``: what the endpoint did and what its process printed; with ``-f`` as it happens."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.options import UsageError
from octoform.cli.signals import Stopped
from octoform.endpoint.observe.logs import Logs
from octoform.engine.inspect.state import entries, following, lines, open_logs
from octoform.views.endpoint import logs as view
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0; with ``-f`` that of the signal which ended it, since nothing else does."""
    count = _count(arguments.n)
    logs, found = open_logs(project, os.environ)
    if logs is None:
        return problems.show(screen, found, as_json=arguments.json)
    try:
        show = _objects if arguments.json else _sentences
        show(logs, screen, count, arguments.follow)
    except Stopped as stopped:
        return 128 + stopped.number
    except KeyboardInterrupt:
        return 130
    finally:
        logs.close()
    return 0


def _sentences(logs: Logs, screen: Console, count: int, follow: bool) -> None:
    known, pairing = entries(logs)
    view.human(screen, known[max(0, len(known) - count) :])
    if not known and not follow:
        view.nothing(screen)
    if follow:
        for new in following(logs, pairing, view.Reader(screen).waits):
            view.human(screen, new)


def _objects(logs: Logs, screen: Console, count: int, follow: bool) -> None:
    known = logs.read()
    view.machine(screen, known[max(0, len(known) - count) :])
    if follow:
        for new in lines(logs, view.Reader(screen).waits):
            view.machine(screen, new)


def _count(text: str) -> int:
    if not text.isascii() or not text.isdigit():
        raise UsageError(f"-n: {text!r} is not a number of lines", "usage: octoform logs [-f] [-n LINES] [-json]")
    return int(text)
