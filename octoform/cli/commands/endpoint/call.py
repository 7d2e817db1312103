"""``call``: one tool of the live endpoint, as any MCP client would."""

import os
import shlex
from argparse import Namespace
from functools import partial
from pathlib import Path

from octoform.cli.options import UsageError
from octoform.cli.parser import seconds
from octoform.cli.signals import Stopped
from octoform.diagnostics import error
from octoform.engine.tools import Request, answered, call, example, tools
from octoform.views.endpoint import tools as tools_view
from octoform.views.endpoint.tools import attended, starting
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when the tool answered with an error."""
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
