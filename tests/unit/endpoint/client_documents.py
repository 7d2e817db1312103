"""Random JSON as people and programs write it: values, and a text of each in any dialect."""

import json
from typing import Any

from hypothesis import strategies as st

NAMES = st.sampled_from(
    ["a", "b", "other", "mcp", "mcpServers", "servers", "$schema", "x y", "ü", 'with"quote', "//no"]
)
LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-10, 10**12),
    st.floats(allow_nan=False, allow_infinity=False, width=32),
    st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=8),
    st.sampled_from(["// no comment", "/* none */", "{", "}", ",", "'", '"', "\\", "a\nb", "\t"]),
)
VALUES = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3),
    max_leaves=8,
)
SERVERS = st.dictionaries(st.sampled_from(["one", "two", "octoform-other"]), st.dictionaries(NAMES, VALUES, max_size=3))


@st.composite
def documents(
    draw: st.DrawFn, table: tuple[str, ...] = ("mcpServers",), *, populated: bool = False
) -> tuple[dict[str, Any], str]:
    """Content in which the way to the servers is free, and a text of it; ``populated``: with a server."""
    content = draw(st.dictionaries(NAMES.filter(lambda name: name != table[0]), VALUES, max_size=4))
    depth = len(table) if populated else draw(st.integers(0, len(table)))
    if depth:
        inner: Any = draw(SERVERS) if depth == len(table) else {}
        if populated:
            inner = inner or {"one": draw(VALUES)}
        for key in reversed(table[:depth]):
            inner = {key: inner}
        place = draw(st.integers(0, len(content)))
        items = list(content.items())
        content = dict([*items[:place], *inner.items(), *items[place:]])
    if draw(st.booleans()):
        indent = draw(st.sampled_from([None, 2, 4, "\t"]))
        separators = draw(st.sampled_from([None, (",", ":")])) if indent is None else None
        text = json.dumps(content, indent=indent, separators=separators, ensure_ascii=draw(st.booleans()))
        text += draw(st.sampled_from(["", "\n", "\n\n"]))
        return content, text.replace("\n", draw(st.sampled_from(["\n", "\r\n"])))
    return content, _Writer(draw).document(content)


class _Writer:
    """Writes a value with blanks, comments, quotes and commas as they come."""

    def __init__(self, draw: st.DrawFn) -> None:
        self.draw = draw
        self.newline = draw(st.sampled_from(["\n", "\r\n"]))

    def document(self, value: Any) -> str:
        return self.gap() + self.value(value) + self.gap()

    def gap(self) -> str:
        pieces = ["", "", " ", "\t", "\n", "\n  ", '// it\'s, "one" } ]\n', "/* two, } */", "/**/ ", "\u00a0", "  //\n"]
        return "".join(self.draw(st.lists(st.sampled_from(pieces), max_size=2))).replace("\n", self.newline)

    def value(self, value: Any) -> str:
        if isinstance(value, dict):
            return self.group(
                "{",
                [self.key(key) + self.gap() + ":" + self.gap() + self.value(item) for key, item in value.items()],
                "}",
            )
        if isinstance(value, list):
            return self.group("[", [self.value(item) for item in value], "]")
        if isinstance(value, str):
            return self.text(value)
        return json.dumps(value)

    def group(self, opening: str, parts: list[str], closing: str) -> str:
        text = opening
        for number, part in enumerate(parts):
            last = number == len(parts) - 1
            comma = "" if last and self.draw(st.booleans()) else ","
            text += self.gap() + part + self.gap() + comma
        return text + self.gap() + closing

    def key(self, key: str) -> str:
        if key.isascii() and key.isalpha() and self.draw(st.booleans()):
            return key
        return self.text(key)

    def text(self, text: str) -> str:
        plain = json.dumps(text, ensure_ascii=self.draw(st.booleans()))
        if self.draw(st.booleans()):
            return plain
        return "'" + plain[1:-1].replace('\\"', '"').replace("'", "\\'") + "'"
