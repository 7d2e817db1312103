"""The logs for a person, one line for each call with its result, and for a program, one object for each line."""

from __future__ import annotations

import json
import re
import select
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from octoform.base.clock import stamp
from octoform.base.escaping import escaped, escaped_json
from octoform.endpoint.client.terminal import BEFOREHAND
from octoform.endpoint.logs import SERVER, Line
from octoform.views.format.console import Console
from octoform.views.format.output import document
from octoform.views.format.values import one_line

if TYPE_CHECKING:
    from octoform.engine.inspect.state import Entry

POLL_MILLISECONDS = 200
_TOLD = ("found", "reason", "what", "text", "harness", "number", "action")
"""Members of octoform's own events that are words for a person."""
_GONE = select.POLLERR | select.POLLHUP | select.POLLNVAL


class Reader:
    """Anyone who reads standard output."""

    def __init__(self, console: Console) -> None:
        self._poll = select.poll()
        self._poll.register(console.out.fileno(), 0)

    def waits(self) -> bool:
        """A moment's rest; False when no one is there any more."""
        return not any(event & _GONE for _, event in self._poll.poll(POLL_MILLISECONDS))


def nothing(console: Console) -> None:
    """There is no line yet."""
    console.problem("octoform: nothing was logged yet")


def human(console: Console, entries: Iterable[Entry]) -> None:
    """A line for each entry."""
    for entry in entries:
        at = console.paint(stamp(entry.at, 3), "dim")
        console.line(f"{at}  {_call(console, entry) if entry.call is not None else _other(console, entry.line)}")


def machine(console: Console, lines: Iterable[Line]) -> None:
    """An object for each line, as it is in the call log; what was printed has ``time`` and ``text``."""
    for line in lines:
        fields = line.record or {"time": stamp(line.at, 3), "text": line.text}
        console.raw(escaped_json(json.dumps({"log": line.log, **fields}, ensure_ascii=False)))


def _call(console: Console, entry: Entry) -> str:
    """Tool and arguments as they were called, then how it ended."""
    began, record = entry.call or {}, entry.line.record or {}
    given = began.get("arguments")
    lines = [str(began.get("tool"))]
    if isinstance(given, Mapping):
        lines += [f"{name}={json.dumps(value, ensure_ascii=False)}" for name, value in given.items()]
    call = escaped(" ".join(lines))
    if not entry.ended:
        return f"{call}  {console.paint('no result yet', 'yellow')}"
    took = f"  {record['ms']} ms" if isinstance(record.get("ms"), int | float) else ""
    if record.get("ok"):
        return f"{call}  {console.paint('ok', 'green')}{took}"
    problem = escaped(": ".join(str(record[name]) for name in ("error", "message") if record.get(name)))
    return f"{call}  {console.paint(problem or 'failed', 'red')}{took}"


def _other(console: Console, line: Line) -> str:
    if line.log == SERVER:
        return f"{console.paint('printed', 'dim')}  {escaped(line.text, keep=chr(9))}"
    return escaped(_event(line.record) if line.record else line.text)


def _event(record: Mapping[str, Any]) -> str:
    """A step of a run: who it concerns, what happened, the words that come with it."""
    happened = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", str(record.get("event", "?"))).lower()
    words = [str(record[name]) for name in _TOLD if record.get(name) not in (None, "")]
    head = " ".join(filter(None, ("octoform", str(record.get("node") or ""), happened)))
    return f"{head}: {', '.join(words)}" if words else head


# The audit log for a person: a sentence for each record, and for a program the records as they are.
#
# The log is written for a check of it, with a field for everything; a person who reads it after an accident wants to
# know who did what, whether it went well, and why not.

Record = Mapping[str, Any]

_COLOURS = {
    "allowed": "green",
    "refused": "red",
    "failed": "red",
    "estop": "red",
    "STUCK": "red",
    "interrupted": "yellow",
}
NARROW = 100
"""Columns of a terminal below which the date is above the records of a day, not in each of them."""
MAX_LENGTH = 1000
"""A sentence is cut after so many characters; the log itself keeps texts short."""
_DECISIONS = {"allow": "allowed", "refuse": "refused", "ask": "asked", "dry_run": "dry run"}
_OUTCOMES = {
    "ok": ("done", "{tool} answered in {ms} ms"),
    "error": ("failed", "{tool} answered with an error after {ms} ms"),
    "asks": ("asks", "{tool} asks its caller something"),
    "invalid_result": ("failed", "{tool} answered after {ms} ms with what is no result of it"),
    "too_large": ("failed", "{tool} answered with a result of {bytes} bytes or more, which is too large"),
    "blocked": ("interrupted", "{tool} held up every other call, after {ms} ms"),
    "timeout": ("interrupted", "{tool} was not done after {ms} ms"),
    "cancelled": ("interrupted", "{tool} was given up by its caller after {ms} ms"),
    "estop": ("interrupted", "{tool} was interrupted by the emergency stop after {ms} ms"),
    "shutdown": ("interrupted", "{tool} was interrupted by the end of the endpoint after {ms} ms"),
}
_PLUMBING = frozenset({"seq", "time", "event", "prev", "hash"})


