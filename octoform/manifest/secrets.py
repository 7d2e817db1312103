"""What looks like a secret, and how it is kept out of every message.

A manifest stands in git, so a literal credential in it is already a leak; the message about it must not be a second
one. The patterns are the public prefixes of well-known token formats, the header of a private key, credentials in a
URL, and any literal under a key or behind an option whose name says that it is a secret.
"""

import re
from collections.abc import Iterator

_TOKENS = (
    r"(?<![A-Za-z0-9])sk-[A-Za-z0-9_-]{12,}",
    r"(?<![A-Za-z0-9])[rsp]k_(?:live|test)_[A-Za-z0-9]{12,}",
    r"(?<![A-Za-z0-9])gh[pousr]_[A-Za-z0-9]{16,}",
    r"(?<![A-Za-z0-9])github_pat_[A-Za-z0-9_]{16,}",
    r"(?<![A-Za-z0-9])glpat-[A-Za-z0-9_-]{16,}",
    r"(?<![A-Za-z0-9])(?:AKIA|ASIA)[A-Z0-9]{16}(?![A-Z0-9])",
    r"(?<![A-Za-z0-9])AIza[A-Za-z0-9_-]{30,}",
    r"(?<![A-Za-z0-9])xox[abeoprs]-[A-Za-z0-9-]{10,}",
    r"(?<![A-Za-z0-9])hf_[A-Za-z0-9]{20,}",
    r"(?<![A-Za-z0-9])npm_[A-Za-z0-9]{30,}",
    r"(?<![A-Za-z0-9])eyJ[A-Za-z0-9_-]{8,}\.[A-Za-z0-9_-]{8,}\.[A-Za-z0-9_-]*",
    r"(?i:bearer)\s+(?!\$)[A-Za-z0-9._~+/-]{12,}=*",
    r"(?<=://)[^/\s:@'\"]+:(?!\$)[^/\s@'\"]+(?=@)",
)
_TOKEN = re.compile("|".join(f"(?:{pattern})" for pattern in _TOKENS))
_WORD = r"(?:(?:api|access|secret|private)[-_]?keys?|(?:auth[-_]?)?token|secrets?|pass(?:word|wd|phrase)|credentials?)"
_SECRET_NAME = re.compile(rf"(?i)(?:^|.*[-_.]|-*){_WORD}")
_ASSIGNMENT = re.compile(rf"(?i)(?<![A-Za-z]){_WORD}['\"]?\s*[=:]\s*['\"]?(?!\$)([^\s'\",}}\]]{{6,}})")
_KEY_BEGINS = re.compile(r"-----BEGIN [A-Z0-9 ]*PRIVATE KEY(?: BLOCK)?-----")
_KEY_ENDS = re.compile(r"-----END [A-Z0-9 ]*PRIVATE KEY(?: BLOCK)?-----")


def found_in(text: str) -> list[tuple[int, int]]:
    """Where well-known secrets stand in a text: (start, end) offsets, in order."""
    return [found.span() for found in _TOKEN.finditer(text)] + [found.span() for found in _KEY_BEGINS.finditer(text)]


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
