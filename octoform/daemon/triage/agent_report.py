"""Turns WATCH's report into findings: its closed classes are the playbook, and what is in none of them is for a person.

A report has passed its contract before it comes here (the tools and devices it names exist, its statements cite
readings); what it states is still an agent's word, so it changes nothing that code can see better.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import escaped
from octoform.base.health_status import Status
from octoform.daemon.model import Facts, FaultClass, Finding, Kind, Repair

MAX_FINDINGS = 20
TEXT_CHARS, SUMMARY_CHARS = 300, 600
_KINDS = {
    FaultClass.DEPENDENCY: Kind.PACKAGE_DAMAGED,
    FaultClass.BROKEN_TOOL: Kind.TOOL_FAILING,
    FaultClass.CORRUPTED_FILE: Kind.FILE_DAMAGED,
    FaultClass.DEAD_PROCESS: Kind.PROCESS_DEAD,
    FaultClass.DEVICE_MOVED: Kind.DEVICE_MOVED,
    FaultClass.NONE: Kind.TOOL_FAILING,
}
_STATUSES = {FaultClass.DEPENDENCY: Status.ERROR, FaultClass.DEAD_PROCESS: Status.DOWN}
_PLAYBOOK = {
    FaultClass.DEPENDENCY: (Repair.REBUILD, Repair.HEAL),
    FaultClass.BROKEN_TOOL: (Repair.HEAL, Repair.HEAL),
    FaultClass.CORRUPTED_FILE: (Repair.RESTORE, Repair.HEAL),
    FaultClass.DEAD_PROCESS: (Repair.RESTART, Repair.RESTART),
    FaultClass.DEVICE_MOVED: (Repair.REBIND, Repair.REDISCOVER),
    FaultClass.NONE: (Repair.PERSON,),
}


def findings_of(report: Mapping[str, Any] | None, facts: Facts) -> tuple[Finding, ...]:
    """A finding for each error of a WATCH report; None (no report came) is unknown and for a person, never healthy.

    ``data["error"]`` is the error as it was reported, which HEAL is given.
    """
    if report is None:
        return (_lost("WATCH gave no report that counts"),)
    found = [_finding(each, facts) for each in _errors(report)]
    if not found and report.get("status") not in (Status.HEALTHY, Status.DEGRADED):
        found.append(
            _lost(f"WATCH reports {_text(report.get('status'))} and names no error: {_text(report.get('summary'))}")
        )
    return tuple({finding.key: finding for finding in found}.values())


def summary_of(report: Mapping[str, Any] | None) -> str | None:
    """The words that sum a report up, for the next one; None where it has none."""
    return str((report or {}).get("summary") or "")[:SUMMARY_CHARS] or None


def _errors(report: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    errors = report.get("errors")
    for each in (errors if isinstance(errors, list) else [])[:MAX_FINDINGS]:
        if isinstance(each, Mapping):
            yield each


def _finding(reported: Mapping[str, Any], facts: Facts) -> Finding:
    fault = _class(reported.get("class"))
    fatal = reported.get("severity") == "fatal"
    repairs = (Repair.PERSON,) if fatal else _sensible(fault, facts)
    tool, device = reported.get("tool"), reported.get("device")
    # The wording differs from report to report of the same problem, so it is no evidence.
    evidence = ("watch", str(fault), "fatal" if fatal else "recoverable")
    return Finding(
        Kind.TOOL_FAILING if fatal else _KINDS[fault],
        fault,
        _target(fault, tool, device),
        _text(reported.get("message")) or "WATCH names an error without a message",
        evidence,
        repairs[0],
        repairs[1:],
        Status.ERROR if fatal else _STATUSES.get(fault, Status.DEGRADED),
        _text(reported.get("suggested_fix")),
        {"by": "watch", "error": dict(reported), "tool": tool, "device": device},
    )


def _sensible(fault: FaultClass, facts: Facts) -> tuple[Repair, ...]:
    """The playbook's repairs, but for those that the facts speak against: an agent's word starts nothing that runs."""
    if fault is FaultClass.DEAD_PROCESS and facts.process is not None and facts.answers:
        return (Repair.PERSON,)
    if fault is FaultClass.CORRUPTED_FILE and not facts.damaged:
        return (Repair.HEAL,)
    return _PLAYBOOK[fault]


def _class(value: object) -> FaultClass:
    try:
        return FaultClass(str(value))
    except ValueError:
        return FaultClass.NONE


def _target(fault: FaultClass, tool: object, device: object) -> str:
    if fault is FaultClass.DEAD_PROCESS:
        return "endpoint"
    if fault is FaultClass.DEVICE_MOVED and device:
        return f"device:{_text(device)}"
    if tool:
        return f"tool:{_text(tool)}"
    return f"device:{_text(device)}" if device else "endpoint"


def _lost(summary: str) -> Finding:
    evidence = ("watch", "no report")
    return Finding(Kind.UNCOVERED, FaultClass.NONE, "watch", summary, evidence, Repair.PERSON, status=Status.UNKNOWN)


def _text(value: object) -> str:
    return escaped(str(value or ""))[:TEXT_CHARS]
