"""Foreign text in a prompt: bounded, made visible, and inside a fence that its content cannot close."""

import re
import unicodedata
from pathlib import Path

_HIDDEN = ("Cc", "Cf", "Cs", "Co", "Zl", "Zp")


def escaped(text: str) -> str:
    """Control, format and bidirectional characters as ``\\uNNNN``; line feeds and tabs stay."""
    shown = (
        char if char in "\n\t" or unicodedata.category(char) not in _HIDDEN else f"\\u{ord(char):04x}" for char in text
    )
    return "".join(shown)


def fenced(label: str, text: str) -> str:
    """A code fence longer than any run of backquotes inside, labelled as data that gives no orders."""
    body = escaped(text)
    longest = max((len(run) for run in re.findall(r"`+", body)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}text data={label}\n{body.rstrip()}\n{fence}"


def tail(path: Path, lines: int, size: int) -> str:
    """The last ``lines`` lines of a log, at most ``size`` bytes, whatever its bytes are; empty when there is none."""
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - size))
        data = file.read(size)
    return "\n".join(data.decode("utf-8", "replace").splitlines()[-lines:])
