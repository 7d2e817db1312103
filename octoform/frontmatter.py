"""Markdown files that begin with YAML front matter: the fields as plain values, each with its place in the file.

Specs and profiles are such files. Only plain values are read: no anchors, aliases or tags, so a small file cannot grow
into a large value, and nothing is ever constructed but text, numbers, booleans, lists and mappings. (Heavy: ruamel.)
"""

import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from octoform.base import files
from octoform.diagnostics import Diagnostic, Span, error
from octoform.records import dataclass, field

MAX_BYTES = 64 * 1024
FENCE = "---"
ALL: frozenset[str] = frozenset()
"""Every field there is."""
_CORE = "tag:yaml.org,2002:"

Place = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class Document:
    """One file: ``text`` as it stands, ``body`` after the front matter, ``fields`` of the front matter.

    ``places`` maps the path of each value (``("limits", 0, "maximum")``) to where it stands.
    """

    path: Path
    text: str
    body: str
    fields: Mapping[str, Any]
    places: Mapping[Place, Span] = field(default_factory=dict)

    def problem(self, code: str, summary: str, place: Place = (), hint: str | None = None) -> Diagnostic:
        """An error at the value with that path, or at the nearest one around it."""
        while place and place not in self.places:
            place = place[:-1]
        span = self.places.get(place, Span(1, 1))
        return error(code, summary, path=str(self.path), span=span, source=_line(self.text, span.line), hint=hint)


def read(path: Path, code: str, names: frozenset[str] = ALL) -> tuple[Document | None, list[Diagnostic]]:
    """The file, or why it cannot be read; every problem carries ``code``.

    With ``names`` it has these fields alone, each of which begins a line: a long definition takes long to read.
    """
    try:
        data = files.head(path, MAX_BYTES + 1, follow=True)
    except OSError as reason:
        closed = isinstance(reason, PermissionError)
        hint = "ask its owner for the right to read it" if closed else "replace it by a text file"
        return None, [error(code, f"the file cannot be read: {reason.strerror}", path=str(path), hint=hint)]
    if len(data) > MAX_BYTES:
        return None, [error(code, f"the file is larger than {MAX_BYTES} bytes", path=str(path), hint="shorten it")]
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        line = data[: reason.start].count(b"\n") + 1
        column = reason.start - (data.rfind(b"\n", 0, reason.start) + 1) + 1
        summary = "the file is not UTF-8"
        return None, [error(code, summary, path=str(path), span=Span(line, column), hint="save it as UTF-8")]
    return parse(path, text.replace("\r\n", "\n"), code, names)


def parse(path: Path, text: str, code: str, names: frozenset[str] = ALL) -> tuple[Document | None, list[Diagnostic]]:
    """The text of a file as a document; see `read`."""
    document, found = _parsed(path, text, code, names)
    return document, list(found)


@lru_cache(maxsize=64)
def _parsed(path: Path, text: str, code: str, names: frozenset[str]) -> tuple[Document | None, tuple[Diagnostic, ...]]:
    """A run comes back to the same files again and again, and to parse one takes as long as a short plan."""
    at = text.find("\0")
    if at >= 0:  # no program takes it in an argument, and a prompt is one
        line, column = text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at)
        where, summary = Span(line, column), "the character U+0000 may not be in the file"
        return None, (error(code, summary, path=str(path), span=where, source=_line(text, line), hint="delete it"),)
    lines = text.split("\n")
    if lines[0].rstrip() != FENCE:
        hint = f"begin the file with a line {FENCE}, the fields, and another line {FENCE}"
        where = Span(1, 1)
        return None, (error(code, "there is no front matter", path=str(path), span=where, source=lines[0], hint=hint),)
    end = next((number for number, line in enumerate(lines[1:], 1) if line.rstrip() == FENCE), None)
    if end is None:
        hint = f"close it with a line {FENCE}"
        return None, (error(code, "the front matter has no end", path=str(path), span=Span(1, 1), hint=hint),)
    body = "\n".join(lines[end + 1 :]).lstrip("\n")
    reading = _Reading(path, text, code)
    fields = reading.fields("\n".join(["", *_lines_of(names, lines[1:end])]) + "\n")
    if reading.found:
        return None, tuple(reading.found)
    return Document(path, text, body, fields, reading.places), ()


