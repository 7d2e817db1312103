"""The status of a deployment by rules alone: the class of an error from the kind of the exception and its words."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from octoform.base.clock import parse_stamp
from octoform.base.health_status import Status
from octoform.builtin.task import Task, TaskRefused
from octoform.patterns import regex
from octoform.records import dataclass

# The input of WATCH as the embedded agent asks it: what is newest, what failed and is not over, what is attached.

Row = Mapping[str, Any]
Place = tuple[str, str, str]
_PARTS = ("readings", "failures", "claims", "tools", "frames", "devices")


@dataclass(frozen=True, slots=True)
class Given:
    """The rows of an input, oldest first; ``newest`` is the last reading of each signal."""

    readings: tuple[Row, ...]
    failures: tuple[Row, ...]
    claims: tuple[Row, ...]
    tools: tuple[Row, ...]
    frames: tuple[Row, ...]
    devices: tuple[Row, ...]
    newest: Mapping[Place, Row]

    @classmethod
    def of(cls, document: Row) -> "Given":
        """TaskRefused when a part is no list of rows."""
        parts = {name: _rows(document, name) for name in _PARTS}
        newest = {(row["channel"], row["source"], row["path"]): row for row in parts["readings"]}
        return cls(**parts, newest=newest)

    def known(self, device: str) -> str | None:
        """The device, where it is one that has tools or was given."""
        served = any(device in item["devices"] for item in self.tools)
        return device if served or any(row["id"] == device for row in self.devices) else None

    def lasting(self) -> list[Row]:
        """The failures after which no success of the tool was read."""
        return [row for row in self.failures if not self._over(row)]

    def unreadable(self) -> list[Place]:
        """The signals that could not be read: null, with a reason. A null without one is what the tool answered.

        A call that failed as a whole is over once the same source was read after it.
        """
        found: dict[Place, None] = {}
        for row in self.readings:
            place = (row["channel"], row["source"], row["path"])
            found.pop(place, None)
            if row["value"] is None and row.get("why"):
                found[place] = None
            elif row["path"]:
                found.pop((row["channel"], row["source"], ""), None)
        return list(found)

    def attached(self, device: str | None) -> bool | None:
        """The kernel's state of a device; None where it is not known."""
        row = self.newest.get(("kernel", device or "", "/there"))
        return row["value"] if row is not None and isinstance(row["value"], bool) else None

    def device_of(self, failure: Row) -> str | None:
        """The device that a failed call was for, where it can only have been one."""
        tool = next((item for item in self.tools if item["name"] == failure["tool"]), None)
        devices = list(tool["devices"]) if tool is not None else []
        named = [device for device in devices if device in str(failure.get("message"))]
        certain = devices if len(devices) == 1 else named
        return certain[0] if len(certain) == 1 else None

    def _over(self, failure: Row) -> bool:
        ok = self.newest.get(("log", failure["tool"], "/ok"))
        if ok is None or ok["value"] is not True:
            return False
        at, last = parse_stamp(ok.get("at")), parse_stamp(failure.get("last"))
        return at is not None and last is not None and at >= last


def _rows(document: Row, name: str) -> tuple[Row, ...]:
    value = document.get(name, [])
    if not isinstance(value, list) or not all(isinstance(row, dict) for row in value):
        raise TaskRefused(f"the input's {name} are no list of objects")
    return tuple(value)


# The class of a failure, from the kind of its exception and its words; ``none`` where these do not decide.
#
# A class starts a repair. So only certain classes are reported: code that names what a library lacks is wrong, a module
# that does not load is missing; whatever a device, a cable or a right may be at fault for is for a person.

DEPENDENCY, BROKEN_TOOL, CORRUPTED_FILE = "dependency", "broken_tool", "corrupted_file"
DEVICE_MOVED, NONE = "device_moved", "none"
_BY_KIND = {
    "ModuleNotFoundError": DEPENDENCY,
    "ImportError": DEPENDENCY,
    "SyntaxError": CORRUPTED_FILE,
    "IndentationError": CORRUPTED_FILE,
    "TabError": CORRUPTED_FILE,
    "NameError": BROKEN_TOOL,
    "UnboundLocalError": BROKEN_TOOL,
    "NotImplementedError": BROKEN_TOOL,
    "AttributeError": BROKEN_TOOL,
    "TypeError": BROKEN_TOOL,
}
_GONE = frozenset({"FileNotFoundError", "NotADirectoryError"})
_ABSENT_VALUE = "NoneType"
_LIBRARY = regex(r"cannot open shared object file|undefined symbol|wrong ELF class|GLIBC(?:XX)?_\d", re.IGNORECASE)
_RIGHT = frozenset({"PermissionError"})
_FIXED_PLACE = regex(r"(?<![\w.])/dev/\w")


