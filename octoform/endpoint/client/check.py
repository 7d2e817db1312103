"""Prove that the endpoint lives: a real client connects, lists its tools and calls every read tool for each device.

A server can satisfy every schema and still be dead: a library without the function that a tool needs shows only when
the tool is called, and a call that is not in the injected log is invisible to anyone who watches the server.
"""

import json
import math
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from octoform.base.clock import stamp
from octoform.diagnostics import Diagnostic
from octoform.endpoint.bounded_program import ForkServer
from octoform.endpoint.client.check_verdict import CheckReport, SampleCallResult, judge_check
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.sdk_client import ClientReport, converse, recorded_environment
from octoform.endpoint.expected_tools import untried
from octoform.endpoint.logs import LoggedCall, calls_after, mark
from octoform.endpoint.process.start_stop import clear_left, start
from octoform.endpoint.published_files import CHECK
from octoform.policy.resolve import LINE
from octoform.records import dataclass, replace
from octoform.state.files import write_atomic
from octoform.state.layout import Layout

# The test calls of a read tool, one for each device, with harmless arguments: its author's or its schema's.

_SIMPLE: dict[str, Any] = {"boolean": False, "array": [], "object": {}, "null": None}


@dataclass(frozen=True, slots=True)
class SampleCall:
    """A call to make of a tool; None where no harmless arguments are known. ``device`` is None where the tool does not
    say which."""

    tool: str
    device: str | None
    call: ToolCall | None


def sample_calls(tool: Mapping[str, Any]) -> list[SampleCall]:
    """The calls that prove a tool of the INTERFACE artifact: one for each value of its parameter ``device``."""
    name, given = tool["name"], sample_arguments(tool)
    listed = tool["input_schema"].get("properties", {}).get("device", {}).get("enum", ())
    devices = [value for value in listed if isinstance(value, str)]
    if given is not None and len(devices) > 1:
        return [SampleCall(name, device, ToolCall(name, {**given, "device": device})) for device in devices]
    only = tool.get("devices") or (None,)
    call = ToolCall(name, given) if given is not None else None
    return [SampleCall(name, only[0] if len(only) == 1 else None, call)]


def sample_arguments(tool: Mapping[str, Any]) -> dict[str, Any] | None:
    """Arguments for a tool of the INTERFACE artifact; None when a required one cannot be derived.

    The author's ``smoke.arguments`` come first. Otherwise only required parameters are given a value: the schema's
    default, constant, first example or choice, or its lower bound.
    """
    smoke = tool.get("smoke")
    if isinstance(smoke, Mapping):
        return dict(smoke.get("arguments", {}))
    schema = tool["input_schema"]
    properties = schema.get("properties", {})
    found = {}
    for name in schema.get("required", []):
        known, value = _value(properties.get(name, {}))
        if not known:
            return None
        found[name] = value
    return found


def _value(schema: Mapping[str, Any]) -> tuple[bool, Any]:
    for key in ("default", "const"):
        if key in schema:
            return True, schema[key]
    for key in ("enum", "examples"):
        if schema.get(key):
            return True, schema[key][0]
    return _by_type(schema)


def _by_type(schema: Mapping[str, Any]) -> tuple[bool, Any]:
    kind = schema.get("type")
    if kind in ("integer", "number"):
        return _number(schema, whole=kind == "integer")
    if kind == "array" and schema.get("minItems", 0) > 0:
        known, item = _value(schema.get("items", {}))
        return known, [item] * schema["minItems"]
    if kind == "object" and schema.get("required"):
        return False, None
    return (kind in _SIMPLE, _SIMPLE.get(str(kind)))


def _number(schema: Mapping[str, Any], *, whole: bool) -> tuple[bool, Any]:
    if "minimum" in schema:
        return True, schema["minimum"]
    if "exclusiveMinimum" in schema:
        low = schema["exclusiveMinimum"]
        return True, low + 1 if whole else low + 1e-6
    # A number without a lower bound has no value that is known to be harmless, except a bound from above.
    return ("maximum" in schema, schema.get("maximum"))


CALL_SECONDS = 20.0
REPEATED = 2
"""How often a quick reading is made again: whether it moves shows in three."""

__all__ = ["CheckReport", "SampleCallResult", "check", "judge_check"]


def check(
    layout: Layout,
    interface: Mapping[str, Any],
    *,
    smoke: bool = True,
    mode: str = "auto",
    call_seconds: float = CALL_SECONDS,
    seconds: float = math.inf,
) -> CheckReport:
    """Check the applied endpoint against the INTERFACE artifact and record the result beside the launcher.

    With ``smoke`` every tool of effect ``read`` is called for each of its devices, one call after the other, and then
    again what answered at once with numbers, save for tools that write to a line which no one knows. After ``seconds``
    the check is ended. Never raises for what the server does. Takes two seconds of wall time, nearly all of it in
    other processes.
    """
    environment = recorded_environment(layout)
    if environment is None:
        return CheckReport(False, "the endpoint was not applied", None, None, (), (), 0.0)
    readers = [tool for tool in interface["tools"] if smoke and tool["effect"] == "read"]
    asked = untried(layout)
    wanted = [trial for tool in readers if tool["name"] not in asked for trial in sample_calls(tool)]
    left = tuple(SampleCallResult(tool["name"], ok=False, skipped=LINE) for tool in readers if tool["name"] in asked)
    calls = [replace(trial.call, seconds=call_seconds) for trial in wanted if trial.call is not None]
    until = time.monotonic() + seconds
    ForkServer.at(environment.python)  # it loads while the endpoint does
    process, problem = start(layout)
    if process is None:
        report = CheckReport(False, describe(problem) if problem else None, None, None, (), (), 0.0)
        return replace(report, unrecorded=write_atomic(layout.endpoint / CHECK, _record(report), 0o600))
    position = mark(layout.call_log)
    seen = converse(layout, environment, calls, again=REPEATED, mode=mode, seconds=max(0.0, until - time.monotonic()))
    report = _report(seen, wanted, calls_after(layout.call_log, position))
    report = replace(report, calls=(*report.calls, *left), survivors=clear_left(process, spare=True))
    return replace(report, unrecorded=write_atomic(layout.endpoint / CHECK, _record(report), 0o600))


