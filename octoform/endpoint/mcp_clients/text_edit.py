"""The common part of the three notations of configuration files: where reading failed, and the way to a value.

Every notation is a module with the same three functions, see `Notation`. They work on text without a byte order
mark and leave every character alone that does not belong to the one change.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from octoform.patterns import regex
from octoform.records import dataclass

Path: TypeAlias = tuple[str, ...]
_LINE_END = regex(r"\r\n|\n|\r")


@dataclass(frozen=True, slots=True)
class Unreadable:
    """Why a string cannot be read or not be changed; ``offset`` is the place, None for the whole of it."""

    reason: str
    offset: int | None = None


@dataclass(frozen=True, slots=True)
class Notation:
    """One notation of configuration files.

    ``read(text)`` is the plain content, {} for a string without any. ``put(text, path, value)`` sets one value, making
    the tables on the way; ``drop(text, path)`` takes a member away, the text as it is when there is none. Both want a
    text that can be read and a way that is not blocked by a value of another kind, and give the new text, or why the
    text has no room for the change. ``where(text, path)`` is the offset of a member, None where that cannot be
    determined.
    """

    read: Callable[[str], "dict[str, Any] | Unreadable"]
    put: Callable[[str, Path, Any], "str | Unreadable"]
    drop: Callable[[str, Path], "str | Unreadable"]
    where: Callable[[str, Path], int | None]


def place(text: str, offset: int) -> tuple[int, int, str]:
    """Line and column (from 1) of an offset, and that line."""
    offset = min(max(offset, 0), len(text))
    start, line = 0, 1
    for found in _LINE_END.finditer(text, 0, offset):
        start, line = found.end(), line + 1
    after = _LINE_END.search(text, start)
    return line, offset - start + 1, text[start : after.start() if after else len(text)]


def line_end(text: str) -> str:
    """The line end that the text uses first; a line feed where it has none."""
    found = _LINE_END.search(text)
    return found[0] if found else "\n"


def line_start(text: str, offset: int) -> int:
    """Where the line of an offset begins."""
    return max(text.rfind("\n", 0, offset), text.rfind("\r", 0, offset)) + 1


def rest_of_line(text: str, offset: int) -> int:
    """Where the line of an offset ends, before its line end."""
    found = _LINE_END.search(text, offset)
    return found.start() if found else len(text)


def indent_at(text: str, offset: int) -> str:
    """The blanks at the beginning of an offset's line."""
    start = line_start(text, offset)
    end = start
    while end < len(text) and text[end] in " \t":
        end += 1
    return text[start:end]


def nested(keys: Sequence[str], value: Any) -> Any:
    """The value inside one table for each key."""
    for key in reversed(keys):
        value = {key: value}
    return value


def at(content: Any, path: Sequence[str]) -> Any:
    """The value at a path of plain content, None when it ends before."""
    for key in path:
        if not isinstance(content, Mapping) or key not in content:
            return None
        content = content[key]
    return content
