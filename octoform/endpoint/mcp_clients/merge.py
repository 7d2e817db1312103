"""Bring one server into the text of a client's file, and take it out again: pure, text to text.

A change counts only when the new text, read again, is the old content with exactly this change; else it is refused.
Taking out gives back the very text from before, when doing the same to a former text leads to the present one.
"""

import copy
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, TypeAlias

from octoform.endpoint.mcp_clients import json_edit
from octoform.endpoint.mcp_clients.json_edit import JSON
from octoform.endpoint.mcp_clients.known_clients import Client, Form
from octoform.endpoint.mcp_clients.text_edit import Notation, Path, Unreadable, at
from octoform.endpoint.mcp_clients.toml_text import TOML
from octoform.endpoint.mcp_clients.yaml_text import YAML
from octoform.records import dataclass

NOTATIONS: Mapping[str, Notation] = {"json": JSON, "toml": TOML, "yaml": YAML}
Ours: TypeAlias = Callable[[Mapping[str, Any]], bool]
"""Whether an entry of our name is one that octoform wrote."""


@dataclass(frozen=True, slots=True)
class Wish:
    """A server entry for a file: its table there, its name, its entry.

    ``prompted``: with the client's question for the token. ``dropped``: fields of an older entry that belong to
    another form; its other fields are the person's own and stay.
    """

    table: Path
    name: str
    entry: Form
    prompted: bool = False
    dropped: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Hunk:
    """One changed place: the line on which it begins in the new text, what went and what came."""

    line: int
    removed: str
    added: str


@dataclass(frozen=True, slots=True)
class Edited:
    """The new text (None: nothing but ours was in it), and what changed.

    ``state`` is added, updated, present or removed.
    """

    text: str | None
    state: str
    hunks: tuple[Hunk, ...] = ()


@dataclass(frozen=True, slots=True)
class Taken:
    """The place is held by something else; ``entry`` is it, when it is a server of the same name."""

    path: Path
    offset: int | None
    entry: Any = None


def written(client: Client, wish: Wish) -> str:
    """The text of a new file with this server."""
    done = merge(client, "", wish, lambda _: True)
    assert isinstance(done, Edited) and done.text is not None
    return done.text


def merge(client: Client, text: str, wish: Wish, ours: Ours) -> Edited | Taken | Unreadable:
    """Bring the server in, or an older entry of octoform's up to date."""
    notation = NOTATIONS[client.notation]
    content = notation.read(text)
    if isinstance(content, Unreadable):
        return content
    if taken := _blocked(notation, text, content, client, wish):
        return taken
    path = (*wish.table, wish.name)
    former = at(content, path)
    if _there(content, path) and not (isinstance(former, dict) and ours(former)):
        return Taken(path, notation.where(text, path), former)
    entry = {**{k: v for k, v in (former or {}).items() if k not in wish.dropped}, **wish.entry}
    asked = _Prompt(comes=wish.prompted, goes=not wish.prompted and _prompt_goes(client, content, path))
    texts = _walked(notation, text, [*_entry_steps(path, former, wish), *_prompt_steps(client, content, {}, asked)])
    if isinstance(texts, Unreadable):
        return texts
    wanted = _wanted(content, path, entry)
    _set_prompt(client, wanted, asked)
    if not _alike(notation.read(texts[-1]), wanted, path):
        return Unreadable("the file cannot be changed here without changing something else")
    state = "added" if former is None else "present" if texts[-1] == text else "updated"
    return Edited(texts[-1], state, hunks(texts))


