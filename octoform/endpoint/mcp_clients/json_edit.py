"""Change one member of a JSON text, in any dialect, and leave every other character as it is.

What comes in takes the document's own form: its line ends, its indentation, or one line where it has one line, and a
trailing comma where the members before have one. It is always plain JSON itself, so that a strict file stays strict.
"""

import json
import re
from typing import Any

from octoform.base.files import parse
from octoform.endpoint.mcp_clients.text_edit import Notation, Path, Unreadable, indent_at, line_end, line_start, nested
from octoform.patterns import regex
from octoform.records import dataclass

# Read JSON as clients take it, with the place of every value: comments, trailing commas, single quotes, bare names.
#
# Configuration files of clients are written by hand (JSON, JSON with comments, JSON5), and a person's comments must
# survive a change. The one library that keeps them needs twenty times as long, which counts for the megabytes that some
# clients keep there (decision 0010). So this module finds the place of each value, and changes the text there alone. It
# reads more than any one client does; whether a file is right for its client is not decided here.

MAX_DEPTH = 200
COMMENT = regex(r"//[^\n\r\u2028\u2029]*|/\*.*?\*/", re.DOTALL)
_BLANK = regex(r"[\s\ufeff]+")
_STRING = regex(r'"(?:[^"\\\n\r]++|\\(?:\r\n|.))*+"' + r"|'(?:[^'\\\n\r]++|\\(?:\r\n|.))*+'", re.DOTALL)
_NUMBER = regex(r"([+-]?)(0[xX][0-9a-fA-F]+|Infinity|NaN|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\w$])")
_NAME = regex(r"(?:[\w$]|\\u[0-9a-fA-F]{4})(?:[\w$\u200c\u200d]|\\u[0-9a-fA-F]{4})*")
_ESCAPE = regex(r"\\(?:u([0-9a-fA-F]{4})|x([0-9a-fA-F]{2})|(\r\n|.))", re.DOTALL)
_WORDS = {"true": True, "false": False, "null": None}
_SIGNS = {"b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t", "v": "\v", "0": "\0"}
_CONTINUED = ("\r\n", "\n", "\r", "\u2028", "\u2029")


@dataclass(frozen=True, slots=True)
class Member:
    """A member of an object, or an element of an array (its key is its number).

    ``start`` is where its key begins, ``comma`` where the comma after it stands.
    """

    key: str | int
    start: int
    node: "Node"
    comma: int | None


@dataclass(frozen=True, slots=True)
class Node:
    """A value and its place; ``members`` is None for what is neither object nor array."""

    start: int
    end: int
    value: Any
    members: tuple[Member, ...] | None = None

    def last(self, key: str) -> Member | None:
        """The member of that name that counts: the last."""
        return next((member for member in reversed(self.members or ()) if member.key == key), None)


def scan(text: str) -> Node | Unreadable | None:
    """The one value of a string; None when it holds nothing but blanks and comments."""
    reader = _Reader(text)
    try:
        start = reader.skip(0)
        if start == len(text):
            return None
        node = reader.value(start, 0)
        after = reader.skip(node.end)
        return node if after == len(text) else Unreadable("the document goes on after its end", after)
    except _Broken as broken:
        return broken.found


class _Broken(Exception):
    """Ends the descent; never leaves this module."""

    def __init__(self, reason: str, offset: int) -> None:
        super().__init__(reason)
        self.found = Unreadable(reason, offset)


