"""One entry of a table of texts (``answers: {usb-...: "..."}``) written or removed by lines: no other byte moves.

A round trip through a YAML library keeps what a file means and its comments; it may still fold a line or move a blank.
Where an entry is a line of its own, or none is there yet, that line alone is touched. (Heavy: the YAML reader.)
"""

import json
import re
from collections.abc import Sequence

from octoform.manifest.source.parser import read_tree
from octoform.manifest.source.report import Report
from octoform.manifest.source.tree import Scalar, Table

_LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+")
_END = re.compile(r"[\r\n]+$")
INDENT = 2


def put(text: str, table: str, key: str, value: str) -> str | None:
    """The text with ``table.key`` set to ``value``; None where the table is written in another form than lines."""
    lines, root = _LINE.findall(text), _root(text)
    if root is None:
        return None
    entry = root.get(table)
    if entry is None:
        longer = _appended(lines, table, key, value)
        # A text in braces, or one whose end is marked, has no next line.
        return longer if _root(longer) is not None else None
    name, content = entry
    if not isinstance(content, Table):
        return None
    if not content.entries:
        return _opened(lines, name, content, _entry(INDENT, key, value))
    if not _is_by_lines(lines, content):
        return None
    own = content.get(key)
    if own is not None:
        return _replaced(lines, own[1], value)
    last = content.entries[-1][1]
    at = last.last_line if isinstance(last, Scalar) else 0
    return _inserted(lines, at, _entry(content.entries[0][0].span.column - 1, key, value)) if at else None


def drop(text: str, table: str, key: str) -> str | None:
    """The text without ``table.key``; an emptied table becomes ``{}``. None where that cannot be done by lines."""
    lines, root = _LINE.findall(text), _root(text)
    entry = root.get(table) if root is not None else None
    content = entry[1] if entry is not None else None
    own = content.get(key) if isinstance(content, Table) else None
    if entry is None or own is None or not isinstance(content, Table) or not isinstance(own[1], Scalar):
        return None
    if not _is_by_lines(lines, content):
        return None
    kept = [*lines[: own[0].span.line - 1], *lines[own[1].last_line :]]
    if len(content.entries) == 1:
        at = entry[0].span
        head = kept[at.line - 1]
        colon = head.index(":", at.column - 1 + len(table)) + 1
        kept[at.line - 1] = f"{head[:colon]} {{}}{head[colon:]}"
    return "".join(kept)


def _root(text: str) -> Table | None:
    """The tree of a text whose line ends are one character each in it, as the reader counts."""
    plain = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    return read_tree(plain, Report("octopus.yaml"))


def _is_by_lines(lines: Sequence[str], content: Table) -> bool:
    """True where each entry begins a line of its own."""
    keys = [key.span for key, _ in content.entries]
    return all(not lines[at.line - 1][: at.column - 1].strip(" \ufeff") for at in keys)


def _entry(indent: int, key: str, value: str) -> str:
    return f"{' ' * indent}{key}: {_quoted(value)}"


def _quoted(value: str) -> str:
    """A text as YAML and JSON both write it, on one line."""
    return json.dumps(value, ensure_ascii=False)


def _appended(lines: list[str], table: str, key: str, value: str) -> str:
    end = _line_end(lines)
    head = "".join(lines)
    head += "" if not head or _END.search(head) else end
    return f"{head}{table}:{end}{_entry(INDENT, key, value)}{end}"


def _opened(lines: list[str], name: Scalar, content: Table, entry: str) -> str | None:
    """The entry below the key, in the place of an empty ``{}``."""
    at, line = content.span, lines[content.span.line - 1]
    if at.line != name.span.line or not line.startswith("{}", at.column - 1):
        return None
    before, after = line[: at.column - 1], line[at.column + 1 :]
    lines[at.line - 1] = f"{before.rstrip(' ')}{after}" if _END.fullmatch(after) or not after else f"{before}{after}"
    return _inserted(lines, at.line, entry)


def _replaced(lines: list[str], old: object, value: str) -> str | None:
    if not isinstance(old, Scalar):
        return None
    first, last = lines[old.span.line - 1], lines[old.last_line - 1]
    end = _END.search(last)
    tail = end.group() if end else ""
    if old.span.end_column is not None:
        tail = first[old.span.end_column - 1 :]
    lines[old.span.line - 1 : old.last_line] = [f"{first[: old.span.column - 1]}{_quoted(value)}{tail}"]
    return "".join(lines)


def _inserted(lines: list[str], after: int, entry: str) -> str:
    """The lines with one more behind line ``after`` (counted from 1)."""
    end = _line_end(lines)
    if not _END.search(lines[after - 1]):
        lines[after - 1] += end
        lines.insert(after, entry)
    else:
        lines.insert(after, entry + end)
    return "".join(lines)


def _line_end(lines: Sequence[str]) -> str:
    found = _END.search(lines[0]) if lines else None
    return found.group() if found else "\n"
