"""The entry point. A pipe of a client is taken up before anything else is loaded: each conversation starts one."""

import os
import sys
from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; the exit codes are those of ``octoform --help``."""
    words = sys.argv[1:] if argv is None else list(argv)
    if None in (sys.stdin, sys.stdout, sys.stderr):
        _reopen()
    if words[-2:-1] == ["connect"]:
        from octoform.cli.connect_fast_path import connected

        status = connected(words)
        if status is not None:
            return status
    from octoform.cli.dispatch import dispatch

    return dispatch(words)


def _reopen() -> None:
    """A stream that the caller has closed (``>&-``) leads nowhere: else the next file opened would be printed into."""
    while os.open(os.devnull, os.O_RDWR) < 2:
        continue
    for number in range(3):
        os.set_inheritable(number, True)
    sys.stdin = sys.stdin or os.fdopen(0, closefd=False)
    sys.stdout = sys.stdout or os.fdopen(1, "w", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(2, "w", closefd=False)
