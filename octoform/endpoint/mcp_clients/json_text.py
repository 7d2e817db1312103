"""Read JSON as clients take it, with the place of every value: comments, trailing commas, single quotes, bare names.

Configuration files of clients are written by hand (JSON, JSON with comments, JSON5), and a person's comments must
survive a change. No library keeps them: those that read the dialects give plain values and forget where they stood.
So this module finds where each value stands, and `json_edit` changes the text at that place alone. It reads more
than any one client does; whether a file is right for its client is not decided here.
"""

import re
from dataclasses import dataclass
from typing import Any

from octoform.base.files import parse
from octoform.endpoint.mcp_clients.text_edit import Unreadable

DEEPEST = 200
COMMENT = re.compile(r"//[^\n\r\u2028\u2029]*|/\*.*?\*/", re.DOTALL)
_BLANK = re.compile(r"[\s\ufeff]+")
_STRING = re.compile(r'"(?:[^"\\\n\r]++|\\(?:\r\n|.))*+"' + r"|'(?:[^'\\\n\r]++|\\(?:\r\n|.))*+'", re.DOTALL)
_NUMBER = re.compile(r"([+-]?)(0[xX][0-9a-fA-F]+|Infinity|NaN|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\w$])")
_NAME = re.compile(r"(?:[\w$]|\\u[0-9a-fA-F]{4})(?:[\w$\u200c\u200d]|\\u[0-9a-fA-F]{4})*")
_ESCAPE = re.compile(r"\\(?:u([0-9a-fA-F]{4})|x([0-9a-fA-F]{2})|(\r\n|.))", re.DOTALL)
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
    """The one value of a text; None when it holds nothing but blanks and comments."""
    reader = _Reader(text)
    try:
        start = reader.skip(0)
        if start == len(text):
            return None
        node = reader.value(start, 0)
        after = reader.skip(node.end)
        return node if after == len(text) else Unreadable("something stands behind the end of the document", after)
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
        if depth > DEEPEST:
            raise _Broken(f"values are nested more than {DEEPEST} deep", position)
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
        """What follows a member: the place of the next one or of the closing bracket, and of the comma before it."""
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
            raise _Broken("a text begins here and does not end on its line", position)
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