class _Reader:
    def __init__(self, text: str) -> None:
        self.text = text

    def skip(self, position: int) -> int:
        """The next position that is neither blank nor comment."""
        text = self.text
        while position < len(text):
            if found := _BLANK.match(text, position):
                position = found.end()
            elif text[position] != "/":
                break
            elif found := COMMENT.match(text, position):
                position = found.end()
            elif text.startswith("/*", position):
                raise _Broken("a comment begins here and never ends", position)
            else:
                break
        return position

    def value(self, position: int, depth: int) -> Node:
        sign = self.text[position : position + 1]
        if depth > MAX_DEPTH:
            raise _Broken(f"values are nested more than {MAX_DEPTH} deep", position)
        if sign == "{":
            return self._object(position, depth)
        if sign == "[":
            return self._array(position, depth)
        if sign in ("'", '"') and sign:
            end, text = self._string(position)
            return Node(position, end, text)
        if found := _NUMBER.match(self.text, position):
            return Node(position, found.end(), _number(found[1], found[2]))
        if (found := _NAME.match(self.text, position)) and found[0] in _WORDS:
            return Node(position, found.end(), _WORDS[found[0]])
        raise _Broken("a value is expected here" if sign else "the document ends before a value", position)

    def _object(self, start: int, depth: int) -> Node:
        members: list[Member] = []
        position = self.skip(start + 1)
        while not self.text.startswith("}", position):
            begin = position
            end, key = self._key(position)
            position = self.skip(end)
            if not self.text.startswith(":", position):
                raise _Broken("a colon is expected here", position)
            node = self.value(self.skip(position + 1), depth + 1)
            position, comma = self._comma(node.end, "}", start)
            members.append(Member(key, begin, node, comma))
        return Node(start, position + 1, {str(item.key): item.node.value for item in members}, tuple(members))

    def _array(self, start: int, depth: int) -> Node:
        members: list[Member] = []
        position = self.skip(start + 1)
        while not self.text.startswith("]", position):
            node = self.value(position, depth + 1)
            position, comma = self._comma(node.end, "]", start)
            members.append(Member(len(members), node.start, node, comma))
        return Node(start, position + 1, [item.node.value for item in members], tuple(members))

    def _comma(self, end: int, closing: str, start: int) -> tuple[int, int | None]:
        """The position after a member: that of the next one or of the closing bracket, and of the comma."""
        position = self.skip(end)
        if self.text.startswith(",", position):
            return self.skip(position + 1), position
        if self.text.startswith(closing, position):
            return position, None
        if position == len(self.text):
            raise _Broken(f"this is never closed by {closing}", start)
        raise _Broken(f"a comma or {closing} is expected here", position)

    def _key(self, position: int) -> tuple[int, str]:
        if self.text[position : position + 1] in ("'", '"') and position < len(self.text):
            return self._string(position)
        found = _NAME.match(self.text, position)
        if found is None or found[0][0].isdigit():
            raise _Broken("a name is expected here", position)
        return found.end(), _unescaped(found[0])

    def _string(self, position: int) -> tuple[int, str]:
        found = _STRING.match(self.text, position)
        if found is None:
            raise _Broken("a string begins here and does not end on its line", position)
        return found.end(), _unescaped(found[0][1:-1])


def _unescaped(text: str) -> str:
    if "\\" not in text:
        return text
    plain = _ESCAPE.sub(_sign, text)
    # Two escapes may be the halves of one character.
    return plain.encode("utf-16", "surrogatepass").decode("utf-16", "surrogatepass") if plain != text else plain


def _sign(found: re.Match[str]) -> str:
    if found[1] or found[2]:
        return chr(int(found[1] or found[2], 16))
    return "" if found[3] in _CONTINUED else _SIGNS.get(found[3], found[3])


def _number(sign: str, digits: str) -> int | float:
    factor = -1 if sign == "-" else 1
    if digits[:2].lower() == "0x":
        return factor * int(digits, 16)
    try:
        return factor * parse(digits) if digits[0].isdigit() else factor * float(digits)
    except ValueError:
        return factor * float(digits)


_UNIT = "  "


def read(text: str) -> dict[str, Any] | Unreadable:
    """The plain content; a document must be an object, in which no name on the way to a server is twice."""
    root = scan(text)
    if root is None:
        return {}
    if isinstance(root, Unreadable):
        return root
    if not isinstance(root.value, dict):
        return Unreadable("the document is no object: {...}", root.start)
    return root.value


