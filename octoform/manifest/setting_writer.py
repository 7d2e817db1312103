"""Write one setting back into a person's octopus.yaml, with comments, order and line ends kept. (Heavy.)

The file belongs to its author. An edit that would lose a comment, change another setting or leave a manifest with
errors is refused, and the file stays as it was.
"""

import io
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.util import load_yaml_guess_indent

from octoform.base.files import read, replace
from octoform.diagnostics import Diagnostic, Severity, error
from octoform.manifest.loader import load, parse
from octoform.manifest.problem_list import ProblemList
from octoform.manifest.yaml_parser import read_tree
from octoform.manifest.yaml_tree import Scalar, Table, data
from octoform.patterns import regex
from octoform.records import dataclass

# One entry of a table of texts (``answers: {usb-...: "..."}``) written or removed by lines: no other byte moves.
#
# A round trip through a YAML library keeps what a file means and its comments; it may still fold a line or move a
# blank. Where an entry is a line of its own, or none is there yet, that line alone is touched. (Heavy: the YAML
# reader.)

_LINE = regex(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+")
_END = regex(r"[\r\n]+$")
INDENT = 2


def put(text: str, table: str, key: str, value: str) -> str | None:
    """The text with ``table.key`` set to ``value``; None where the table is written in another form than lines."""
    lines, root = _LINE.findall(text), _root(text)
    if root is None:
        return None
    entry = root.get(table)
    if entry is None:
        longer = _appended(lines, table, key, value)
        # A value in braces, or one whose end is marked, has no next line.
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
    """The tree of a string whose line ends are one character each in it, as the reader counts."""
    plain = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    return read_tree(plain, ProblemList("octopus.yaml"))


def _is_by_lines(lines: Sequence[str], content: Table) -> bool:
    """True where each entry begins a line of its own."""
    keys = [key.span for key, _ in content.entries]
    return all(not lines[at.line - 1][: at.column - 1].strip(" \ufeff") for at in keys)


def _entry(indent: int, key: str, value: str) -> str:
    return f"{' ' * indent}{key}: {_quoted(value)}"


def _quoted(value: str) -> str:
    """A string as YAML and JSON both write it, on one line."""
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


Value = str | int | bool | list[str]
_BOM = "\ufeff"
# The blanks before the first line that is nested in a table.
_NESTED = regex(r"^[^\s#-][^\n]*:[ ]*(?:#[^\n]*)?\n(?:[ ]*(?:#[^\n]*)?\n)*([ ]+)[^\s#-]", re.MULTILINE)
_UNFOLDED = 1_000_000


@dataclass(frozen=True, slots=True)
class Edited:
    """A manifest's text before and after an edit that was written."""

    before: str
    after: str


def change(
    path: Path, keys: Sequence[str], value: Value | None, environ: Mapping[str, str]
) -> tuple[Edited | None, list[Diagnostic]]:
    """Set the value at a path of keys, or take it out (None); the texts when it is written, else what is wrong.

    Missing tables on the way are made. ``environ`` is the environment that the manifest is checked with.
    """
    manifest, found = load(path, environ)
    if manifest is None:
        return None, found
    before = read(path).decode("utf-8")
    after, dotted = _changed(before, keys, value), ".".join(keys)
    if after is None:
        return None, [_refused(path, dotted, "a part of the name is no table")]
    if any("\ud800" <= sign <= "\udfff" for sign in after):
        return None, [_refused(path, dotted, "the string holds bytes that are not UTF-8")]
    _, found = parse(after.encode("utf-8"), path, environ)
    errors = [item for item in found if item.severity is Severity.ERROR]
    if errors:
        return None, errors
    if comments(before) != comments(after):
        return None, [_refused(path, dotted, "a comment would be lost or moved")]
    if _with(_plain(before), keys, value) != _plain(after):
        return None, [_refused(path, dotted, "another setting would change")]
    found = _replace(path, before.encode("utf-8"), after.encode("utf-8")) if before != after else []
    return (None, found) if found else (Edited(before, after), [])


def _changed(text: str, keys: Sequence[str], value: Value | None) -> str | None:
    """The text with the change: by lines where the entry is one, else by a round trip that keeps what it can."""
    after = None
    if len(keys) == 2 and value is None:
        after = drop(text, keys[0], keys[1])
    elif len(keys) == 2 and isinstance(value, str):
        after = put(text, keys[0], keys[1], value)
    return after if after is not None else _edited(text, keys, value)


def comments(text: str) -> list[str]:
    """The comments of a YAML text, in order: what is between its tokens and is no white space."""
    text = _lf(text)
    found: list[str] = []
    position = 0
    for token in YAML(typ="safe", pure=True).scan(text):
        found += re.findall(r"#[^\n]*", text[position : token.start_mark.index])
        position = max(position, token.end_mark.index)
    return [comment.rstrip() for comment in found + re.findall(r"#[^\n]*", text[position:])]


def _edited(text: str, keys: Sequence[str], value: Value | None) -> str | None:
    """The text with the value set, or None when the way to it is blocked by a value that is no table."""
    _, width, offset = load_yaml_guess_indent(_lf(text))
    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = _UNFOLDED
    yaml.explicit_start = _lf(text).startswith("---")
    nested = _NESTED.search(_lf(text))
    yaml.indent(mapping=len(nested.group(1)) if nested else 2, sequence=width or 2, offset=offset or 0)
    table = root = yaml.load(_lf(text))
    for key in keys[:-1]:
        table = table.setdefault(key, CommentedMap())
        if not isinstance(table, CommentedMap):
            return None
    if value is None:
        del table[keys[-1]]
    else:
        table[keys[-1]] = _listed(value, table.get(keys[-1])) if isinstance(value, list) else value
    out = io.StringIO()
    yaml.dump(root, out)
    line_end = "\r\n" if "\r\n" in text else "\n"
    return (_BOM if text.startswith(_BOM) else "") + out.getvalue().replace("\n", line_end)


def _listed(value: list[str], old: object) -> CommentedSeq:
    """A list in the form that was there, on one line where none did."""
    new = CommentedSeq(value)
    if not isinstance(old, CommentedSeq) or old.fa.flow_style() is not False:
        new.fa.set_flow_style()
    return new


def _lf(text: str) -> str:
    return text.removeprefix(_BOM).replace("\r\n", "\n").replace("\r", "\n")


def _plain(text: str) -> object:
    tree = read_tree(_lf(text), ProblemList("octopus.yaml"))
    return data(tree) if tree is not None else None


def _with(content: object, keys: Sequence[str], value: Value | None) -> object:
    if not keys:
        return value
    table = content if isinstance(content, dict) else {}
    if len(keys) == 1 and value is None:
        return {name: item for name, item in table.items() if name != keys[0]}
    return {**table, keys[0]: _with(table.get(keys[0]), keys[1:], value)}


def _refused(path: Path, dotted: str, reason: str) -> Diagnostic:
    return error(
        "MANIFEST-NOT-EDITED",
        f"`{dotted}` cannot be set without harm to the file: {reason}",
        path=str(path),
        hint="edit the file yourself; it was left as it is",
    )


class _Changed(Exception):
    """The file is no longer what was read."""


def _replace(path: Path, before: bytes, content: bytes) -> list[Diagnostic]:
    """Write beside the file, then rename over it if it is still as it was; a link stays a link."""
    target = path.resolve()
    if not target.stat().st_mode & 0o222:
        return [_unwritable(path, "it is read-only")]

    def unchanged(step: str) -> None:
        if step == "written" and read(target) != before:
            raise _Changed

    try:
        replace(target, content, target.stat().st_mode & 0o7777, unchanged, exact=True)
    except _Changed:
        reason = f"{path.name} was changed by somebody else at the same moment"
        return [error("MANIFEST-UNWRITABLE", reason, path=str(path), hint="nothing was written; do it once more")]
    except OSError as problem:
        return [_unwritable(path, problem.strerror or str(problem))]
    return []


def _unwritable(path: Path, reason: str) -> Diagnostic:
    hint = "nothing was changed; make it writable, or edit it yourself"
    return error("MANIFEST-UNWRITABLE", f"{path.name} cannot be written: {reason}", path=str(path), hint=hint)
