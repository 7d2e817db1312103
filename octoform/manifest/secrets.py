"""What looks like a secret, and how it is kept out of every message.

A manifest stands in git, so a literal credential in it is already a leak; the message about it must not be a second
one. Beside what shows by its form that it is a secret (`octoform.redaction`) it is any literal under a key or behind an
option whose name says that it is one.
"""

import re
from collections.abc import Iterator

from octoform.redaction import found_in
from octoform.redaction.forms import KEY_BEGIN, KEY_END

__all__ = ["assigned_in", "found_in", "is_secret_name", "key_blocks", "masked"]

_WORD = r"(?:(?:api|access|secret|private)[-_]?keys?|(?:auth[-_]?)?token|secrets?|pass(?:word|wd|phrase)|credentials?)"
_SECRET_NAME = re.compile(rf"(?i)(?:^|.*[-_.]|-*){_WORD}")
_ASSIGNMENT = re.compile(rf"(?i)(?<![A-Za-z]){_WORD}['\"]?\s*[=:]\s*['\"]?(?!\$)([^\s'\",}}\]]{{6,}})")
_KEY_BEGINS = re.compile(KEY_BEGIN.source())
_KEY_ENDS = re.compile(KEY_END.source())


def assigned_in(text: str) -> list[tuple[int, int]]:
    """Where a literal is given to a secret's name inside a text (``--api-key=...``): (start, end) offsets."""
    return [found.span(1) for found in _ASSIGNMENT.finditer(text)]


def is_secret_name(name: str) -> bool:
    """True for the name of a key or an option whose value is a secret (``api_key``, ``--token``)."""
    return _SECRET_NAME.fullmatch(name) is not None


def masked(text: str) -> str:
    """The text with everything that looks like a secret replaced by asterisks of the same length."""
    for start, end in (*found_in(text), *assigned_in(text)):
        text = text[:start] + "*" * (end - start) + text[end:]
    return text


def key_blocks(lines: list[str]) -> Iterator[tuple[int, int]]:
    """The lines of private keys as (first, last) indexes; a key that never ends reaches to the end of the file."""
    first: int | None = None
    for number, line in enumerate(lines):
        if first is None and _KEY_BEGINS.search(line):
            first = number
        if first is not None and _KEY_ENDS.search(line):
            yield first, number
            first = None
    if first is not None:
        yield first, len(lines) - 1