def take_out(
    client: Client, text: str, path: Path, ours: Ours, former: Sequence[str]
) -> Edited | Taken | Unreadable | None:
    """Take the server at a path out; None when it is not there. ``former`` are texts from before, the latest first."""
    notation = NOTATIONS[client.notation]
    content = notation.read(text)
    if isinstance(content, Unreadable):
        return content
    if not _there(content, path):
        return None
    entry = at(content, path)
    if not isinstance(entry, dict) or not ours(entry):
        return Taken(path, notation.where(text, path), entry)
    for before in (*former, None):
        again = _redone(client, before or "", content, path)
        if again is not None and again.text == text:
            return Edited(before, "removed", tuple(Hunk(h.line, h.added, h.removed) for h in again.hunks))
    asked = _Prompt(goes=_prompt_goes(client, content, path))
    past = notation.read(former[0] if former else "")
    past = {} if isinstance(past, Unreadable) else past
    steps = [*_drop_steps(content, past, path), *_prompt_steps(client, content, past, asked)]
    texts = _walked(notation, text, steps)
    if isinstance(texts, Unreadable):
        return texts
    wanted = _wanted(content, path, None)
    _set_prompt(client, wanted, asked)
    if not _alike(notation.read(texts[-1]), wanted, path):
        return Unreadable("the file cannot be changed here without changing something else")
    return Edited(texts[-1], "removed", hunks(texts))


def origin(client: Client, text: str, path: Path, former: Sequence[str]) -> str | None:
    """The former text that the present one was made of, by bringing in the very entry that is in it."""
    content = NOTATIONS[client.notation].read(text)
    if isinstance(content, Unreadable) or not isinstance(at(content, path), dict):
        return None
    redone = ((item, _redone(client, item, content, path)) for item in former)
    return next((item for item, again in redone if again is not None and again.text == text), None)


def hunks(texts: Sequence[str]) -> tuple[Hunk, ...]:
    """The change of each step, without its surroundings: other servers' secrets are not shown."""
    return tuple(_hunk(before, after) for before, after in pairwise(texts) if before != after)


def _hunk(before: str, after: str) -> Hunk:
    start = _alike_signs(before, after)
    left = min(len(before), len(after)) - start
    tail = _alike_signs(before[::-1][:left], after[::-1][:left])
    removed, added = before[start : len(before) - tail], after[start : len(after) - tail]
    shown = added or removed
    lead = shown[: len(shown) - len(shown.lstrip(",\r\n \t"))]
    return Hunk(after.count("\n", 0, start) + lead.count("\n") + 1, removed, added)


def _alike_signs(one: str, other: str) -> int:
    """How many signs at the beginning are the same; by halves, since a file may be large."""
    low, high = 0, min(len(one), len(other))
    while low < high:
        middle = (low + high + 1) // 2
        if one[low:middle] == other[low:middle]:
            low = middle
        else:
            high = middle - 1
    return low


@dataclass(frozen=True, slots=True)
class _Step:
    """One change of a string; the kinds are the functions of a notation, and those for lists."""

    kind: str
    path: Path
    value: Any = None

    def taken(self, notation: Notation, text: str) -> str | Unreadable:
        if self.kind == "put":
            return notation.put(text, self.path, self.value)
        if self.kind == "drop":
            return notation.drop(text, self.path)
        change = json_edit.append if self.kind == "append" else json_edit.drop_element
        return change(text, self.path, self.value)


def _walked(notation: Notation, text: str, steps: Iterable[_Step]) -> list[str] | Unreadable:
    """The text, and the text after each step."""
    texts = [text]
    for step in steps:
        done = step.taken(notation, texts[-1])
        if isinstance(done, Unreadable):
            return done
        texts.append(done)
    return texts


def _entry_steps(path: Path, former: Any, wish: Wish) -> Iterator[_Step]:
    if former is None:
        yield _Step("put", path, wish.entry)
        return
    for key in former:
        if key in wish.dropped:
            yield _Step("drop", (*path, key))
    for key, value in wish.entry.items():
        if key not in former or former[key] != value:
            yield _Step("put", (*path, key), value)


@dataclass(frozen=True, slots=True)
class _Prompt:
    """Whether the client's question for the token has to come or to go."""

    comes: bool = False
    goes: bool = False


