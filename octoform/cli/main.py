"""The entry point. A pipe of a client is taken up before anything else is loaded: each conversation starts one."""

import sys
from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; the exit codes are those of ``octoform --help``."""
    words = sys.argv[1:] if argv is None else list(argv)
    if words[-2:-1] == ["connect"]:
        from octoform.cli.connect_fast_path import connected

        status = connected(words)
        if status is not None:
            return status
    from octoform.cli.dispatch import dispatch

    return dispatch(words)