def put(text: str, path: Path, value: Any) -> str | Unreadable:
    """Set the value at a path; see `Notation`."""
    root = scan(text)
    if isinstance(root, Unreadable):
        return root
    if root is None:
        return _begun(text, nested(path, value))
    form = _form(text, root)
    node = root
    for number, key in enumerate(path):
        if twice := _twice(node, key):
            return twice
        member = node.last(key)
        if member is None:
            return _inserted(text, node, form, key, nested(path[number + 1 :], value))
        node = member.node
    return text[: node.start] + _rendered(value, form, indent_at(text, node.start)) + text[node.end :]


def drop(text: str, path: Path) -> str | Unreadable:
    """Take the member at a path away; see `Notation`."""
    node = scan(text)
    if isinstance(node, Unreadable) or node is None:
        return node or text
    for key in path[:-1]:
        if twice := _twice(node, key):
            return twice
        member = node.last(key)
        if member is None:
            return text
        node = member.node
    return _twice(node, path[-1]) or _without(text, node, node.last(path[-1]))


def append(text: str, path: Path, value: Any) -> str | Unreadable:
    """Add an element to the array at a path, which is made when it is missing; see `Notation`."""
    root = scan(text)
    if isinstance(root, Unreadable):
        return root
    node = _found(root, path)
    if root is None or node is None:
        return put(text, path, [value])
    return _inserted(text, node, _form(text, root), None, value)


def drop_element(text: str, path: Path, value: Any) -> str | Unreadable:
    """Take the first element with that value out of the array at a path; the text as it is when there is none."""
    root = scan(text)
    if isinstance(root, Unreadable):
        return root
    node = _found(root, path)
    if node is None:
        return text
    return _without(text, node, next((item for item in node.members or () if item.node.value == value), None))


def _found(node: Node | None, path: Path) -> Node | None:
    for key in path:
        member = node.last(key) if node else None
        node = member.node if member else None
    return node


def where(text: str, path: Path) -> int | None:
    """Where the member at a path begins."""
    root = scan(text)
    node = _found(root, path[:-1]) if isinstance(root, Node) else None
    member = node.last(path[-1]) if node else None
    return member.start if member else None


JSON = Notation(read, put, drop, where)


@dataclass(frozen=True, slots=True)
class _Form:
    """How the document is written; ``unit`` is None where it stands on one line."""

    newline: str
    unit: str | None
    colon: str
    comma: str


def _form(text: str, root: Node) -> _Form:
    members = root.members or ()
    body = text[root.start : root.end]
    if members and not _broken(body):
        first = members[0]
        tight = text[first.node.start - 1] == ":"
        comma = first.comma if first.comma is not None else first.node.end
        blank = text[comma + 1 : comma + 2] in (" ", "\t") if len(members) > 1 else not tight
        return _Form("", None, ":" if tight else ": ", ", " if blank else ",")
    return _Form(line_end(text), _unit(text, root) or _UNIT, ": ", ",")


def _unit(text: str, node: Node) -> str | None:
    """By how much the first member that stands on a line of its own is further in than what it belongs to."""
    for member in node.members or ():
        outer, own = indent_at(text, node.start), indent_at(text, member.start)
        if _own_line(text, member) and own.startswith(outer) and len(own) > len(outer):
            return own[len(outer) :]
        if found := _unit(text, member.node):
            return found
    return None


def _broken(text: str) -> bool:
    return "\n" in text or "\r" in text


def _own_line(text: str, member: Member) -> bool:
    return not text[line_start(text, member.start) : member.start].strip(" \t")


def _begun(text: str, value: Any) -> str:
    """A document behind what is there: nothing, or comments."""
    newline = line_end(text)
    lead = text + (newline if text and not text.endswith(("\n", "\r")) else "") if text.strip() else ""
    return lead + json.dumps(value, indent=2, ensure_ascii=False).replace("\n", newline) + newline


def _rendered(value: Any, form: _Form, indent: str) -> str:
    if form.unit is None:
        return json.dumps(value, ensure_ascii=False, separators=(form.comma, form.colon))
    text = json.dumps(value, indent=form.unit, ensure_ascii=False)
    return text.replace("\n", form.newline + indent)


