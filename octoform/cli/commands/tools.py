"""Commands that use the endpoint: list its tools, call one, look through its camera.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

import os
import shlex
from argparse import Namespace
from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from octoform.cli.dispatch import Stopped
from octoform.cli.parser import UsageError, seconds
from octoform.diagnostics import error
from octoform.views.format import problems
from octoform.views.format.console import Console

if TYPE_CHECKING:
    from octoform.endpoint.client.terminal import Person
    from octoform.engine.look import Eye, Look


def run_tools(arguments: Namespace, project: Path, screen: Console) -> int:
    """Asks the endpoint itself, not a file."""
    from octoform.engine.tools import tools
    from octoform.views.endpoint import tools as tools_view
    from octoform.views.endpoint.tools import starting

    wait, names = partial(starting, screen), arguments.tools
    listed, found = tools(project, os.environ, wait, names=names, revive=arguments.start)
    if listed is None:
        return problems.show(screen, found, as_json=arguments.json)
    return tools_view.tools(screen, listed, as_json=arguments.json)


def run_call(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when the tool answered with an error."""
    from octoform.engine.tools import Request, answered, call, example, tools
    from octoform.views.endpoint import tools as tools_view
    from octoform.views.endpoint.tools import attended, starting

    as_json, document = arguments.json_arguments is not None, arguments.json_arguments or None
    if arguments.tool is None:
        if arguments.arg or document:
            raise UsageError("arguments need the name of their tool: octoform call TOOL -arg NAME=VALUE", "")
        listed, found = tools(project, os.environ, partial(starting, screen), revive=arguments.start)
        shown = example(listed or (), answered(project, os.environ))
        if listed == [] and not as_json:
            return tools_view.tools(screen, listed, as_json=False)  # a host with nothing to call is no failure
        if shown is None:
            hint = "octoform tools lists them; octoform call TOOL -arg NAME=VALUE calls one"
            nothing = [
                error("ENDPOINT-NO-EXAMPLE", "no tool here only reads and needs nothing but a choice", hint=hint)
            ]
            return problems.show(screen, found if listed is None else nothing, as_json=as_json)
        arguments.tool, arguments.arg = shown
        screen.problem("octoform: an example: octoform call " + " ".join([arguments.tool, *_typed(arguments.arg)]))
    dry, approved = arguments.dry_run, arguments.auto_approve
    request = Request(
        arguments.tool, arguments.arg, document, seconds(arguments.timeout), dry, approved, arguments.start
    )
    given_up = f"the call of {arguments.tool} was given up"
    try:
        with attended(screen, approved=approved) as person:
            answer, found = call(project, os.environ, request, person)
    except Stopped as stopped:
        return problems.stopped(screen, stopped.number, given_up)
    except KeyboardInterrupt:
        return problems.interrupted(screen, given_up)
    if answer is None:
        return problems.show(screen, found, as_json=as_json)
    problems.show(screen, found)
    return tools_view.answer(screen, arguments.tool, answer, as_json=as_json)


def _typed(pairs: list[str]) -> list[str]:
    """The arguments as a shell takes them."""
    return [word for pair in pairs for word in ("-arg", shlex.quote(pair))]


_USAGE = "usage: octoform look [-device ID] [-save FILE] [-every [DURATION]] [-count N] [-json]"


_SHORTEST = 1.0


def run_look(arguments: Namespace, project: Path, screen: Console) -> int:
    """0 for a picture that shows something, 1 for none, 2 for one that shows nothing; with -every that of the last."""
    from octoform.engine.look import open_eye
    from octoform.views.endpoint.tools import attended

    count, interval = _count(arguments), _interval(arguments)
    if arguments.save == "":
        raise UsageError("-save: give the file that the picture should be written to", _USAGE)
    eye, found = open_eye(project, os.environ, arguments.device)
    if eye is None:
        return problems.show(screen, found, as_json=arguments.json)
    problems.show(screen, found)
    if arguments.every == "" and not eye.settings.enabled:
        hint = "write perception: {enabled: true} into octopus.yaml, or give the interval: -every 30s"
        off = error("PERCEPTION-OFF", "octoform may not look by itself at this host", hint=hint)
        return problems.show(screen, [off], as_json=arguments.json)
    status = 0
    try:
        with attended(screen, approved=False) as person:
            for number, seen in enumerate(_looks(eye, interval, count, person), 1):
                person.clear()
                path = _file(arguments.save, number if interval is not None else 0)
                status = _print_look(screen, seen, path, as_json=arguments.json)
    except Stopped as stopped:
        return 128 + stopped.number
    except KeyboardInterrupt:
        return 130
    return status


def _looks(eye: Eye, interval: float | None, count: int | None, person: Person) -> Iterator[Look]:
    from octoform.engine.look import heartbeat, look

    if interval is None:
        return iter((look(eye, person),))
    return islice(heartbeat(eye, interval or eye.settings.interval, person), count)


def _print_look(screen: Console, seen: Look, path: Path | None, *, as_json: bool) -> int:
    """The look with its picture saved; a picture that can't be written is an error whatever it shows."""
    from octoform.engine.look import save
    from octoform.perception.capture import Taken
    from octoform.views.endpoint import tools as view

    problem = save(seen.outcome, path.absolute()) if path is not None and isinstance(seen.outcome, Taken) else None
    saved = path if isinstance(seen.outcome, Taken) and problem is None else None
    status = view.one(screen, seen, saved, as_json=as_json)
    return max(status, problems.show(screen, [problem])) if problem is not None else status


def _file(text: str | None, number: int) -> Path | None:
    """Where a picture goes: ``shot.jpg``, and of a row of looks ``shot-0001.jpg``."""
    if text is None:
        return None
    path = Path(text)
    return path.with_name(f"{path.stem}-{number:04d}{path.suffix}") if number else path


def _count(arguments: Namespace) -> int | None:
    text = arguments.count
    if text is None:
        return None
    if arguments.every is None:
        raise UsageError("-count limits the pictures of -every; without -every there is one picture", _USAGE)
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise UsageError(f"-count: {text!r} is no number of looks", _USAGE)
    return int(text)


def _interval(arguments: Namespace) -> float | None:
    """Seconds from one look to the next; 0.0 as the manifest has it, None for one look."""
    if not arguments.every:
        return None if arguments.every is None else 0.0
    length = seconds(arguments.every)
    if length < _SHORTEST:
        raise UsageError(f"-every: {arguments.every} is too often; a picture takes a second at least", _USAGE)
    return length