def class_of(failure: Mapping[str, Any], *, attached: bool | None) -> str:
    """One of the playbook's classes; ``attached``: whether the kernel shows the device (None: it is not known)."""
    kind, message = _words(failure, "error"), _words(failure, "message")
    if attached is False:
        return NONE
    if _LIBRARY.search(message):
        return DEPENDENCY
    if kind in _GONE and attached and _FIXED_PLACE.search(message):
        return DEVICE_MOVED
    if _ABSENT_VALUE in message:
        return NONE  # something was not there when it was asked for; whether the code or the device is at fault is open
    return _BY_KIND.get(kind, NONE)


def is_fatal(failure: Mapping[str, Any]) -> bool:
    """Whether nothing but a person can help: a right that is lacking is not given by trying again."""
    return _words(failure, "error") in _RIGHT


def _words(failure: Mapping[str, Any], name: str) -> str:
    value = failure.get(name)
    return value if isinstance(value, str) else ""


# The duty: readings and failures in, a report out. No model reads the log, so no text in it can persuade.
#
# The embedded agent makes no claim and declares nothing: these need judgement. What its rules do not decide has the
# class ``none`` and goes to a person.

MAX_ERRORS, MAX_CITES = 32, 16
MESSAGE_CHARACTERS, SUMMARY_CHARACTERS = 400, 600
_BLIND = "the embedded agent does not look at pictures"
_NO_FRAME = "no frame was given"
_FIXES = {
    "dependency": "build the serving environment from its lock again, or decide on the packages again",
    "broken_tool": "correct the function of this tool: it asks for what is not there",
    "corrupted_file": "put the accepted file back",
    "dead_process": "start the server again",
    "device_moved": "look for the hardware again",
}
_ORDERS = regex(
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
        raise TaskRefused(f"the input of WATCH cannot be used: {type(problem).__name__}: {problem}") from problem
    task.write(report)
    return f"{report['status']}, {_count(len(report['errors']), 'error')}"


def answer(document: Mapping[str, Any]) -> dict[str, Any]:
    """The report for an input."""
    given = Given.of(document)
    errors = [*_dead(given), *_gone(given), *_failing(given)][:MAX_ERRORS]
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
        message += _failure_text(last)
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
        "cites": list(dict.fromkeys(row["id"] for row in shown[-MAX_CITES:])),
    }


def _status(given: Given, errors: Sequence[Error]) -> Status:
    if any(item["class"] == "dead_process" for item in errors):
        return Status.DOWN
    if errors:
        return Status.ERROR
    return Status.UNKNOWN if given.unreadable() or not given.newest or given.claims else Status.HEALTHY


def _summary(given: Given, status: Status, errors: Sequence[Error]) -> str:
    if errors:
        about = dict.fromkeys(str(item["tool"] or item["device"] or "the server") for item in errors)
        text = f"{_count(len(errors), 'error')}, about {', '.join(about)}."
    elif not given.newest:
        text = "There is no reading, so nothing is known."
    elif status is Status.HEALTHY:
        text = f"All {len(given.newest)} signals report, and no call fails."
    else:
        text = "No call fails; what is below does not report, or is restricted by a claim."
    silent = [" ".join(place) for place in given.unreadable()]
    if silent:
        text += f" Not readable: {', '.join(silent[:5])}" + (
            f" and {len(silent) - 5} more." if len(silent) > 5 else "."
        )
    over = len(given.failures) - len(given.lasting())
    if over:
        text += f" Over, for the tool has worked since: {_count(over, 'failure')}."
    return text[:SUMMARY_CHARACTERS]


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _failure_text(failure: Row) -> str:
    """The words of a failure, unless somebody has put an address or a command there: those are not handed on."""
    text = " ".join(str(failure.get("message") or "no message").split())
    return "its words hold an address or a command and are omitted" if _ORDERS.search(text) else text


__all__ = ["run"]