def records(console: Console, found: Sequence[Record], count: int, *, as_json: bool, filtered: bool = False) -> int:
    """One record a line, the latest last; what a stop did to each device has lines of its own."""
    if as_json:
        return document(console, {"format": 1, "records": list(found)})
    if not found:
        if count:
            console.line("No record fits." if filtered else "Nothing was recorded yet.")
        return 0
    narrow, day = console.width < NARROW, ""
    for record in found:
        moment = _moment(record)
        if narrow:
            if day != moment[:10]:
                day = moment[:10]
                console.line(console.paint(day, "dim"))
            moment = moment[11:]
        _show(console, record, f"{moment:{9 if narrow else 20}}")
    return 0


def _show(console: Console, record: Record, moment: str) -> None:
    word, *sentences = _describe(record)
    painted = console.paint(f"{one_line(word, 11):11}", *([_COLOURS[word]] if word in _COLOURS else []))
    lead = f"{record.get('seq', ''):>6}  {moment}  {painted}"
    for sentence in sentences or [""]:
        console.wrapped(f"{lead} ", one_line(sentence, MAX_LENGTH), indent=len(moment) + 22)
        lead = " " * (len(moment) + 21)


def _describe(record: Record) -> list[str]:
    """A word for what happened, and its sentences."""
    event = str(record.get("event"))
    try:
        return _EVENTS[event](record) if event in _EVENTS else [event.replace("_", " "), _rest(record)]
    except (LookupError, TypeError, ValueError, AttributeError):  # a record of another version: all its fields
        return [event.replace("_", " "), _rest(record)]


def _decision(record: Record) -> list[str]:
    word = _DECISIONS.get(record["decision"], str(record["decision"]))
    given = record.get("arguments") or {}
    called = f"{record['tool']}({', '.join(f'{name}={_plain(value)}' for name, value in given.items())})"
    why = record.get("text") or _CODES.get(str(record.get("code"))) or record.get("code")
    sentences = [f"{called} for {_caller(record)}{f': {why}' if why else ''}"]
    sentences[0] += _approval(record)
    sentences += [f"would have been refused: {note}" for note in record.get("shadow") or ()]
    return [word, *sentences]


def _caller(record: Record) -> str:
    """The caller of a tool, its program and its process; of old records what they have."""
    name, pid, uid = record.get("client"), record.get("pid"), record.get("uid")
    program = json.dumps(str(name), ensure_ascii=False) if name else ""  # its own words stay between the quotes
    process = f"pid {pid} of uid {uid}" if pid is not None else ""
    known = ", ".join(filter(None, [program, process]))
    return f"{record['caller']} ({known})" if known else str(record["caller"])


def _approval(record: Record) -> str:
    """A person's part in the call, by the client's report of them and of itself."""
    asked = record["decision"] == "ask"
    if not asked and not record.get("answer"):
        return ""
    client = str(record.get("client") or "")
    marks = f"approval {record['approval']}" if record.get("approval") else ""
    message = ": a person has to approve it" if asked else ""
    if record.get("answer") == "approved":
        by = "-auto-approve" if client.startswith(BEFOREHAND) else "the client's person"
        message = f": approved by {by}" if record["decision"] == "allow" else f"; it was approved by {by}"
    return f"{message} ({marks})" if marks else message


_CODES = {"unknown_tool": "there is no such tool", "hidden_tool": "its token may not call it"}


def _outcome(record: Record) -> list[str]:
    name = str(record["outcome"])
    word, text = _OUTCOMES.get(name, (name.replace("_", " "), "{tool} after {ms} ms"))
    message = text.format_map({"bytes": "?", **record, "ms": _ms(record)})
    why = str(record.get("text") or "")
    if record.get("reference"):
        why = f"octoform logs has the exception under {record['reference']}"
    if record.get("ended") is False:
        why = "its code goes on all the same"
    return [word, f"{message}{f': {why}' if why else ''}"]


