"""Write one setting back into a person's octopus.yaml, with comments, order and line ends kept. (Heavy.)

The file belongs to its author. An edit that would lose a comment, change another setting or leave a manifest with
errors is refused, and the file stays as it was.
"""

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.util import load_yaml_guess_indent

from octoform.base.files import read, replace
from octoform.diagnostics import Diagnostic, Severity, error
from octoform.manifest.edit import lines
from octoform.manifest.loader import load, parse
from octoform.manifest.source.parser import read_tree
from octoform.manifest.source.report import Report
from octoform.manifest.source.tree import data

Value = str | int | bool | list[str]
_BOM = "\ufeff"
# The blanks before the first line that is nested in a table.
_NESTED = re.compile(r"^[^\s#-][^\n]*:[ ]*(?:#[^\n]*)?\n(?:[ ]*(?:#[^\n]*)?\n)*([ ]+)[^\s#-]", re.MULTILINE)
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
        return None, [_refused(path, dotted, "the text holds bytes that are no UTF-8")]
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
        after = lines.drop(text, keys[0], keys[1])
    elif len(keys) == 2 and isinstance(value, str):
        after = lines.put(text, keys[0], keys[1], value)
    return after if after is not None else _edited(text, keys, value)


def comments(text: str) -> list[str]:
    """The comments of a YAML text, in order: what stands between its tokens and is no white space."""
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
    """A list in the form that stood there, on one line where none did."""
    new = CommentedSeq(value)
    if not isinstance(old, CommentedSeq) or old.fa.flow_style() is not False:
        new.fa.set_flow_style()
    return new


def _lf(text: str) -> str:
    return text.removeprefix(_BOM).replace("\r\n", "\n").replace("\r", "\n")


def _plain(text: str) -> object:
    tree = read_tree(_lf(text), Report("octopus.yaml"))
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
