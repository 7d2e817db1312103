"""The state for a person and for a program."""

import json
from typing import Any

from octoform.escaping import escaped_json
from octoform.state.model import NodeState, Snapshot
from octoform.views import sentences
from octoform.views.console import Console


def show(console: Console, snapshot: Snapshot, *, as_json: bool) -> int:
    """The whole state: head, then every node."""
    if as_json:
        return _document(console, snapshot.model_dump(mode="json"))
    if not snapshot.nodes:
        console.line("The state is empty. Next:  octoform apply")
        return 0
    console.line(console.paint(f"host {snapshot.host}", "bold"))
    console.line(f"lineage {snapshot.lineage}, serial {snapshot.serial}, written by octoform {snapshot.octoform}")
    if snapshot.git and snapshot.git.revision:
        dirty = f" with uncommitted {', '.join(snapshot.git.dirty)}" if snapshot.git.dirty else ""
        console.line(f"revision {snapshot.git.revision[:12]}{dirty}")
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
    say(f"{console.paint(name, 'bold')}  {state.status.value}{mark}  {state.accepted_at or ''}".rstrip())
    if state.harness:
        maker = f"{state.harness}, {state.model}" if state.model else state.harness
        tries = "1 attempt" if state.attempts == 1 else f"{state.attempts} attempts"
        say(f"  made by   {maker}, {tries}, {state.seconds:.1f} s")
    say(f"  output    {sentences.show(state.output_digest)}")
    say(f"  key       {sentences.show(state.key)}")
    for part, value in sorted(state.key_parts.items()):
        say(f"    {part:<18} {sentences.show(value)}")
    said = {key: value for key, value in state.detail.items() if key != "contract" and not isinstance(value, dict)}
    for key, value in said.items():
        say(f"  {key:<9} {value}")


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
    console.line(escaped_json(json.dumps(value, ensure_ascii=False, indent=2)))
    return 0
