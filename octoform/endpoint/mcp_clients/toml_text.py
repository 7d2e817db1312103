"""Change one table of a TOML text, with comments, order and line ends kept.

A new table is written at the end, and one is taken away by its lines: both leave every other character alone. What
is inside other text (an inline table, a setting of a table that is there) is changed by tomlkit, the one library
that keeps comments; it is imported only then.
"""

import json
import re
import tomllib
from typing import Any

from octoform.endpoint.mcp_clients.text_edit import Notation, Path, Unreadable, at, line_end, nested
from octoform.patterns import regex

_BARE = regex(r"[A-Za-z0-9_-]+")
_HEADER = regex(r"^[ \t]*\[(?:\[([^\[\]\r\n]+)\]|([^\[\]\r\n]+))\][ \t]*(?:#[^\r\n]*)?\r?$", re.MULTILINE)
_COMMENT = regex(r"^[ \t]*#.*$", re.MULTILINE)
_WHERE = regex(r"\(at line (\d+), column (\d+)\)|\(at end of document\)")


def read(text: str) -> dict[str, Any] | Unreadable:
    """The plain content."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        return _where(text, str(problem))


def _where(text: str, message: str) -> Unreadable:
    found = _WHERE.search(message)
    reason = _WHERE.sub("", message).strip() or message
    if found is None or found[1] is None:
        return Unreadable(reason, len(text))
    starts = [0, *(match.end() for match in re.finditer(r"\n", text))]
    return Unreadable(reason, starts[min(int(found[1]), len(starts)) - 1] + int(found[2]) - 1)


def put(text: str, path: Path, value: Any) -> str | Unreadable:
    """Set the value at a path; see `Notation`."""
    content = read(text)
    if isinstance(content, Unreadable):
        return content
    if isinstance(value, dict) and at(content, path) is None:
        longer = _with_table(text, path, value)
        if not isinstance(read(longer), Unreadable):
            return longer
    return _edited(text, path, value, remove=False)


def drop(text: str, path: Path) -> str | Unreadable:
    """Take the table or setting at a path away; see `Notation`."""
    content = read(text)
    if isinstance(content, Unreadable):
        return content
    if at(content, path) is None:
        return text
    shorter = _without_table(text, path)
    if shorter is not None:
        return shorter
    return _edited(text, path, None, remove=True)


def where(text: str, path: Path) -> int | None:
    """Where the table at a path has its header; a table without one has no place."""
    headers = ((found.start(), _path(found[1] or found[2])) for found in _HEADER.finditer(text))
    return next((start for start, keys in headers if keys == path), None)


TOML = Notation(read, put, drop, where)


def _with_table(text: str, path: Path, value: dict[str, Any]) -> str:
    newline = line_end(text)
    lines = [f"[{'.'.join(_key(key) for key in path)}]"]
    lines += [f"{_key(key)} = {_value(item)}" for key, item in value.items()]
    gap = ""
    if text.strip():
        gap = newline if text.endswith("\n") else newline * 2
        gap = "" if text.endswith((newline * 2, "\n\n")) else gap
    return text + gap + newline.join(lines) + newline


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _value(key)


def _value(value: Any) -> str:
    """Strings, numbers, truth values and lists of them, on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    # TOML's basic strings are JSON's, but for DEL.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _without_table(text: str, path: Path) -> str | None:
    """The text without the lines of a table and of the tables in it; None when that is not what would be gone."""
    headers = [(found.start(), _path(found[1] or found[2])) for found in _HEADER.finditer(text)]
    ends = [*(start for start, _ in headers[1:]), len(text)] if headers else []
    shorter = text
    for (start, keys), end in reversed(list(zip(headers, ends, strict=True))):
        if keys[: len(path)] == path:
            before, after = text[:start], shorter[start + len(_content(text[start:end])) :]
            # The blank line above parted the table from what stands before.
            shorter = (before if after.strip() else re.sub(r"(\r?\n)[ \t]*\r?\n\Z", r"\1", before)) + after
    if shorter == text:
        return None
    return shorter if _same(read(shorter), _taken(read(text), path)) else None


def _content(lines: str) -> str:
    """Without the blank and comment lines at the end: they belong to what comes next."""
    kept = lines.splitlines(keepends=True)
    while kept and (not kept[-1].strip() or kept[-1].lstrip().startswith("#")):
        kept.pop()
    return "".join(kept)


def _path(header: str) -> Path:
    """The keys of a header; () for one that cannot be read."""
    try:
        content: Any = tomllib.loads(f"[{header}]")
    except tomllib.TOMLDecodeError:
        return ()
    keys: list[str] = []
    while content:
        ((key, content),) = content.items()
        keys.append(key)
    return tuple(keys)


def _taken(content: Any, path: Path) -> Any:
    """The content without a value, and without the tables that it leaves empty."""
    if not isinstance(content, dict) or path[0] not in content:
        return content
    rest = {key: value for key, value in content.items() if key != path[0]}
    if len(path) == 1:
        return rest
    inner = _taken(content[path[0]], path[1:])
    return {**rest, path[0]: inner} if inner else rest


def _same(found: object, wanted: object) -> bool:
    """Equal but for empty tables: a header alone makes one, and taking the last table away unmakes it."""
    return _filled(found) == _filled(wanted)


def _filled(value: object) -> object:
    if not isinstance(value, dict):
        return value
    inner = {key: _filled(item) for key, item in value.items()}
    return {key: item for key, item in inner.items() if item != {}}


def _edited(text: str, path: Path, value: Any, *, remove: bool) -> str | Unreadable:
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    newline = line_end(text)
    try:
        document = tomlkit.parse(text)
        table: Any = document
        for number, key in enumerate(path[:-1]):
            if key not in table:
                table[key] = nested(path[number + 1 :], value)
                break
            table = table[key]
        else:
            if remove:
                del table[path[-1]]
            else:
                table[path[-1]] = value
        out = tomlkit.dumps(document)
    except (TOMLKitError, TypeError, KeyError) as problem:
        return Unreadable(f"the table cannot be changed: {problem}")
    if sorted(_COMMENT.findall(out)) != sorted(_COMMENT.findall(text)):
        return Unreadable("a comment would be lost")
    return re.sub(r"(?<!\r)\n", newline, out) if newline == "\r\n" and not re.search(r"(?<!\r)\n", text) else out
