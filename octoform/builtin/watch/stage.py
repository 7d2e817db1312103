"""The duty: readings and failures in, a report out. No model reads the log, so nothing that stands there can persuade.

The embedded agent makes no claim and declares nothing: these need judgement. What its rules do not decide has the class
``none`` and goes to a person.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from octoform.builtin.task import Refused, Task
from octoform.builtin.watch.classes import NONE, class_of, is_fatal
from octoform.builtin.watch.given import Given, Row

MOST_ERRORS, MOST_CITES = 32, 16
MESSAGE_CHARACTERS, SUMMARY_CHARACTERS = 400, 600
_BLIND = "the embedded agent does not look at pictures"
_NO_FRAME = "no frame was given"
_FIXES = {
    "dependency": "build the serving environment from its lock again, or decide on the packages anew",
    "broken_tool": "correct the function of this tool: it asks for what is not there",
    "corrupted_file": "put the accepted file back",
    "dead_process": "start the server again",
    "device_moved": "look for the hardware again",
}
_ORDERS = re.compile(
    r"\b[a-z][a-z0-9+.-]{1,20}://\S|"
    r"(?<![\w.-])(?:sudo|curl|wget|chmod|chown|pip3?\s+install|apt(?:-get)?\s+install|rm\s+-|(?:ba|z)?sh\s+-c)(?![\w-])",
    re.IGNORECASE,
)
Error = dict[str, Any]


def run(task: Task) -> str:
    """Write the report; the summary line (``error, 1 error``)."""
    try:
        report = answer(task.read_input())
    except (KeyError, TypeError, AttributeError) as problem:
        raise Refused(f"the input of WATCH cannot be used: {type(problem).__name__}: {problem}") from problem
    task.write(report)
    return f"{report['status']}, {_count(len(report['errors']), 'error')}"


def answer(document: Mapping[str, Any]) -> dict[str, Any]:
    """The report for an input."""
    given = Given.of(document)
    errors = [*_dead(given), *_gone(given), *_failing(given)][:MOST_ERRORS]
    status = _status(given, errors)
    return {
        "format": 1,
        "stage": "watch",
        "status": status,
        "summary": _summary(given, status, errors),
        "physical_state": {"available": False, "seen": None, "reason": _BLIND if given.frames else _NO_FRAME},
        "errors": errors,
        "claims": [],
        "declarations": [],
    }


def _dead(given: Given) -> list[Error]:
    dead = [row for (channel, _, _), row in given.newest.items() if channel == "process" and row["value"] is False]
    if not dead:
        return []
    words = " and ".join(f"{row['source']} {row['path'].strip('/')} is false" for row in dead)
    return [_error(None, None, "dead_process", f"the server does not run or answer: {words}", dead)]


def _gone(given: Given) -> Iterator[Error]:
    for (channel, device, path), row in given.newest.items():
        if channel == "kernel" and path == "/there" and row["value"] is False:
            failed = [item for item in given.lasting() if given.device_of(item) == device]
            message = f"{device} is not attached; only a person can plug it in"
            yield _error(None, given.known(device), NONE, message, [row, *failed])


def _failing(given: Given) -> Iterator[Error]:
    """One error for each tool and class; what fails because its device is gone stands with the device."""
    groups: dict[tuple[str, str | None, str], list[Row]] = {}
    for row in given.lasting():
        device = given.device_of(row)
        attached = given.attached(device)
        if attached is not False:
            groups.setdefault((row["tool"], device, class_of(row, attached=attached)), []).append(row)
    for (tool, device, kind), rows in groups.items():
        count = sum(row["count"] for row in rows if isinstance(row.get("count"), int))
        last = rows[-1]
        message = f"{_count(count or len(rows), 'call')} failed, last with {last.get('error') or 'an error'}: "
        message += _told(last)
        yield _error(tool, device, kind, message, rows, fatal=any(is_fatal(row) for row in rows))


def _error(
    tool: str | None, device: str | None, kind: str, message: str, shown: Sequence[Row], *, fatal: bool = False
) -> Error:
    return {
        "tool": tool,
        "device": device,
        "class": kind,
        "message": message[:MESSAGE_CHARACTERS],
        "severity": "fatal" if fatal else "recoverable",
        "suggested_fix": _FIXES.get(kind),
        "cites": list(dict.fromkeys(row["id"] for row in shown[-MOST_CITES:])),
    }


def _status(given: Given, errors: Sequence[Error]) -> str:
    if any(item["class"] == "dead_process" for item in errors):
        return "down"
    if errors:
        return "error"
    return "unknown" if given.unreadable() or not given.newest or given.claims else "healthy"


def _summary(given: Given, status: str, errors: Sequence[Error]) -> str:
    if errors:
        about = dict.fromkeys(str(item["tool"] or item["device"] or "the server") for item in errors)
        told = f"{_count(len(errors), 'error')}, about {', '.join(about)}."
    elif not given.newest:
        told = "There is no reading, so nothing is known."
    elif status == "healthy":
        told = f"All {len(given.newest)} signals report, and no call fails."
    else:
        told = "No call fails; what is below does not report, or is restricted by a claim."
    silent = [" ".join(place) for place in given.unreadable()]
    if silent:
        told += f" Not readable: {', '.join(silent[:5])}" + (
            f" and {len(silent) - 5} more." if len(silent) > 5 else "."
        )
    over = len(given.failures) - len(given.lasting())
    if over:
        told += f" Over, for the tool has worked since: {_count(over, 'failure')}."
    return told[:SUMMARY_CHARACTERS]


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _told(failure: Row) -> str:
    """The words of a failure, unless somebody has put an address or a command there: those are not handed on."""
    text = " ".join(str(failure.get("message") or "no message").split())
    return "its words hold an address or a command and are left out" if _ORDERS.search(text) else text
