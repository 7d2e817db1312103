"""Foreign text in a prompt: bounded, made visible, and inside a fence that its content cannot close."""

import os
import re
from pathlib import Path

from octoform.base.files import stream
from octoform.escaping import escaped

_KEPT = "\n\t"


def fenced(label: str, text: str) -> str:
    """A code fence longer than any run of backquotes inside, labelled as data that gives no orders."""
    body = escaped(text, _KEPT)
    longest = max((len(run) for run in re.findall(r"`+", body)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}text data={label}\n{body.rstrip()}\n{fence}"


def tail(path: Path, lines: int, size: int) -> str:
    """The last ``lines`` lines of a log, at most ``size`` bytes once escaped, whatever it holds.

    Empty when there is none, or when it is not a plain file: an agent may put a link in its place.
    """
    try:
        with stream(path, follow=False) as log:
            log.seek(max(0, os.fstat(log.fileno()).st_size - size))
            data = log.read(size)
    except OSError:
        return ""  # no log is no reason to stop: the diagnostics say why the attempt failed
    text = escaped(data.decode("utf-8", "replace").replace("\r\n", "\n"), _KEPT).rstrip("\n")
    return cut("\n".join(text.split("\n")[-lines:]), size)


def cut(text: str, size: int) -> str:
    """The end of a text, at most ``size`` bytes in UTF-8; a character that is cut through is left out."""
    data = text.encode("utf-8", "replace")
    return data[max(0, len(data) - size) :].decode("utf-8", "ignore")
