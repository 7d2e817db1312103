"""``call``: one tool of the live endpoint, as any MCP client would."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.parser import seconds
from octoform.engine.serving import call
from octoform.views import endpoint, problems
from octoform.views.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when the tool answered with an error."""
    given = arguments.json_arguments or None
    as_json = arguments.json_arguments is not None
    result, found = call(project, os.environ, arguments.tool, arguments.arg, given, seconds(arguments.timeout))
    if result is None:
        return problems.show(screen, found, as_json=as_json)
    problems.show(screen, found)
    return endpoint.answer(screen, arguments.tool, result, as_json=as_json)