def _inserted(text: str, node: Node, form: _Form, key: str | None, value: Any) -> str | Unreadable:
    """A new last member of an object, or (without a key) a new last element of an array."""
    if node.members is None or isinstance(node.value, list) != (key is None):
        return Unreadable("a value of another kind is here", node.start)
    last = node.members[-1] if node.members else None
    inline = form.unit is None or (last is not None and not _broken(text[node.start : node.members[0].start]))
    if inline:
        form = _Form("", None, form.colon, form.comma if form.unit is None else ", ")
    outer = indent_at(text, node.start)
    indent = indent_at(text, last.start) if last and _own_line(text, last) else outer + (form.unit or "")
    name = "" if key is None else json.dumps(key, ensure_ascii=False) + form.colon
    member = name + _rendered(value, form, indent)
    lead = form.newline + indent if not inline else form.comma[1:] if last else ""
    if last is None:
        end = _after_comments(text, node.start + 1, node.end - 1)
        tail = "" if inline or _broken(text[end : node.end]) else form.newline + outer
        return text[:end] + lead + member + tail + text[end:]
    trailing = last.comma is not None
    begin = last.comma + 1 if last.comma is not None else last.node.end
    end = _after_comments(text, begin, node.end - 1)
    before, after = ("", ",") if trailing else (",", "")
    return text[:begin] + before + text[begin:end] + _apart(text, begin, end, lead) + member + after + text[end:]


def _apart(text: str, begin: int, end: int, lead: str) -> str:
    """The separator before a new member; behind a comment to the end of the line, a line end."""
    comments = [found[0] for found in COMMENT.finditer(text, begin, end)]
    if comments and comments[-1].startswith("//") and not lead.startswith(("\n", "\r")):
        return line_end(text) + indent_at(text, begin)
    return lead


def _without(text: str, node: Node, member: Member | None) -> str:
    """The text without a member, its comma and the blanks before it; comments stay."""
    if member is None or node.members is None:
        return text
    number = node.members.index(member)
    before = node.members[number - 1] if number else None
    begin = node.start + 1
    if before is not None:
        begin = before.comma + 1 if before.comma is not None else before.node.end
    comments = [found[0] for found in COMMENT.finditer(text, begin, member.start)]
    begin = _after_comments(text, begin, member.start)
    cuts = [(begin, member.node.end)]
    if member.comma is not None:
        cuts.append((member.comma, member.comma + 1))
    elif before is not None and before.comma is not None:
        cuts.insert(0, (before.comma, before.comma + 1))
    kept = "".join(text[start:end] for start, end in _between(cuts, node.start + 1, node.end - 1))
    if len(node.members) == 1 and not kept.strip():
        kept = ""
    elif comments and comments[-1].startswith("//") and not _broken(_blanks(text, cuts[-1][1])):
        # What follows would become part of the comment.
        lead = begin - (node.start + 1) - sum(end - start for start, end in cuts if end <= begin)
        kept = kept[:lead] + line_end(text) + kept[lead:]
    return text[: node.start + 1] + kept + text[node.end - 1 :]


def _between(cuts: list[tuple[int, int]], start: int, end: int) -> list[tuple[int, int]]:
    """The spans that stay."""
    edges = [start, *(edge for cut in cuts for edge in cut), end]
    return list(zip(edges[::2], edges[1::2], strict=True))


def _blanks(text: str, begin: int) -> str:
    """The blanks from a place on, to the end of the line and over it."""
    return text[begin : len(text) - len(text[begin:].lstrip())]


def _after_comments(text: str, begin: int, end: int) -> int:
    """Behind the last comment between two tokens, or where the first of them ends."""
    for found in COMMENT.finditer(text, begin, end):
        begin = found.end()
    return begin


def _twice(node: Node, key: str) -> Unreadable | None:
    found = [member for member in node.members or () if member.key == key]
    return Unreadable(f"{key} is here a second time", found[-1].start) if len(found) > 1 else None
