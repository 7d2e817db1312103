"""One rule for every stage: text that comes from outside shows all of its characters.

Device strings go into terminals, prompts, reviews and, as descriptions of tools, to the models that use the endpoint.
What does not show there may act on them: an escape sequence, a mark that turns the direction of writing, letters of
no width. PROBE writes such characters as escapes; no one after it needs any other.
"""

from collections.abc import Collection, Iterator
from typing import Any

from octoform.base.escaping import escaped, escaped_json, is_hidden
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, RuleCheck
from octoform.diagnostics import Diagnostic, Span, error

_KEPT = "\n\t"


def in_values(code: str, several_lines: Collection[str] | None = None) -> RuleCheck:
    """The rule over a JSON artifact; only members of these names (None: all) may hold line ends and tabs."""

    def check(value: Any, _: Artifacts) -> list[Diagnostic]:
        found = []
        for where, text in _strings(value, ()):
            kept = _KEPT if several_lines is None or where[-1] in several_lines else ""
            bad = _first_hidden(text, kept)
            if bad is not None:
                found.append(error(code, _summary(text[bad]), pointer=pointer(*where), hint=_hint(text[bad])))
        return found

    return check


def in_source(code: str) -> RuleCheck:
    """The rule over a program's text as it is in its file; escapes in its literals are visible."""

    def check(value: str, _: Artifacts) -> list[Diagnostic]:
        found = []
        for number, line in enumerate(value.split("\n"), 1):
            bad = _first_hidden(line.removesuffix("\r"), "\t\f")
            if bad is not None:
                place = Span(number, bad + 1)
                found.append(error(code, _summary(line[bad]), span=place, source=line, hint=_hint(line[bad])))
        return found

    return check


def _first_hidden(text: str, kept: str) -> int | None:
    if text.isascii() and text.isprintable():
        return None
    return next((at for at, item in enumerate(text) if is_hidden(item) and item not in kept), None)


def _summary(character: str) -> str:
    return f"the text holds the character {escaped(character)} unescaped"


def _hint(character: str) -> str:
    return f"write it as the six characters {escaped_json(character)}" if ord(character) < 0x10000 else "leave it out"


def _strings(value: Any, where: tuple[str | int, ...]) -> Iterator[tuple[tuple[str | int, ...], str]]:
    if isinstance(value, str):
        yield where, value
    elif isinstance(value, dict):
        for name, item in value.items():
            yield (*where, name), name
            yield from _strings(item, (*where, name))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _strings(item, (*where, index))
