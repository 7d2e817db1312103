"""A YAML document as a tree in which every value knows its place in the file.

Diagnostics need line and column of keys and values long after the text was parsed; the plain data that the schema
checks needs none of it. This tree is between the two and knows neither the YAML reader nor pydantic.
"""

from collections.abc import Iterator, Sequence

from octoform.diagnostics import Span
from octoform.manifest.model import KEEPERS, STAGES
from octoform.patterns import regex
from octoform.records import dataclass

Loc = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class Scalar:
    """A value without parts. ``text`` is its content, ``value`` what YAML 1.2 makes of it; ``plain`` is unquoted.

    ``last_line`` is the last line that the value may reach to.
    """

    span: Span
    text: str
    value: str | int | float | bool | None
    plain: bool = True
    last_line: int = 0


@dataclass(frozen=True, slots=True)
class Table:
    """Keys and values in the order of the file; keys are unique."""

    span: Span
    entries: tuple[tuple[Scalar, "Node"], ...]

    def get(self, name: str) -> "tuple[Scalar, Node] | None":
        """The entry of that name."""
        return next((entry for entry in self.entries if entry[0].text == name), None)


@dataclass(frozen=True, slots=True)
class Items:
    """Values in order."""

    span: Span
    items: tuple["Node", ...]


Node = Scalar | Table | Items

_NULL = {"", "~", "null", "Null", "NULL"}
_BOOL = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_INTEGERS = (
    (regex(r"[-+]?[0-9]{1,40}"), 10),
    (regex(r"0o[0-7]{1,40}"), 8),
    (regex(r"0x[0-9a-fA-F]{1,40}"), 16),
)
_FLOAT = regex(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")


def plain_value(text: str) -> str | int | float | bool | None:
    """The value of an unquoted scalar by the YAML 1.2 core schema; infinities and NaN stay text."""
    if text in _NULL:
        return None
    if text in _BOOL:
        return _BOOL[text]
    for pattern, base in _INTEGERS:
        if pattern.fullmatch(text):
            return int(text, base)
    if len(text) <= 40 and _FLOAT.fullmatch(text):
        return float(text)
    return text


def data(node: Node) -> object:
    """The plain data of a tree: dict, list and scalars."""
    if isinstance(node, Scalar):
        return node.value
    if isinstance(node, Table):
        return {key.text: data(value) for key, value in node.entries}
    return [data(item) for item in node.items]


def at(root: Node, loc: Sequence[str | int]) -> Node | None:
    """The value at a path of keys and indexes, or None."""
    node: Node | None = root
    for part in loc:
        if isinstance(node, Table) and isinstance(part, str):
            entry = node.get(part)
            node = entry[1] if entry else None
        elif isinstance(node, Items) and isinstance(part, int) and part < len(node.items):
            node = node.items[part]
        else:
            return None
    return node


def key_at(root: Node, loc: Sequence[str | int]) -> Scalar | None:
    """The key at the end of a path, or None where the path ends in an index or nowhere."""
    parent = at(root, loc[:-1]) if loc else None
    entry = parent.get(str(loc[-1])) if isinstance(parent, Table) else None
    return entry[0] if entry else None


def scalars(node: Node, loc: Loc = ()) -> Iterator[tuple[Loc, Scalar]]:
    """Every value without parts, with its path, in the order of the file."""
    if isinstance(node, Scalar):
        yield loc, node
    elif isinstance(node, Table):
        for key, value in node.entries:
            yield from scalars(value, (*loc, key.text))
    else:
        for index, item in enumerate(node.items):
            yield from scalars(item, (*loc, index))


# Where in a manifest an agent may be described, for the rules that look at the tree and need no document. Light.

ESCALATION: Loc = ("stages", "identify", "escalate")
HARNESSES: tuple[Loc, ...] = (
    ("harness",),
    *(("stages", name, "harness") for name in (*STAGES, *KEEPERS)),
    (*ESCALATION, "harness"),
)
KEYS: tuple[Loc, ...] = (*((*loc, "key") for loc in HARNESSES), ("housekeeping", "key"))
BASE_URLS: tuple[Loc, ...] = (*((*loc, "base_url") for loc in HARNESSES), ("housekeeping", "base_url"))
WEBHOOK: Loc = ("daemon", "notify", "webhook")
"""The URL that gets the alerts; anyone who has it may write there, so it may be a secret as a whole."""
