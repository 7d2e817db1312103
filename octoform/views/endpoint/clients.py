"""MCP clients for a person and for a program: the list, what was written into a file, a configuration to paste."""

import json
from collections.abc import Sequence
from typing import Any

from octoform.diagnostics import Diagnostic, to_json
from octoform.endpoint.mcp_clients.install import Outcome, Sight
from octoform.engine.clients import Listing, Printed, notes
from octoform.escaping import escaped_json
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.format.values import escape

_WIDTH = 160
_SAID = {
    "added": "added to",
    "updated": "brought up to date in",
    "present": "is there already in",
    "removed": "removed from",
    "absent": "is not in",
}
_COLOURS = {"installed": "green", "foreign": "yellow", "unreadable": "red"}
_STATES = {
    "absent": "not installed",
    "foreign": "another entry of that name",
    "unreadable": "the file cannot be read or changed",
}


def listing(console: Console, found: Listing, diagnostics: Sequence[Diagnostic], *, as_json: bool) -> int:
    """One line for each client: its name for the command line, the state, the file."""
    if as_json:
        document = {"format": 1, "host": found.host, "clients": [_sight(item) for item in found.sights]}
        _json(console, document, diagnostics)
        return 0
    problems.show(console, diagnostics)
    width = max(len(item.client.key) for item in found.sights)
    for item in found.sights:
        missing = "" if item.there else ", no file yet"
        console.line(f"{item.client.key:<{width}}  {_state(console, item)}{missing}  {escape(str(item.file))}")
    return 0


def _state(console: Console, item: Sight) -> str:
    if item.state == "installed" and not item.current:
        renew = f"octoform clients install {item.client.key} renews it"
        return console.paint(f"installed ({item.transport}), out of date: {renew}", "yellow")
    said = f"installed ({item.transport})" if item.state == "installed" else _STATES[item.state]
    return console.paint(said, _COLOURS[item.state]) if item.state in _COLOURS else said


def _sight(item: Sight) -> dict[str, Any]:
    return {
        "client": item.client.key,
        "title": item.client.title,
        "file": str(item.file),
        "exists": item.there,
        "state": item.state,
        "transport": item.transport,
        "current": item.current if item.state == "installed" else None,
        "diagnostics": [to_json(item.problem)] if item.problem else [],
    }


def outcome(console: Console, done: Outcome, diagnostics: Sequence[Diagnostic], *, as_json: bool) -> int:
    """What was done, with every changed place."""
    if as_json:
        _json(console, {"format": 1, **_outcome(done)}, diagnostics)
        return 0
    problems.show(console, diagnostics)
    kind = f" ({done.transport})" if done.transport else ""
    console.line(f"{done.client.title}: the endpoint{kind} {_SAID[done.state]} {escape(str(done.file))}")
    for hunk in done.hunks:
        for line in _lines(hunk.removed):
            console.raw(console.paint(f"        - {line}", "red"))
        for number, line in enumerate(_lines(hunk.added), hunk.line):
            console.raw(console.paint(f"  {number:>5} + {line}", "green"))
    if done.backup is not None:
        console.line(f"  the file as it was: {escape(str(done.backup))}")
    for note in notes(done):
        console.line(f"  {note}")
    return 0


def _lines(text: str) -> list[str]:
    """The lines of a change, without the comma and line end that part it from what stands before."""
    lines = [escape(line) for line in text.lstrip(",\r\n").rstrip().splitlines()]
    return [line if len(line) <= _WIDTH else line[:_WIDTH] + "…" for line in lines]


def _outcome(done: Outcome) -> dict[str, Any]:
    return {
        "client": done.client.key,
        "file": str(done.file),
        "state": done.state,
        "transport": done.transport,
        "backup": str(done.backup) if done.backup else None,
        "changes": [{"line": item.line, "removed": item.removed, "added": item.added} for item in done.hunks],
        "notes": list(notes(done)),
    }


def printed(console: Console, found: Printed) -> int:
    """The text as it is, so that it can be piped into a file; the rest on standard error."""
    console.out.write(found.text)
    console.out.flush()
    console.problem(f"for {found.file}")
    for note in found.notes:
        console.problem(note)
    return 0


def _json(console: Console, document: dict[str, Any], diagnostics: Sequence[Diagnostic]) -> None:
    document["diagnostics"] = [to_json(item) for item in diagnostics]
    console.raw(escaped_json(json.dumps(document, ensure_ascii=False, indent=2)))