def _lines_of(names: frozenset[str], lines: list[str]) -> list[str]:
    """The lines with those of other fields empty, so that each stays in its place."""
    if names == ALL:
        return lines
    kept, wanted = [], False
    for line in lines:
        if re.match(r"[\w'\"]", line):
            wanted = line.partition(":")[0].strip("'\" ") in names
        kept.append(line if wanted else "")
    return kept


class _Reading:
    """The walk over the parsed nodes, with what it has found so far."""

    def __init__(self, path: Path, text: str, code: str) -> None:
        self._path = path
        self._text = text
        self._code = code
        self.found: list[Diagnostic] = []
        self.places: dict[Place, Span] = {}

    def fields(self, source: str) -> dict[str, Any]:
        """The mapping of the front matter; empty, with a diagnostic, when it is no such thing."""
        try:
            node = YAML(typ="safe", pure=True).compose(source)
        except MarkedYAMLError as reason:
            mark = reason.problem_mark or reason.context_mark
            self._add(str(reason.problem or "wrong YAML"), mark.line + 1 if mark else 1, mark.column + 1 if mark else 1)
            return {}
        except YAMLError as reason:
            self._add(" ".join(str(reason).split())[:200], 1, 1)
            return {}
        except RecursionError:
            self._add("the front matter is nested too deeply", 2, 1)
            return {}
        if not isinstance(node, MappingNode):
            self._add("the front matter is no mapping of fields", 2, 1)
            return {}
        value = self._value(node, ())
        return value if isinstance(value, dict) else {}

    def _value(self, node: Node, place: Place) -> Any:
        if node.anchor is not None:
            self._add_at(node, "anchors and aliases are not allowed here")
            return None
        self.places[place] = _span(node)
        if isinstance(node, MappingNode):
            return self._mapping(node, place)
        if isinstance(node, SequenceNode):
            return [self._value(item, (*place, index)) for index, item in enumerate(node.value)]
        return self._scalar(node)

    def _mapping(self, node: MappingNode, place: Place) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for key, item in node.value:
            if not isinstance(key, ScalarNode) or key.anchor is not None:
                self._add_at(key, "a field's name must be plain text")
            elif key.value in out:
                self._add_at(key, f"the field {key.value!r} occurs twice")
            else:
                out[key.value] = self._value(item, (*place, key.value))
        return out

    def _scalar(self, node: Node) -> Any:
        kind = str(node.tag).removeprefix(_CORE)
        try:
            if kind == "int":
                return int(node.value)
            if kind == "float":
                return float(node.value)
        except ValueError:
            return node.value
        if kind == "bool":
            return node.value.casefold() == "true"
        if kind == "null":
            return None
        if kind not in ("str", "timestamp"):
            self._add_at(node, "tags are not allowed here")
        return node.value

    def _add_at(self, node: Node, summary: str) -> None:
        self._add(summary, node.start_mark.line + 1, node.start_mark.column + 1)

    def _add(self, summary: str, line: int, column: int) -> None:
        source = _line(self._text, line)
        where = Span(line, column)
        self.found.append(error(self._code, summary, path=str(self._path), span=where, source=source))


def _span(node: Node) -> Span:
    start, end = node.start_mark, node.end_mark
    return Span(start.line + 1, start.column + 1, end.column + 1 if end.line == start.line else None)


def _line(text: str, number: int) -> str | None:
    lines = text.split("\n")
    return lines[number - 1] if 0 < number <= len(lines) else None
