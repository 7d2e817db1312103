"""``clients`` and ``connect -print``: the endpoint in the configuration of MCP clients."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.options import UsageError
from octoform.engine import clients as engine
from octoform.views.endpoint import process
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when a file was left alone."""
    if arguments.verb == "list":
        listing, found = engine.listed(project, os.environ)
        if listing is None:
            return problems.show(screen, found, as_json=arguments.json)
        return process.listing(screen, listing, found, as_json=arguments.json)
    if arguments.verb == "install":
        outcome, found = engine.install(project, os.environ, arguments.client, _transport(arguments))
    else:
        outcome, found = engine.remove(project, os.environ, arguments.client)
    if outcome is None:
        return problems.show(screen, found, as_json=arguments.json)
    return process.outcome(screen, outcome, found, as_json=arguments.json)


def printed(arguments: Namespace, project: Path, screen: Console) -> int:
    """``connect -print CLIENT``: the text alone on standard output, what to know on standard error."""
    given, host, transport = arguments.print, arguments.host, _transport(arguments)
    text, found = engine.printed(project, os.environ, given, host, transport)
    if text is None:
        return problems.show(screen, found)
    problems.show(screen, found)
    return process.printed(screen, text)


def _transport(arguments: Namespace) -> str | None:
    if arguments.transport not in (None, *engine.TRANSPORTS):
        raise UsageError(f"-transport: {arguments.transport!r} is neither {' nor '.join(engine.TRANSPORTS)}", "")
    kind: str | None = arguments.transport
    return kind
