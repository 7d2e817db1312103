"""Change one entry of a YAML text, with comments, order, quotes and line ends kept.

A round trip through a library keeps comments, but sets indentation, quotes and long lines in its own way. Here the
library only shows where every value stands (composed nodes with their marks); the text is changed at that place
alone. What comes in is written with JSON's strings and lists, which every YAML reader takes. (Heavy: ruamel.)
"""

import json
from dataclasses import dataclass
from typing import Any

from octoform.endpoint.mcp_clients.text_edit import Notation, Path, Unreadable, line_end, line_start, rest_of_line
from octoform.patterns import regex

_STEP = "  "
_ALIAS = regex(r"\*[^\s,\[\]{}]+")


def read(text: str) -> dict[str, Any] | Unreadable:
    """The plain content; a document must be one mapping."""
    from ruamel.yaml import YAML as Library
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    try:
        content = Library(typ="safe", pure=True).load(text)
    except MarkedYAMLError as problem:
        mark = problem.problem_mark
        return Unreadable(str(problem.problem or problem.context), mark.index if mark else None)
    except (YAMLError, ValueError) as problem:
        return Unreadable(str(problem).splitlines()[0])
    if content is None:
        return {}
    return content if isinstance(content, dict) else Unreadable("the document is no mapping", 0)


def put(text: str, path: Path, value: Any) -> str | Unreadable:
    """Set the value at a path; see `Notation`."""
    root = _composed(text)
    if isinstance(root, Unreadable):
        return root
    if root is None:
        return _behind(text, len(text), _block(path, value, "", line_end(text)))
    node = root
    for number, key in enumerate(path):
        pair = node.pair(key)
        if pair is None:
            return _inserted(text, node, path[number:], value)
        node = pair.value
    pair = node.parent
    assert pair is not None
    return text[: pair.key_end] + ": " + json.dumps(value, ensure_ascii=False) + text[_end(text, node) :]


def drop(text: str, path: Path) -> str | Unreadable:
    """Take the entry at a path away; see `Notation`."""
    node = _composed(text)
    if isinstance(node, Unreadable) or node is None:
        return node or text
    holder = node
    for key in path:
        pair = node.pair(key)
        if pair is None:
            return text
        holder, node = node, pair.value
    assert node.parent is not None
    if holder.flow:
        return _without_in_flow(text, holder, node.parent)
    begin = line_start(text, node.parent.start)
    end = rest_of_line(text, _end(text, node))
    end += len(line_end(text)) if end < len(text) else 0
    if len(holder.pairs) > 1:
        return text[:begin] + text[end:]
    if holder.parent is None:
        return text[:begin] + text[end:]
    above = holder.parent.key_end
    return text[:above] + ": {}" + text[above + 1 : begin] + text[end:]


def where(text: str, path: Path) -> int | None:
    """Where the entry at a path begins."""
    node = _composed(text)
    pair = None
    for key in path:
        pair = node.pair(key) if isinstance(node, _Node) else None
        node = pair.value if pair else None
    return pair.start if pair else None


YAML = Notation(read, put, drop, where)


@dataclass(slots=True)
class _Pair:
    """A key and its value; offsets of the key."""

    key: str
    start: int
    key_end: int
    column: int
    value: "_Node"


@dataclass(slots=True)
class _Node:
    """A value: ``end`` is behind its last character, ``flow`` is true for a mapping in braces."""

    start: int
    end: int
    kind: str
    flow: bool
    pairs: list[_Pair]
    parent: _Pair | None = None
    last: "_Node | None" = None

    def pair(self, key: str) -> _Pair | None:
        return next((item for item in self.pairs if item.key == key), None)


def _composed(text: str) -> _Node | Unreadable | None:
    from ruamel.yaml import YAML as Library

    content = read(text)
    if isinstance(content, Unreadable):
        return content
    root = Library(typ="safe", pure=True).compose(text)
    return None if root is None or root.value == "" else _node(root, text, 0)


