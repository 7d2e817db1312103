"""Edited specs for a person and for a program."""

from collections.abc import Sequence
from dataclasses import asdict

from octoform.engine.spec_edits import Shown
from octoform.views.format.console import Console
from octoform.views.format.output import document
from octoform.views.format.values import escape

STYLES = {"+": "green", "-": "red", "@": "cyan"}


def diff(console: Console, edits: Sequence[Shown], *, as_json: bool) -> int:
    """What waits, as unified diffs against today's specs."""
    if as_json:
        return document(console, {"format": 1, "edits": [asdict(edit) for edit in edits]})
    if not edits:
        console.line("No agent's edit of a spec waits.")
        return 0
    for edit in edits:
        _one(console, edit)
    return 0


def _one(console: Console, edit: Shown) -> None:
    say, paint = console.line, console.paint
    used = "the accepted output was made with it" if edit.accepted else "no accepted output was made with it"
    say(paint(f"{edit.path}  edited in attempt {edit.attempt}; {used}", "bold"))
    if edit.moved:
        say(paint("  the spec has changed since; what stands below is against the spec of today", "yellow"))
    for line in edit.diff[2:]:
        style = STYLES.get(line[:1])
        console.raw(paint(escape(line), style) if style else escape(line))
    say()
    say(f"octoform spec promote {edit.stage}   makes it permanent")
    say(f"octoform spec reset {edit.stage}     drops it")


def promoted(console: Console, stage: str, *, as_json: bool) -> int:
    """An edit became the spec."""
    text = f"protocol/{stage}.md is now as the agent corrected it. Look at it and commit it."
    return _done(console, (stage,), text, as_json=as_json)


def dropped(console: Console, stages: Sequence[str], *, as_json: bool) -> int:
    """Edits were dropped."""
    text = f"Dropped the edit of {', '.join(stages)}." if stages else "No agent's edit of a spec waits."
    return _done(console, stages, text, as_json=as_json)


def _done(console: Console, stages: Sequence[str], text: str, *, as_json: bool) -> int:
    if as_json:
        return document(console, {"format": 1, "stages": list(stages), "done": text})
    console.line(text)
    return 0