def describe(problem: Diagnostic) -> str:
    """A diagnostic in one text."""
    return f"{problem.summary}\n{problem.detail}" if problem.detail else problem.summary


def _report(seen: ClientReport, wanted: Sequence[SampleCall], logged: Sequence[LoggedCall]) -> CheckReport:
    answers, log = iter(seen.calls), _Log(logged)
    taken = [(trial, next(answers, None) if trial.call is not None else None) for trial in wanted]
    firsts = [(trial, answer, log.of(answer) if answer else None) for trial, answer in taken]
    again = _repeated(taken, log)
    calls = [_sample(*first, again.get(index, ()), seen.answered) for index, first in enumerate(firsts)]
    error = seen.error
    if error and not seen.answered and seen.log.strip():
        error = f"{error}\n{seen.log.strip()[-1500:]}"
    return CheckReport(
        seen.answered,
        error,
        seen.protocol,
        seen.server,
        tuple(seen.tools),
        tuple(calls),
        round(seen.seconds, 3),
        seen.survivors,
        seen.log,
    )


class _Log:
    """The calls of the log, handed out in the order in which they were made."""

    def __init__(self, logged: Sequence[LoggedCall]) -> None:
        self._left = list(logged)

    def of(self, answer: Mapping[str, Any]) -> LoggedCall | None:
        """The next call of the tool, None where it did not come to one. The log names the function, whose name cannot
        hold every character of a tool's name.
        """
        if answer["problem"] in ("unknown_tool", "bad_argument") or answer["refused"] is not None:
            return None
        names = (answer["tool"], re.sub(r"\W", "_", answer["tool"]))
        for index, entry in enumerate(self._left):
            if entry.tool in names:
                return self._left.pop(index)
        return None


def _repeated(
    taken: Sequence[tuple[SampleCall, Mapping[str, Any] | None]], log: _Log
) -> dict[int, list[tuple[Any, LoggedCall | None]]]:
    """By the place of a call, what its repetitions gave; turn by turn, as they were made."""
    found: dict[int, list[tuple[Any, LoggedCall | None]]] = {}
    for turn in range(REPEATED):
        for index, (_, answer) in enumerate(taken):
            if answer is not None and len(answer["again"]) > turn:
                found.setdefault(index, []).append((answer["again"][turn], log.of(answer)))
    return found


def _sample(
    sample: SampleCall,
    answer: Mapping[str, Any] | None,
    entry: LoggedCall | None,
    again: Sequence[tuple[Any, LoggedCall | None]],
    answered: bool,
) -> SampleCallResult:
    name, device = sample.tool, sample.device
    if answer is None:
        reason = "no harmless arguments are known" if answered else "the server did not answer"
        return SampleCallResult(name, ok=False, skipped=reason, device=device)
    if answer["problem"] == "unknown_tool":
        return SampleCallResult(name, ok=False, skipped="the server has no such tool", device=device)
    if answer["refused"] is not None:
        return SampleCallResult(name, ok=False, skipped=answer["message"], device=device)
    made = [(answer["structured"], entry), *again]
    failed = answer["is_error"] or answer["problem"] is not None
    error_class = _error_class(answer, entry) if failed else None
    message = (entry.message if entry else None) or answer["message"]
    return SampleCallResult(
        tool=name,
        ok=not failed,
        error_class=error_class,
        message=message if failed else None,
        ms=answer["ms"],
        logged=entry is not None and entry.ended,
        ended_well=entry.ok if entry is not None and entry.ended else None,
        pictures=tuple(answer["pictures"]),
        device=device,
        results=tuple(result for result, _ in made if result is not None),
        raw=tuple(one.raw for _, one in made if one is not None),
    )


def _error_class(answer: Mapping[str, Any], entry: LoggedCall | None) -> str:
    if answer["problem"] in _PROBLEMS:
        return _PROBLEMS[answer["problem"]]
    if entry is not None and entry.ended:
        # The tool itself was content: what it gave was refused on its way to the client.
        return "ResultRefused" if entry.ok else entry.error or "ToolError"
    return "ToolError"


_PROBLEMS = {
    "timeout": "Timeout",
    "output_schema": "OutputSchema",
    "protocol": "Protocol",
    "bad_argument": "BadArgument",
}


def _record(report: CheckReport) -> bytes:
    document = {
        "format": 1,
        "at": stamp(),
        "answered": report.answered,
        "error": report.error,
        "protocol": report.protocol,
        "server": report.server,
        "tools": sorted(tool["name"] for tool in report.tools),
        # The devices' answers are between them and the clients.
        "calls": [
            {
                **{name: value for name, value in asdict(call).items() if name not in ("results", "raw")},
                "content": call.content,
            }
            for call in report.calls
        ],
        "seconds": report.seconds,
    }
    return (json.dumps(document, indent=2) + "\n").encode()
