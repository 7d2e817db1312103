"""Views of start, stop and restart."""

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from octoform.base.escaping import escaped_json
from octoform.diagnostics import Diagnostic, error, to_json
from octoform.endpoint.mcp_clients.install import ClientState, Outcome
from octoform.endpoint.process.record import Running
from octoform.engine.clients import Listing, Printed, notes
from octoform.engine.endpoint_process import Started, Stopped, Unit
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.format.values import escape

_STAYS = "  it stays stopped until octoform start or apply; other clients are refused"
_PASSES = "  the stop could not be recorded: the daemon, the next client or a boot may start it again"


def started(console: Console, done: Started, *, as_json: bool) -> int:
    """Which process serves the endpoint now."""
    process = done.process
    if as_json:
        console.raw(json.dumps({"format": 1, "host": done.host, "running": True, **asdict(process)}))
        return 0
    where = f" at {process.url}" if process.url else ""
    if done.before == process:
        console.line(f"{done.host}: the endpoint runs already{where} (process {process.pid}, since {process.since})")
    else:
        console.line(f"{done.host}: the endpoint runs{where} (process {process.pid})")
    return 0


def stopped(console: Console, done: Stopped, *, stays: bool, as_json: bool) -> None:
    """Show the stopped process; ``stays`` when nothing but a person starts it again."""
    pid = done.process.pid if done.process else None
    if as_json:
        document = {"format": 1, "host": done.host, "running": False, "pid": pid, "firmly": done.firmly}
        document["stays"] = stays
        console.raw(json.dumps(document))
    elif pid is None:
        console.line(f"{done.host}: the endpoint was not running")
    else:
        how = " firmly, because it did not end by itself" if done.firmly else ""
        console.line(f"{done.host}: the endpoint was stopped{how} (process {pid})")
    if not as_json:
        console.line(_STAYS if stays else _PASSES)


# Views of service install and uninstall: the unit first, then the question, then what was done.


def unit(console: Console, found: Unit) -> None:
    """The units as they would stand on the disk."""
    for path, text in ((found.path, found.text), (found.watch.path, found.watch.text)):
        console.line(f"{path}:\n")
        for line in text.splitlines():
            console.raw(f"  {escape(line)}".rstrip())
        console.line()


def machine_wide(console: Console, found: Unit) -> int:
    """The commands for an installation for the whole machine; nothing was written."""
    console.line("Nothing was written. For the whole machine, write these files to the places above as root, then:")
    console.raw(f"  systemctl daemon-reload\n  systemctl enable --now {found.name} {found.watch.name}")
    return 0


def no_machine_wide(console: Console, found: Unit) -> int:
    """The commands for removing it by hand; nothing was removed."""
    console.line("Nothing was taken away. For the whole machine, as root:")
    console.raw(f"  systemctl disable --now {found.watch.name} {found.name}")
    console.line(f"  rm {found.watch.path} {found.path}\n  systemctl daemon-reload")
    return 0


def for_whom(verb: str) -> Diagnostic:
    """Neither of the two ways was chosen, so nothing was done."""
    hint = (
        f"octoform service {verb} -user does it for this user's systemd; "
        "-print shows the units for the whole machine and what to do with them as root"
    )
    return error("SERVICE-FOR-WHOM", f"nothing was done: service {verb} needs -user or -print", hint=hint)


def approves(console: Console, question: str) -> bool:
    """Ask on the terminal; only ``yes`` is yes."""
    console.line(f"{question} Only 'yes' will be accepted to approve.")
    console.out.write("  Enter a value: ")
    console.out.flush()
    try:
        answer = sys.stdin.readline() if sys.stdin is not None else ""
    except UnicodeDecodeError:
        answer = ""
    console.line()
    return answer.strip() == "yes"


def not_approved() -> Diagnostic:
    """The person did not say yes."""
    hint = "answer yes, or give -auto-approve where no one can be asked"
    return error("SERVICE-NOT-APPROVED", "nothing was changed: it was not approved", hint=hint)


def installed(console: Console, found: Unit, process: Running) -> int:
    """It runs, and how it would run without a session too."""
    console.line(f"{found.name}: the endpoint of {found.layout.host} runs under systemd (process {process.pid})")
    console.line(f"{found.watch.name}: its daemon does; journalctl --user -u {found.watch.name} shows what it does")
    console.line("To have it run while you are not logged in, once:")
    console.raw(f"  loginctl enable-linger {found.account}")
    return 0


def uninstalled(console: Console, found: Unit, *, was: bool) -> int:
    """It is gone."""
    text = "was stopped and taken away" if was else "was not installed"
    console.line(f"{found.name} {text}")
    return 0


# MCP clients for a person and for a program: the list, what was written into a file, a configuration to paste.

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
        document = {"format": 1, "host": found.host, "clients": [_client_document(item) for item in found.sights]}
        _json(console, document, diagnostics)
        return 0
    problems.show(console, diagnostics)
    width = max(len(item.client.key) for item in found.sights)
    for item in found.sights:
        missing = "" if item.there else ", no file yet"
        console.line(f"{item.client.key:<{width}}  {_state(console, item)}{missing}  {escape(str(item.file))}")
    return 0


def _state(console: Console, item: ClientState) -> str:
    if item.state == "installed" and not item.current:
        renew = f"octoform clients install {item.client.key} renews it"
        return console.paint(f"installed ({item.transport}), out of date: {renew}", "yellow")
    text = f"installed ({item.transport})" if item.state == "installed" else _STATES[item.state]
    return console.paint(text, _COLOURS[item.state]) if item.state in _COLOURS else text


def _client_document(item: ClientState) -> dict[str, Any]:
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
    """Show the changes, with every changed place."""
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
    """The lines of a change, without the comma and line end that part it from what is before."""
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
