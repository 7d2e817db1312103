"""The logs for a person, one line for each call with its result, and for a program, one object for each line."""

import json
import re
import select
from collections.abc import Iterable, Mapping
from typing import Any

from octoform.endpoint.observe.logs import SERVER, Line, moment
from octoform.engine.inspect.logs import Entry
from octoform.escaping import escaped, escaped_json
from octoform.views.format.console import Console

POLL_MILLISECONDS = 200
_TOLD = ("found", "reason", "what", "text", "harness", "number", "action")
"""Members of octoform's own events that are words for a person."""
_GONE = select.POLLERR | select.POLLHUP | select.POLLNVAL


class Reader:
    """Whoever reads standard output."""

    def __init__(self, console: Console) -> None:
        self._poll = select.poll()
        self._poll.register(console.out.fileno(), 0)

    def waits(self) -> bool:
        """A moment's rest; False when nobody is there any more."""
        return not any(event & _GONE for _, event in self._poll.poll(POLL_MILLISECONDS))


def nothing(console: Console) -> None:
    """There is no line yet."""
    console.problem("octoform: nothing was logged yet")


def human(console: Console, entries: Iterable[Entry]) -> None:
    """A line for each entry."""
    for entry in entries:
        stamp = console.paint(moment(entry.at), "dim")
        console.line(f"{stamp}  {_call(console, entry) if entry.call is not None else _other(console, entry.line)}")


def machine(console: Console, lines: Iterable[Line]) -> None:
    """An object for each line, as it stands in the call log; what was printed has ``time`` and ``text``."""
    for line in lines:
        told = line.record or {"time": moment(line.at), "text": line.text}
        console.raw(escaped_json(json.dumps({"log": line.log, **told}, ensure_ascii=False)))


def _call(console: Console, entry: Entry) -> str:
    """Tool and arguments as they were called, then how it ended."""
    began, record = entry.call or {}, entry.line.record or {}
    given = began.get("arguments")
    told = [str(began.get("tool"))]
    if isinstance(given, Mapping):
        told += [f"{name}={json.dumps(value, ensure_ascii=False)}" for name, value in given.items()]
    call = escaped(" ".join(told))
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
