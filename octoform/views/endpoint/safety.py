"""Emergency stop, limits and the verdict on the audit log for a person and for a program."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from octoform.base.tokens import Token
from octoform.diagnostics import Diagnostic, to_json
from octoform.endpoint.access.audit_log import Checked
from octoform.endpoint.access.limits import Limited, Limits
from octoform.endpoint.access.tokens import Made
from octoform.endpoint.access.tunnel import Revocation
from octoform.endpoint.process.estop import Estop
from octoform.engine.safety import TokenValue
from octoform.policy.kinds import entry
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.format.output import document
from octoform.views.format.values import escape


def stopped(console: Console, done: Sequence[Estop], found: Sequence[Diagnostic], *, as_json: bool) -> int:
    """Show the actions of the emergency stop; exit code 0 only when all of it was done, everywhere."""
    ok = not found and all(item.ok for item in done)
    if as_json:
        _document(console, done, found, ok=ok)
        return 0 if ok else 1
    for item in done:
        _stopped(console, item)
    problems.show(console, found)
    return 0 if ok else 1


def _stopped(console: Console, done: Estop) -> None:
    head = f"{done.host}: {_held(done)}"
    if not done.latched:
        console.problem(console.paint(head, "red"))
    else:
        console.line(console.paint(head, "bold"))
        console.line(f"  engaged by {_by(done)}")
    if done.direct:
        tried = "did" if done.latched else "tried"
        console.line(f"  no process of the endpoint answered, so octoform {tried} it itself")
    if not done.stopped:
        console.line("  no profile names a stop action: nothing was sent to any device")
    for action in done.stopped:
        mark = console.paint("done", "green") if action.ok else console.paint("FAILED", "red")
        console.line(f"  {mark}  {escape(action.device)}: {escape(action.detail)} ({action.ms:.0f} ms)")
    for text in done.problems:
        console.problem(f"  {escape(text)}")
    if done.latched:
        console.line("  octoform estop -clear lets actuators be called again")


def _held(done: Estop) -> str:
    """How far the stop holds: for good, until the process ends, or not at all."""
    if not done.latched:
        return "NOT engaged. Actuators can be called, now or once the endpoint runs."
    if not done.lasting:
        return "stopped while its process runs; NOT engaged beyond that. Actuators can be called once it is restarted."
    return "stopped. Nothing that moves is called until it is cleared."


def cleared(console: Console, done: Sequence[Estop], found: Sequence[Diagnostic], *, as_json: bool) -> int:
    """Show who had engaged it and when; exit code 0 when all are open."""
    ok = not found and all(item.ok for item in done)
    if as_json:
        _document(console, done, found, ok=ok)
        return 0 if ok else 1
    for item in done:
        if item.by is None and not item.latched:
            console.line(f"{item.host}: was NOT engaged.")
        else:
            state = "still engaged" if item.latched else "cleared, actuators can be called again"
            console.line(f"{item.host}: {state}. It was engaged by {_by(item)}")
        for text in item.problems:
            console.problem(f"  {escape(text)}")
    problems.show(console, found)
    return 0 if ok else 1


def _document(console: Console, done: Sequence[Estop], found: Sequence[Diagnostic], *, ok: bool) -> None:
    listed = {"endpoints": [asdict(one) for one in done], "diagnostics": [to_json(item) for item in found]}
    document(console, {"format": 1, "ok": ok, **listed})


def _by(done: Estop) -> str:
    reason = f": {escape(done.reason)}" if done.reason else ", who gave no reason"
    return f"{escape(done.by or 'somebody')} at {escape(done.since or 'an unknown time')}{reason}"


def checked(console: Console, found: Checked, faults: Sequence[Diagnostic], *, as_json: bool) -> int:
    """The verdict; exit code 1 when something was done to the log."""
    if as_json:
        facts = {**asdict(found), "file": str(found.file)}
        document(console, {"format": 1, **facts, "diagnostics": [to_json(item) for item in faults]})
        return 0 if found.ok else 1
    if found.ok:
        console.line(console.paint(f"The audit log is as it was written: {found.records} records.", "green"))
        console.line(f"  the last one is number {found.seq}, hash {found.hash}")
        if found.note:
            console.line(f"  {escape(found.note)}")
    return problems.show(console, faults)


def limits(console: Console, found: Limits, *, as_json: bool) -> int:
    """Tool by tool; exit code 1 when counters are damaged, or a device is outside of a range."""
    damaged = any(tool.damaged or tool.outside for tool in found.tools)
    if as_json:
        document(console, {"format": 1, **asdict(found)})
        return 1 if damaged else 0
    if found.mode != "enforce":
        how = "reported and not enforced" if found.mode == "shadow" else "judged, and no call reaches a device"
        console.line(console.paint(f"mode {found.mode}: limits are {how}", "yellow"))
    for tool in found.tools:
        console.line(f"{console.paint(tool.tool, 'bold')}  {tool.effect}, {tool.decision}  ({escape(tool.source)})")
        for limit in tool.limits:
            console.line(f"    {escape(_limit(limit, tool))}  ({escape(str(limit['source']))})")
        if tool.unreported:
            console.line(
                "    unknown: its results do not report where the device is afterwards, so no range is checked"
            )
        for unit, text in tool.outside.items():
            message = f"the device reported {unit} {text}; nothing moves it until octoform limits -reset {tool.tool}"
            console.line(f"    {console.paint(escape(message), 'red')}")
        if tool.damaged:
            text = f"what was counted is lost; the tool is refused until octoform limits -reset {tool.tool}"
            console.line(f"    {console.paint(text, 'red')}")
    return 1 if damaged else 0


def _limit(limit: Mapping[str, Any], tool: Limited) -> str:
    """A limit in words, with what is used of it."""
    found = entry(limit, tool.tool)
    return "; ".join(text for text in (found.describe(), found.spent(tool)) if text)


def reset(console: Console, tool: str, *, as_json: bool) -> int:
    """Show that the counters were reset."""
    if as_json:
        return document(console, {"format": 1, "reset": tool})
    what = "all tools" if tool == "all" else escape(tool)
    console.line(f"What was counted for {what} is forgotten: sums, last values and times of calls begin again.")
    return 0


# Tokens and the tunnel for a person and for a program; a value is shown only where it was asked for.


def made(console: Console, found: Made, *, rotated: bool, as_json: bool) -> int:
    """A token with a new value."""
    token = found.token
    if as_json:
        return document(console, {"format": 1, **_facts(token), "value": found.value, "file": str(found.path)})
    what = "has a new value; the old one ended" if rotated else f"was made; it may call {', '.join(token.effects)}"
    console.line(f"The token {token.name} {what}." + (f" It ends {token.expires}." if token.expires else ""))
    console.line()
    console.raw(f"  {found.value}")
    console.line()
    console.line(f"It is kept in {escape(str(found.path))} (for this user alone); octoform token list never shows it.")
    return 0


def listed(console: Console, tokens: Sequence[Token], *, as_json: bool) -> int:
    """All tokens without their values."""
    if as_json:
        return document(console, {"format": 1, "tokens": [_facts(token) for token in tokens]})
    if not tokens:
        console.line("There are no tokens: no one gets in over the network. octoform token create NAME makes one.")
        return 0
    width = max(len(token.name) for token in tokens)
    for token in tokens:
        ends = f"ends {token.expires}" if token.expires else "no end"
        mark = console.paint("ended", "red") if token.ended else ends
        console.line(f"{token.name:{width}}  {','.join(token.effects)}  made {token.created}  {mark}")
    return 0


def value(console: Console, name: str, found: TokenValue, *, as_json: bool) -> int:
    """The value alone, so that a script can take it."""
    if as_json:
        return document(console, {"format": 1, "name": name, "value": found.value, "file": str(found.path)})
    console.raw(found.value)
    return 0


def ended(console: Console, name: str, *, as_json: bool) -> int:
    """A token was revoked."""
    if as_json:
        return document(console, {"format": 1, "name": name, "revoked": True})
    console.line(f"The token {name} ended, and within a second all that it has open.")
    return 0


def revoked(console: Console, found: Revocation, *, as_json: bool) -> int:
    """The tunnel is proved to be gone."""
    if as_json:
        facts = {
            "proved": True,
            "was_running": found.was_running,
            "pid": found.pid,
            "url": found.url,
            "answered_before": found.answered_before,
        }
        return document(console, {"format": 1, **facts})
    if found.pid is None:
        console.line("No tunnel was open.")
    else:
        what = "was ended" if found.was_running else "was not running"
        console.line(f"The tunnel {what}: no process of it lives (pid {found.pid}).")
    if found.url is not None:
        console.line(f"{escape(found.url)} no longer answers as this endpoint.")
        if found.answered_before is False:
            console.line("It did not answer just before either; it was heard to while the tunnel was open.")
    console.line("It stays closed until octoform start.")
    return 0


def _facts(token: Token) -> dict[str, object]:
    return {
        "name": token.name,
        "effects": list(token.effects),
        "created": token.created,
        "expires": token.expires,
        "ended": token.ended,
    }