def _estop(record: Record) -> list[str]:
    reason = f": {record['reason']}" if record.get("reason") else ", who gave no reason"
    latch = record.get("latched")
    if not latch:
        return ["estop", f"emergency stop by {record['by']}{reason}; NOT engaged"]
    earlier = (latch.get("by"), latch.get("reason")) != (record["by"], record.get("reason"))
    first = f"; engaged already, since {latch.get('since')} by {latch.get('by')}" if earlier else ""
    return ["estop", f"emergency stop by {record['by']}{reason}{first}"]


def _actions(record: Record) -> list[str]:
    sentences = []
    for item in record["stopped"]:
        if isinstance(item, Mapping):
            state = "done" if item["ok"] else "FAILED"
            sentences.append(f"{state}: {item['device']}: {item['detail']} ({_ms(item)} ms)")
        else:
            sentences.append(str(item))
    return ["estop", *(sentences or ["no profile names a stop action: nothing was sent to any device"])]


def _cleared(record: Record) -> list[str]:
    was = record.get("was") or {}
    reason = f": {was['reason']}" if was.get("reason") else ", who gave no reason"
    return ["cleared", f"emergency stop cleared by {record['by']}; it was of {was.get('by') or 'somebody'}{reason}"]


def _reset(record: Record) -> list[str]:
    what = f"of {record['tool']}" if record.get("tool") else "of all tools"
    return ["reset", f"the limits {what} were set back by {record.get('by')}"]


def _tunnel(record: Record) -> list[str]:
    proof = "and verified to be gone" if record.get("proved") else "but NOT verified to be gone"
    by = f" by {record['by']}" if record.get("by") else ""
    return ["revoked", f"the tunnel {record.get('url') or ''} was ended{by}, {proof}".replace("  ", " ")]


def _token(record: Record) -> list[str]:
    done = {"token_created": "was made", "token_rotated": "got a new value", "token_revoked": "was revoked"}
    may = ", ".join(map(str, record["effects"]))
    until = f" until {record['expires']}" if record.get("expires") else ""
    return ["token", f"the token {record['token']} ({may}{until}) {done[record['event']]} by {record['by']}"]


def _stuck(record: Record) -> list[str]:
    keeps = f", and keeps {', '.join(record['buses'])}" if record.get("buses") else ""
    return ["STUCK", f"{record['tool']} was stopped and goes on{keeps}; octoform restart ends it"]


_EVENTS: Mapping[str, Callable[[Record], list[str]]] = {
    "decision": _decision,
    "outcome": _outcome,
    "ended": lambda record: ["ended", f"the code of {record['tool']} ended after {_ms(record)} ms"],
    "stuck": _stuck,
    "outside": lambda record: [
        "OUTSIDE",
        f"after {record['tool']} the device reported "
        + ", ".join(f"{unit} {text}" for unit, text in record["units"].items()),
    ],
    "place_unknown": lambda record: [
        "unknown",
        f"the result of {record['tool']} does not contain its position {', '.join(record['units'])} is now",
    ],
    "estop": _estop,
    "estop_actions": _actions,
    "estop_cleared": _cleared,
    "limits_reset": _reset,
    "tunnel_revoked": _tunnel,
    "token_created": _token,
    "token_rotated": _token,
    "token_revoked": _token,
    "started": lambda record: ["started", f"the endpoint started, scope {record['scope']}"],
    "stopped": lambda _: ["stopped", "the endpoint stopped"],
    "audit_rotated": lambda record: [
        "log",
        f"the log was full and goes on in a new file; the former is {record['file']}",
    ],
    "audit_torn": lambda record: ["log", f"{record['bytes']} bytes of a record that was cut off are before this one"],
    "audit_seal_lost": lambda _: ["log", "the seal of the log was gone; octoform audit -verify checks the log"],
}


def _rest(record: Record) -> str:
    return "  ".join(f"{name}: {_plain(value)}" for name, value in record.items() if name not in _PLUMBING)


def _moment(record: Record) -> str:
    """The time to the second, RFC 3339; it is UTC, and states that."""
    stamp = one_line(str(record.get("time", "")), 30)
    return f"{stamp[:19]}Z" if stamp.endswith("Z") else stamp


def _ms(record: Record) -> str:
    value = record.get("ms")
    return f"{value:.0f}" if isinstance(value, int | float) else "?"


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)
