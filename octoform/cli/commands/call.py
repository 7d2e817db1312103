"""``call``: one tool of the live endpoint, as any MCP client would."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.parser import seconds
from octoform.cli.stopping import Stopped
from octoform.engine.serving import Request, call
from octoform.views import endpoint, problems
from octoform.views.calling import attended
from octoform.views.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when the tool answered with an error."""
    as_json, document = arguments.json_arguments is not None, arguments.json_arguments or None
    dry, approved = arguments.dry_run, arguments.auto_approve
    request = Request(arguments.tool, arguments.arg, document, seconds(arguments.timeout), dry, approved)
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
    return endpoint.answer(screen, arguments.tool, answer, as_json=as_json)