def _node(found: Any, text: str, after: int) -> _Node:
    """The node of a value that is behind ``after``; an alias is none of what it refers to."""
    if found.start_mark.index < after:
        alias = _ALIAS.search(text, after)
        end = alias.end() if alias else after
        return _Node(alias.start() if alias else after, end, "alias", True, [])
    pairs: list[_Pair] = []
    last = None
    if found.id == "mapping":
        for key, value in found.value:
            mark = key.start_mark
            inner = _node(value, text, mark.index)
            pair = _Pair(str(key.value), mark.index, key.end_mark.index, mark.column, inner)
            inner.parent = pair
            pairs.append(pair)
            last = inner
    elif found.id == "sequence" and found.value:
        last = _node(found.value[-1], text, found.start_mark.index)
    flow = bool(found.flow_style) if found.id != "scalar" else True
    return _Node(found.start_mark.index, found.end_mark.index, found.id, flow, pairs, None, last)


def _end(text: str, node: _Node) -> int:
    """Behind the last character of a value; a block's own mark is at the beginning of what comes next."""
    while not node.flow and node.last is not None:
        node = node.last
    return len(text[: node.end].rstrip())


def _block(path: Path, value: Any, indent: str, newline: str) -> str:
    """Lines of an entry: tables one below the other, plain values on their own line each."""
    lines = [f"{indent}{_STEP * number}{_key(key)}:" for number, key in enumerate(path)]
    inner = indent + _STEP * len(path)
    if isinstance(value, dict) and value:
        lines += [f"{inner}{_key(key)}: {json.dumps(item, ensure_ascii=False)}" for key, item in value.items()]
    else:
        lines[-1] += " " + json.dumps(value, ensure_ascii=False)
    return newline.join(lines) + newline


def _key(key: str) -> str:
    plain = key.replace("_", "").replace("-", "")
    simple = plain.isascii() and plain.isalnum() and key[0].isalpha() and key.lower() not in ("null", "true", "false")
    return key if simple else json.dumps(key, ensure_ascii=False)


def _behind(text: str, offset: int, block: str) -> str:
    """The block on the lines behind an offset."""
    end = rest_of_line(text, offset)
    newline = line_end(text)
    if end == len(text):
        lead = text if not text or text.endswith(("\n", "\r")) else text + newline
        return lead + block
    end += len(newline)
    return text[:end] + block + text[end:]


def _inserted(text: str, node: _Node, path: Path, value: Any) -> str | Unreadable:
    """A new last entry of a mapping; ``path`` leads from there to the value."""
    newline = line_end(text)
    empty = node.kind == "scalar" and text[node.start : node.end].strip() in ("", "~", "null", "Null", "NULL")
    if (empty or (node.kind == "mapping" and not node.pairs)) and node.parent is not None:
        above = node.parent
        if text[node.start : node.end].strip():
            text = text[: above.key_end] + ":" + text[node.end :]
        return _behind(text, above.key_end, _block(path, value, " " * above.column + _STEP, newline))
    if node.kind != "mapping":
        return Unreadable("a value of another kind is here", node.start)
    if node.flow:
        return _in_flow(text, node, path, value)
    return _behind(text, _end(text, node), _block(path, value, " " * node.pairs[0].column, newline))


def _in_flow(text: str, node: _Node, path: Path, value: Any) -> str:
    for key in reversed(path[1:]):
        value = {key: value}
    entry = f"{json.dumps(path[0], ensure_ascii=False)}: {json.dumps(value, ensure_ascii=False)}"
    if not node.pairs:
        return text[: node.start] + "{" + entry + "}" + text[node.end :]
    end = _end(text, node.pairs[-1].value)
    comma = text[end : node.end].lstrip().startswith(",")
    end = text.index(",", end) + 1 if comma else end
    return text[:end] + (" " if comma else ", ") + entry + text[end:]


def _without_in_flow(text: str, holder: _Node, pair: _Pair) -> str:
    number = holder.pairs.index(pair)
    end = _end(text, pair.value)
    if number + 1 < len(holder.pairs):
        return text[: pair.start] + text[holder.pairs[number + 1].start :]
    begin = _end(text, holder.pairs[number - 1].value) if number else pair.start
    return text[:begin] + text[end:]
