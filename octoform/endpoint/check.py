"""Prove that the endpoint lives: a real client connects, lists its tools and calls every read tool once.

A server can satisfy every schema and still be dead: a library without the function that a tool needs shows only when
the tool is called, and a call that is not in the injected log is invisible to whoever watches the server.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from typing import Any

from octoform.diagnostics import Diagnostic
from octoform.endpoint.calllog import LoggedCall, calls_after, mark
from octoform.endpoint.checkreport import CheckReport, TrialCall
from octoform.endpoint.errand import Call, Client, Report, recorded_environment
from octoform.endpoint.files import CHECK
from octoform.endpoint.judging import judge_check
from octoform.endpoint.supervising import clear_left, start
from octoform.endpoint.trial import trial_arguments
from octoform.state.files import write_atomic
from octoform.state.layout import Layout

CALL_SECONDS = 20.0

__all__ = ["CheckReport", "TrialCall", "check", "judge_check"]


def check(
    layout: Layout,
    interface: Mapping[str, Any],
    *,
    smoke: bool = True,
    mode: str = "auto",
    call_seconds: float = CALL_SECONDS,
    client: Client | None = None,
) -> CheckReport:
    """Check the applied endpoint against the INTERFACE artifact and record the result beside the launcher.

    With ``smoke`` every tool of effect ``read`` is called once, one after the other; ``client`` is one that is being
    loaded already, and ends here. Never raises for what the server does. Takes two seconds of wall time, nearly all of
    it in other processes.
    """
    environment = recorded_environment(layout)
    if environment is None:
        return CheckReport(False, "the endpoint was not applied", None, None, (), (), 0.0)
    readers = [tool for tool in interface["tools"] if smoke and tool["effect"] == "read"]
    trials = {tool["name"]: trial_arguments(tool) for tool in readers}
    calls = [Call(name, given, seconds=call_seconds) for name, given in trials.items() if given is not None]
    with client or Client(layout, environment) as sent:
        process, problem = start(layout)
        if process is None:
            report = CheckReport(False, told(problem) if problem else None, None, None, (), (), 0.0)
            return replace(report, unrecorded=write_atomic(layout.endpoint / CHECK, _record(report), 0o600))
        position = mark(layout.call_log)
        seen = sent.send(calls, mode=mode)
    report = _report(seen, list(trials), calls_after(layout.call_log, position))
    report = replace(report, survivors=clear_left(process, spare=True))
    return replace(report, unrecorded=write_atomic(layout.endpoint / CHECK, _record(report), 0o600))


def told(problem: Diagnostic) -> str:
    """A diagnostic in one text."""
    return f"{problem.summary}\n{problem.detail}" if problem.detail else problem.summary


def _report(seen: Report, readers: Sequence[str], logged: Sequence[LoggedCall]) -> CheckReport:
    answers = {answer["tool"]: answer for answer in seen.calls}
    entries: dict[str, LoggedCall] = {}
    for entry in logged:
        entries.setdefault(entry.tool, entry)
    # The log names the function, whose name cannot hold every character of a tool's name.
    calls = [
        _trial(name, answers.get(name), entries.get(name) or entries.get(re.sub(r"\W", "_", name)), seen.answered)
        for name in readers
    ]
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


def _trial(name: str, answer: Mapping[str, Any] | None, entry: LoggedCall | None, answered: bool) -> TrialCall:
    if answer is None:
        reason = "no harmless arguments are known" if answered else "the server did not answer"
        return TrialCall(name, ok=False, skipped=reason)
    if answer["problem"] == "unknown_tool":
        return TrialCall(name, ok=False, skipped="the server has no such tool")
    if answer["refused"] is not None:
        return TrialCall(name, ok=False, skipped=answer["message"])
    failed = answer["is_error"] or answer["problem"] is not None
    error_class = _error_class(answer, entry) if failed else None
    message = (entry.message if entry else None) or answer["message"]
    return TrialCall(
        tool=name,
        ok=not failed,
        error_class=error_class,
        message=message if failed else None,
        ms=answer["ms"],
        logged=entry is not None and entry.ended,
        ended_well=entry.ok if entry is not None and entry.ended else None,
        pictures=tuple(answer["pictures"]),
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
        "at": datetime.now(UTC).isoformat(timespec="seconds"),
        "answered": report.answered,
        "error": report.error,
        "protocol": report.protocol,
        "server": report.server,
        "tools": sorted(tool["name"] for tool in report.tools),
        "calls": [asdict(call) for call in report.calls],
        "seconds": report.seconds,
    }
    return (json.dumps(document, indent=2) + "\n").encode()
