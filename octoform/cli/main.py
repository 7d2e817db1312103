"""The entry point. What is asked for most often is answered before anything else is loaded: a client's pipe, the help.

Each conversation of a client starts one, and a small board takes a tenth of a second for every library that is omitted.
All that is not that simple is left to the command itself.
"""

import os
import sys
from collections.abc import Sequence

TYPE_CHECKING = False  # as type checkers know it: typing brings the library of expressions with it
if TYPE_CHECKING:
    from octoform.endpoint.stdio import Again

CHDIR = ("-chdir=", "--chdir=")
PLACE = "/.octoform/{host}/run/endpoint.sock"
_LETTERS = frozenset("abcdefghijklmnopqrstuvwxyz0123456789-")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; the exit codes are those of ``octoform --help``."""
    words = sys.argv[1:] if argv is None else list(argv)
    if None in (sys.stdin, sys.stdout, sys.stderr):
        _reopen()
    if words[-2:-1] == ["connect"]:
        status = connected(words)
        if status is not None:
            return status
    if words in (["-h"], ["-help"], ["--help"]) and _is_helped():
        return 0
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


def _is_helped() -> bool:
    """Print the help on all commands; False where that failed, and the long way reports why."""
    from octoform.cli.table import overview
    from octoform.views.format.console import for_process

    screen = for_process()
    try:
        for text in overview():
            screen.line(text)
    except OSError:
        return False
    return True


def connected(words: Sequence[str]) -> int | None:
    """The exit status of ``octoform -chdir=FOLDER connect HOST`` to an endpoint that runs, once the client is done.

    None when it takes the long way.
    """
    from octoform.endpoint import sockets  # a pipe needs no more than these two
    from octoform.endpoint.stdio import pipe

    folder = _folder(words[:-2])
    if folder is None or not words[-1] or not _LETTERS.issuperset(words[-1]):
        return None
    try:
        connection = sockets.greeted(folder + PLACE.format(host=words[-1]), 5.0)
    except OSError:
        return None
    with connection:
        return 0 if pipe(connection, again=lambda: _again(folder, words[-1])) else _stopped(words[-1])


def _again(folder: str, host: str) -> "Again":
    from pathlib import Path  # all of this only where an endpoint has ended

    from octoform.endpoint.dial import Returning
    from octoform.state.layout import Layout

    return Returning(Layout(Path(folder).absolute(), host))


def _folder(words: Sequence[str]) -> str | None:
    if not words:
        return "."
    folders = [words[0][len(name) :] for name in CHDIR if words[0].startswith(name)]
    return folders[0] if folders and len(words) == 1 else None


def _stopped(host: str) -> int:
    # Standard output belongs to the protocol.
    print(f"octoform: the endpoint of {host} was stopped", file=sys.stderr)
    return 1
