"""``connect``: the stdio command of every client of this machine. Loads next to nothing."""

import sys
from argparse import Namespace
from pathlib import Path

from octoform.endpoint.proxy.connect import connect
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 when the client closed the connection, 1 when the endpoint did or never came up."""
    if arguments.print is not None:
        from octoform.cli.commands.endpoint.clients import printed

        return printed(arguments, project, screen)
    problem = connect(project, arguments.host, revive=arguments.start)
    if problem is None:
        return 0
    # Standard output belongs to the protocol.
    print(f"octoform: {problem}", file=sys.stderr)
    return 1