def _prompt_steps(
    client: Client, content: Mapping[str, Any], past: Mapping[str, Any], asked: _Prompt
) -> Iterator[_Step]:
    if client.prompt is None:
        return
    path, element = client.prompt
    if asked.comes and not _has_prompt(client, content):
        yield _Step("append", path, element)
    if asked.goes:
        yield _Step("drop_element", path, element)
        if at(content, path) == [element] and not _there(past, path):
            yield _Step("drop", path)


def _drop_steps(content: Mapping[str, Any], past: Mapping[str, Any], path: Path) -> Iterator[_Step]:
    """Take the entry away, and the tables above it that are empty then and were not there before."""
    yield _Step("drop", path)
    rest = _wanted(content, path, None)
    for number in range(len(path) - 1, 0, -1):
        way = path[:number]
        if at(rest, way) != {} or _there(past, way):
            break
        yield _Step("drop", way)
        rest = _wanted(rest, way, None)


def _blocked(notation: Notation, text: str, content: Mapping[str, Any], client: Client, wish: Wish) -> Taken | None:
    """Something on the way is of another kind than what has to be there."""
    for number in range(1, len(wish.table) + 1):
        way = wish.table[:number]
        value = at(content, way)
        empty = value is None and client.notation == "yaml"
        if _there(content, way) and not isinstance(value, dict) and not empty:
            return Taken(way, notation.where(text, way))
    if wish.prompted and client.prompt is not None:
        way = client.prompt[0]
        if _there(content, way) and not isinstance(at(content, way), list):
            return Taken(way, notation.where(text, way))
    return None


def _there(content: Any, path: Path) -> bool:
    above = at(content, path[:-1])
    return isinstance(above, Mapping) and path[-1] in above


def _redone(client: Client, text: str, content: Mapping[str, Any], path: Path) -> Edited | None:
    """The result of adding the entry of ``content`` to another text; None when it has one already."""
    past = NOTATIONS[client.notation].read(text)
    if isinstance(past, Unreadable) or _there(past, path):
        return None
    wish = Wish(path[:-1], path[-1], at(content, path), _has_prompt(client, content))
    done = merge(client, text, wish, lambda _: False)
    return done if isinstance(done, Edited) else None


def _has_prompt(client: Client, content: Mapping[str, Any]) -> bool:
    return client.prompt is not None and client.prompt[1] in (at(content, client.prompt[0]) or [])


def _prompt_goes(client: Client, content: Mapping[str, Any], path: Path) -> bool:
    """The question for the token goes with the last server that uses its answer."""
    rest = json.dumps(_wanted(content, path, None), default=str)
    return _has_prompt(client, content) and client.reference is not None and client.reference not in rest


def _set_prompt(client: Client, content: dict[str, Any], asked: _Prompt) -> None:
    if client.prompt is None:
        return
    (key,), element = client.prompt
    if asked.comes and element not in content.setdefault(key, []):
        content[key].append(element)
    if asked.goes:
        content[key].remove(element)


def _wanted(content: Mapping[str, Any], path: Path, entry: Form | None) -> dict[str, Any]:
    """The content with the entry at a path, or (None) without it."""
    wanted: dict[str, Any] = copy.deepcopy(dict(content))
    table = wanted
    for key in path[:-1]:
        table[key] = table.get(key) or {}
        table = table[key]
    if entry is None:
        table.pop(path[-1], None)
    else:
        table[path[-1]] = entry
    return wanted


def _alike(found: Any, wanted: Any, path: Path) -> bool:
    """Equal, but for tables and lists on the way that are empty in one and missing in the other."""
    return bool(_swept(found, path) == _swept(wanted, path))


def _swept(content: Any, path: Path) -> Any:
    if not isinstance(content, dict):
        return content
    out = {key: value for key, value in content.items() if not (key == "inputs" and value == [])}
    if len(path) > 1 and path[0] in out:
        inner = _swept(out[path[0]], path[1:])
        out = {**out, path[0]: inner} if inner else {key: value for key, value in out.items() if key != path[0]}
    return out
