"""Emergency stop, audit log and limits for a person and for a program."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from octoform.diagnostics import Diagnostic, to_json
from octoform.endpoint.auditing import Checked
from octoform.endpoint.estop import Estop
from octoform.endpoint.limiting import Limited, Limits
from octoform.views import problems
from octoform.views.console import Console
from octoform.views.text import escape, one_line
from octoform.views.texts import document

_WORDS = {"allow": "green", "deny": "red", "refuse": "red", "failed": "red", "estop": "red"}
_OWN = frozenset({"seq", "time", "event", "prev", "hash", "tool", "caller", "decision", "outcome", "arguments", "text"})
_QUIET = frozenset({"call", "effect", "transport", "ms"})


def stopped(console: Console, done: Sequence[Estop], *, as_json: bool) -> int:
    """What the emergency stop did; exit code 0 only when all of it was done."""
    if as_json:
        document(
            console, {"format": 1, "ok": all(item.ok for item in done), "endpoints": [asdict(one) for one in done]}
        )
    else:
        for item in done:
            _stopped(console, item)
    return 0 if all(item.ok for item in done) else 1


def _stopped(console: Console, done: Estop) -> None:
    if done.latched:
        console.line(console.paint(f"{done.host}: stopped. Nothing that moves is called until it is cleared.", "bold"))
        console.line(f"  latched by {_by(done)}")
    else:
        console.problem(console.paint(f"{done.host}: NOT latched. Actuators can still be called.", "red"))
    if done.direct:
        console.line("  no process of the endpoint answered, so octoform did it itself")
    if not done.stopped:
        console.line("  no profile names a stop action: nothing was sent to any device")
    for action in done.stopped:
        mark = console.paint("done", "green") if action.ok else console.paint("FAILED", "red")
        console.line(f"  {mark}  {escape(action.device)}: {escape(action.detail)} ({action.ms:.0f} ms)")
    for text in done.problems:
        console.problem(f"  {escape(text)}")
    console.line("  octoform estop -clear lets actuators be called again")


def cleared(console: Console, done: Sequence[Estop], *, as_json: bool) -> int:
    """Who had latched it and when; exit code 0 when it is open."""
    if as_json:
        document(
            console, {"format": 1, "ok": all(item.ok for item in done), "endpoints": [asdict(one) for one in done]}
        )
        return 0 if all(item.ok for item in done) else 1
    for item in done:
        if item.by is None and not item.latched:
            console.line(f"{item.host}: was not latched.")
            continue
        state = "Still latched" if item.latched else "Cleared: actuators can be called again"
        console.line(f"{item.host}: {state}. It was latched by {_by(item)}")
        for text in item.problems:
            console.problem(f"  {escape(text)}")
    return 0 if all(item.ok for item in done) else 1


def _by(done: Estop) -> str:
    reason = f": {escape(done.reason)}" if done.reason else ", who gave no reason"
    return f"{escape(done.by or 'somebody')} at {escape(done.since or 'an unknown time')}{reason}"


def records(console: Console, found: Sequence[Mapping[str, Any]], *, as_json: bool) -> int:
    """One line a record, the latest last."""
    if as_json:
        return document(console, {"format": 1, "records": list(found)})
    if not found:
        console.line("Nothing was recorded yet.")
    for record in found:
        console.line(_record(console, record))
    return 0


def _record(console: Console, record: Mapping[str, Any]) -> str:
    word = str(record.get("decision") or record.get("outcome") or record["event"])
    parts = [str(record[name]) for name in ("tool", "caller") if record.get(name)]
    arguments = record.get("arguments")
    if isinstance(arguments, Mapping) and arguments:
        parts.append(", ".join(f"{name}={_plain(value)}" for name, value in arguments.items()))
    if record.get("text"):
        parts.append(str(record["text"]))
    parts.extend(f"{name}: {_plain(value)}" for name, value in record.items() if name not in _OWN | _QUIET and value)
    moment = str(record.get("time", ""))[:19].replace("T", " ")
    text = one_line("  ".join(parts), max(40, console.width - 44))
    painted = console.paint(f"{one_line(word, 16):16}", *([_WORDS[word]] if word in _WORDS else []))
    return f"{record.get('seq', ''):>6}  {one_line(moment, 19)}  {painted} {text}"


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


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
    """Tool by tool; exit code 1 when counters are damaged."""
    damaged = any(tool.damaged for tool in found.tools)
    if as_json:
        document(console, {"format": 1, **asdict(found)})
        return 1 if damaged else 0
    if found.mode != "enforce":
        how = "told and not enforced" if found.mode == "shadow" else "judged, and no call reaches a device"
        console.line(console.paint(f"mode {found.mode}: limits are {how}", "yellow"))
    for tool in found.tools:
        console.line(f"{console.paint(tool.tool, 'bold')}  {tool.effect}, {tool.decision}  ({escape(tool.source)})")
        for limit in tool.limits:
            console.line(f"    {escape(_limit(limit, tool))}  ({escape(str(limit['source']))})")
        if tool.damaged:
            text = f"what was counted is lost; the tool is refused until octoform limits -reset {tool.tool}"
            console.line(f"    {console.paint(text, 'red')}")
    return 1 if damaged else 0


def _limit(limit: Mapping[str, Any], tool: Limited) -> str:
    """A limit in words, with what is used of it."""
    kind, name = limit["kind"], str(limit.get("parameter"))
    unit = f" {limit['unit']}" if limit.get("unit") else ""
    if kind == "range":
        low, high = limit.get("minimum"), limit.get("maximum")
        ends = f"at most {high}" if low is None else f"at least {low}" if high is None else f"{low} to {high}"
        return f"{name}: {ends}{unit}"
    if kind == "step":
        last = f"; the last one was {tool.last[name]}{unit}" if name in tool.last else ""
        return f"{name}: changed by {limit['most']}{unit} at most{last}"
    if kind == "cumulative":
        return f"{name}: sum of all calls {limit['most']}{unit} at most; it is {tool.sums.get(name, 0)}{unit}"
    if kind == "rate":
        recent = sum(1 for age in tool.calls if age < limit["seconds"])
        return f"{limit['calls']} calls in {limit['seconds']:g} s; {recent} used"
    if kind == "cooldown":
        wait = limit["seconds"] - min(tool.calls, default=limit["seconds"])
        return f"{limit['seconds']:g} s between two calls" + (f"; the next in {wait:.1f} s" if wait > 0 else "")
    return f"not from {limit['from']} to {limit['to']}"


def reset(console: Console, tool: str, *, as_json: bool) -> int:
    """What was counted is forgotten."""
    if as_json:
        return document(console, {"format": 1, "reset": tool})
    what = "all tools" if tool == "all" else escape(tool)
    console.line(f"What was counted for {what} is forgotten: sums, last values and times of calls begin anew.")
    return 0
