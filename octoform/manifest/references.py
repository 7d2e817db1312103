"""References to environment variables, ``${NAME}``: found and checked at load, resolved only when a harness starts.

``$${`` stands for a plain ``${``, so that a shell's own variables can be written in a command.
"""

import re
from collections.abc import Mapping

from octoform.patterns import regex

NAME = regex(r"[A-Za-z_][A-Za-z0-9_]*")
_REFERENCE = regex(r"\$?\$\{([^{}]*)\}?")


def contains(text: str) -> bool:
    """True when the text holds a reference, well formed or not."""
    return any(not found.group().startswith("$$") for found in _REFERENCE.finditer(text))


def names(text: str) -> tuple[str, ...]:
    """The names of the well-formed references, in order."""
    return tuple(found.group(1) for found in _REFERENCE.finditer(text) if _is_well_formed(found))


def malformed(text: str) -> tuple[str, ...]:
    """The references that hold no variable name or are not closed, as they are written."""
    return tuple(
        found.group()
        for found in _REFERENCE.finditer(text)
        if not found.group().startswith("$$") and not _is_well_formed(found)
    )


def resolve(text: str, environ: Mapping[str, str]) -> str:
    """The text with every reference replaced; KeyError for a variable that is not set.

    A manifest is only loaded when all its variables are set, so with the same environment this does not raise.
    """

    def value(found: re.Match[str]) -> str:
        if found.group().startswith("$$"):
            return found.group()[1:]
        return environ[found.group(1)] if _is_well_formed(found) else found.group()

    return _REFERENCE.sub(value, text)


def resolve_argument(text: str, environ: Mapping[str, str]) -> str:
    """As `resolve`, for an argument in which placeholders in braces are filled in later.

    Braces that come out of here are doubled, so that neither a variable's value nor a plain ``${`` is taken for a
    placeholder.
    """

    def value(found: re.Match[str]) -> str:
        if found.group().startswith("$$"):
            return found.group()[1:].replace("{", "{{").replace("}", "}}")
        if not _is_well_formed(found):
            return found.group()
        return environ[found.group(1)].replace("{", "{{").replace("}", "}}")

    return _REFERENCE.sub(value, text)


def _is_well_formed(found: re.Match[str]) -> bool:
    text = found.group()
    return not text.startswith("$$") and text.endswith("}") and NAME.fullmatch(found.group(1)) is not None
