"""The state for a person and for a program."""

import json
from typing import Any

from octoform.escaping import escaped_json
from octoform.state.model import NodeState, Snapshot
from octoform.views.format.console import Console
from octoform.views.format.values import one_line
from octoform.views.inspect import provenance
from octoform.views.plan import text as plan_text

MOST = 100
"""Of the parts of a key and of the facts about a node that are shown; a program is given all."""
MOST_WIDE = 40


def show(console: Console, snapshot: Snapshot, *, as_json: bool) -> int:
    """The whole state: head, then every node."""
    if as_json:
        return _document(console, snapshot.model_dump(mode="json"))
    if not snapshot.nodes:
        console.line("The state is empty. Next:  octoform apply")
        return 0
    console.line(console.paint(_line(f"host {snapshot.host}"), "bold"))
    console.line(
        _line(f"lineage {snapshot.lineage}, serial {snapshot.serial}, written by octoform {snapshot.octoform}")
    )
    if snapshot.git and snapshot.git.revision:
        dirty = f" with uncommitted {', '.join(snapshot.git.dirty)}" if snapshot.git.dirty else ""
        console.line(_line(f"revision {snapshot.git.revision[:12]}{dirty}"))
    if snapshot.tier1:
        console.line("made as if nobody had said anything of its devices (-tier1)")
    for name, state in snapshot.nodes.items():
        console.line()
        _node(console, name, state)
    return 0


def listing(console: Console, snapshot: Snapshot, *, as_json: bool) -> int:
    """Node names, one a line."""
    if as_json:
        return _document(console, {"format": 1, "nodes": list(snapshot.nodes)})
    for name in snapshot.nodes:
        console.line(name)
    return 0


def node(console: Console, name: str, state: NodeState, *, as_json: bool) -> int:
    """One node."""
    if as_json:
        return _document(console, {"format": 1, "node": name, **state.model_dump(mode="json")})
    _node(console, name, state)
    return 0


def _node(console: Console, name: str, state: NodeState) -> None:
    say = console.line
    mark = "  tainted" if state.tainted else ""
    say(f"{console.paint(_line(name), 'bold')}  {state.status.value}{mark}  {state.accepted_at or ''}".rstrip())
    for label, text in provenance.told(name, state):
        say(f"  {label:<9} {text}")
    say(f"  output    {_line(plan_text.show(state.output_digest))}")
    say(f"  key       {_line(plan_text.show(state.key))}")
    parts = [(_line(part), _line(plan_text.show(value))) for part, value in sorted(state.key_parts.items())[:MOST]]
    wide = min(MOST_WIDE, max((len(part) for part, _ in parts), default=0))
    for part, value in parts:
        say(f"    {part:<{wide}} {value}")
    known = {"contract", *provenance.TOLD}
    said = {key: value for key, value in state.detail.items() if key not in known and not isinstance(value, dict)}
    rows = [("" if number else key, row) for key, value in said.items() for number, row in enumerate(_rows(value))]
    for key, row in rows[:MOST]:
        say(f"  {_line(key):<9} {_line(row)}")


def _rows(value: object) -> list[str]:
    """What a detail says: a list has a line for each of its items, and a mapping in it is told without brackets."""
    if not isinstance(value, list):
        return [str(value)]
    return [_row(item) for item in value] or ["none"]


def _row(item: object) -> str:
    if not isinstance(item, dict):
        return str(item)
    name = f"{item['unit']}: " if "unit" in item else ""
    return name + ", ".join(
        f"{key} {value}" for key, value in item.items() if key != "unit" and value not in ([], None)
    )


def _line(text: str) -> str:
    """A state may have come with a pull: nothing in it acts on the terminal or fills it."""
    return one_line(text, provenance.WIDTH)


def forgotten(console: Console, name: str, *, as_json: bool) -> int:
    """A node left the state."""
    return _done(console, f"{name} is forgotten; its artifact stays. The next plan will make it again.", name, as_json)


def adopted(console: Console, name: str, *, as_json: bool) -> int:
    """A node's artifact was adopted."""
    return _done(console, f"{name} is accepted as it is, under today's specs and settings.", name, as_json)


def unlocked(console: Console, lock_id: str) -> int:
    """A lock was removed."""
    console.line(f"The lock {lock_id} is removed.")
    return 0


def _done(console: Console, text: str, name: str, as_json: bool) -> int:
    if as_json:
        return _document(console, {"format": 1, "node": name, "done": text})
    console.line(text)
    return 0


def _document(console: Console, value: dict[str, Any]) -> int:
    console.raw(escaped_json(json.dumps(value, ensure_ascii=False, indent=2)))
    return 0
