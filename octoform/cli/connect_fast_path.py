"""``octoform -chdir=FOLDER connect HOST`` to an endpoint that runs, with nothing loaded that a pipe does not need.

This is how clients start it, and a small board takes a tenth of a second for every library that is omitted. All that
is not that simple is left to the command itself.
"""

import sys
from collections.abc import Sequence

from octoform.endpoint import sockets
from octoform.endpoint.stdio import Again, pipe

CHDIR = ("-chdir=", "--chdir=")
PLACE = "/.octoform/{host}/run/endpoint.sock"
_LETTERS = frozenset("abcdefghijklmnopqrstuvwxyz0123456789-")


def connected(words: Sequence[str]) -> int | None:
    """The exit status once the client is done; None when it takes the long way."""
    folder = _folder(words[:-2])
    if folder is None or not words[-1] or not _LETTERS.issuperset(words[-1]):
        return None
    try:
        connection = sockets.greeted(folder + PLACE.format(host=words[-1]), 5.0)
    except OSError:
        return None
    with connection:
        return 0 if pipe(connection, again=lambda: _again(folder, words[-1])) else _stopped(words[-1])


def _again(folder: str, host: str) -> Again:
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
