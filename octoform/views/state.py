"""The state for a person and for a program."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from octoform.base.escaping import escaped_json
from octoform.engine.spec_edits import EditView
from octoform.state.model import NodeState, Snapshot
from octoform.views import plan_text as plan_text
from octoform.views.format.console import Console
from octoform.views.format.output import document
from octoform.views.format.values import escape, one_line, used

# How a node's output came about: whose agent made it, for whom, with what help, at what cost.
#
# The state's entries may have come with a pull, so nothing of it is taken for granted: every word is escaped
# and cut, and what has another shape than octoform writes is omitted.

WIDTH = 160
MAX_SOURCES = 48
TOLD = frozenset({"reused", "escalated", "spec_edit"})
"""The reported members of a node's detail."""


def describe(name: str, state: NodeState) -> Iterator[tuple[str, str]]:
    """(label, text) of each line, fit to be shown."""
    reused = _table(state, "reused")
    if state.harness and not state.detail.get("skipped"):
        yield "made by", f"{_cut(plan_text.agent(state.harness, state.model), WIDTH)}, {_tries(state, reused)}"
    if reused:
        yield "reused", _reused(reused)
    escalated = _table(state, "escalated")
    if escalated:
        yield "escalated", _escalated(escalated)
    if _table(state, "spec_edit"):
        yield "spec", f"made with a spec that an agent corrected; octoform spec diff {_cut(name)}"
    usage = state.usage
    cost = used(usage.input_tokens, usage.cached_tokens, usage.output_tokens, usage.cost_usd, usage.cost_source or "")
    if cost:
        yield "used", _cut(cost, WIDTH)


def _tries(state: NodeState, reused: Mapping[str, Any]) -> str:
    if reused:
        return f"for another host; verified here in {state.seconds:.1f} s"
    return f"{plan_text.counted(state.attempts, 'attempt')}, {state.seconds:.1f} s"


def _reused(reused: Mapping[str, Any]) -> str:
    """``from host a of project ../b (its state's serial 3), where it was accepted at ...; made for host c``."""
    project, host = reused.get("project"), _cut(reused.get("host"))
    of = "this project" if project == "." else f"project {_cut(project)}"
    accepted = reused.get("accepted_at")
    when = f", accepted there at {_cut(accepted)}" if accepted else ""
    return f"from host {host} of {of} (serial {_cut(reused.get('serial'))}){when}; made for host {_made_for(reused)}"


def _made_for(reused: Mapping[str, Any]) -> str:
    return _cut(reused.get("made_for", reused.get("host")))


def _escalated(escalated: Mapping[str, Any]) -> str:
    model = escalated.get("model")
    who = plan_text.agent(_cut(escalated.get("harness")), _cut(model) if model else None)
    asked, left = escalated.get("asked"), escalated.get("still_unknown")
    return f"{who} was asked about {_cut(asked)} unknown; {_cut(left)} still unknown"


def _table(state: NodeState, key: str) -> Mapping[str, Any]:
    value = state.detail.get(key)
    return value if isinstance(value, dict) else {}


def _cut(value: object, width: int = MAX_SOURCES) -> str:
    return one_line(str(value), width) if isinstance(value, str | int | float) else "?"


MAX_LINES = 100
"""Of the parts of a key and of the facts about a node that are shown; a program is given all."""
MAX_COLUMN = 40


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
        console.line("made without profiles and answers (-tier1)")
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
    for label, text in describe(name, state):
        say(f"  {label:<9} {text}")
    say(f"  output    {_line(plan_text.show(state.output_digest))}")
    say(f"  key       {_line(plan_text.show(state.key))}")
    parts = [(_line(part), _line(plan_text.show(value))) for part, value in sorted(state.key_parts.items())[:MAX_LINES]]
    wide = min(MAX_COLUMN, max((len(part) for part, _ in parts), default=0))
    for part, value in parts:
        say(f"    {part:<{wide}} {value}")
    known = {"contract", *TOLD}
    fields = {key: value for key, value in state.detail.items() if key not in known and not isinstance(value, dict)}
    rows = [("" if number else key, row) for key, value in fields.items() for number, row in enumerate(_rows(value))]
    for key, row in rows[:MAX_LINES]:
        say(f"  {_line(key):<9} {_line(row)}")


def _rows(value: object) -> list[str]:
    """The lines of a detail: a list has a line for each of its items, and a mapping in it is shown without brackets."""
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
    return one_line(text, WIDTH)


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


# Edited specs for a person and for a program.

STYLES = {"+": "green", "-": "red", "@": "cyan"}


def diff(console: Console, edits: Sequence[EditView], *, as_json: bool) -> int:
    """The waiting edits, as unified diffs against the present specs."""
    if as_json:
        return document(console, {"format": 1, "edits": [asdict(edit) for edit in edits]})
    if not edits:
        console.line("No agent's edit of a spec waits.")
        return 0
    for edit in edits:
        _one(console, edit)
    return 0


def _one(console: Console, edit: EditView) -> None:
    say, paint = console.line, console.paint
    used = "the accepted output was made with it" if edit.accepted else "no accepted output was made with it"
    say(paint(f"{edit.path}  edited in attempt {edit.attempt}; {used}", "bold"))
    if edit.moved:
        say(paint("  the spec has changed since; the diff below is against the current spec", "yellow"))
    for line in edit.diff[2:]:
        style = STYLES.get(line[:1])
        console.raw(paint(escape(line), style) if style else escape(line))
    say()
    say(f"octoform spec promote {edit.stage}   makes it permanent")
    say(f"octoform spec reset {edit.stage}     drops it")


def promoted(console: Console, stage: str, *, as_json: bool) -> int:
    """An edit became the spec."""
    text = f"protocol/{stage}.md is now as the agent corrected it. Look at it and commit it."
    return _edit_done(console, (stage,), text, as_json=as_json)


def dropped(console: Console, stages: Sequence[str], *, as_json: bool) -> int:
    """Edits were dropped."""
    text = f"Dropped the edit of {', '.join(stages)}." if stages else "No agent's edit of a spec waits."
    return _edit_done(console, stages, text, as_json=as_json)


def _edit_done(console: Console, stages: Sequence[str], text: str, *, as_json: bool) -> int:
    if as_json:
        return document(console, {"format": 1, "stages": list(stages), "done": text})
    console.line(text)
    return 0
