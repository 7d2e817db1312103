"""Status for a person and for a program: both axes with their reasons, and what the process reports of itself."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from octoform.base.escaping import escaped_json
from octoform.daemon.status import Survey
from octoform.daemon.store.instance_lock import Record
from octoform.diagnostics import to_json
from octoform.engine.project_status import Process, Status
from octoform.views import plan_text as plan_text
from octoform.views.daemon.event_log import EXIT, STYLES, named
from octoform.views.format.console import Console
from octoform.views.format.problems import show
from octoform.views.format.values import one_line

WIDTH = 150
_MODES = {
    "shadow": "the policy only watches (mode shadow): nothing is refused",
    "dry_run": "what would move is a dry run (mode dry_run): only readings are done",
}


def status(console: Console, found: Status, surveyed: Survey, *, as_json: bool) -> int:
    """Exit code 0 only for in sync and healthy; that of ``health`` where it is not healthy, else 1."""
    verdict, watched = surveyed.health.status, surveyed.watched
    code = EXIT[verdict] or (0 if found.sync else 1)
    reasons = _reasons(found, surveyed)
    if as_json:
        document = {**_document(found, surveyed, reasons), "watched": None if watched is None else watched.process.pid}
        console.raw(escaped_json(json.dumps(document, ensure_ascii=False, indent=2)))
        return code
    show(console, found.warnings)
    sync = console.paint("in sync", "green") if found.sync else console.paint("out of sync", "yellow")
    console.line(f"host {found.host}: {sync}, {console.paint(str(verdict), STYLES[verdict])}")
    if found.plan is not None and not found.sync:
        console.line(f"  {plan_text.summary(found.plan).splitlines()[0]}  (octoform plan shows why)")
    if found.recorded:
        console.wrapped("  ", one_line(plan_text.recorded(found.recorded), WIDTH), indent=4)
    for reason in reasons:
        console.wrapped("  ", one_line(reason, WIDTH), indent=4)
    if found.tools:
        console.line(f"  the endpoint answers with {plan_text.counted(len(found.tools), 'tool')}")
    for line in _process(found.process):
        console.wrapped("  ", one_line(line, WIDTH), indent=4)
    if found.process.running is not None or watched is not None:
        console.wrapped("  ", one_line(_watched(watched), WIDTH), indent=4)
    for host in found.others:
        text = f"the endpoint of {host}, which octopus.yaml does not name, runs: octoform stop {host} ends it"
        console.wrapped("  ", text, indent=4)
    if found.process.estop is not None:
        text = console.paint("emergency stop", "red")
        console.wrapped(f"  {text} ", one_line(_estop(found.process.estop), WIDTH), indent=4)
    return code


def uncompared(console: Console, found: Status, surveyed: Survey, *, as_json: bool) -> int:
    """Reports a failed plan, without a comparison; the status of the deployment is shown all the same.

    Exit code 1, or that of ``health`` where it is not healthy.
    """
    verdict, host, reasons = surveyed.health.status, surveyed.health.host, _reasons(found, surveyed)
    if as_json:
        document = _document(replace(found, host=host), surveyed, reasons)
        document["diagnostics"] = [to_json(item) for item in found.diagnostics]
        console.raw(escaped_json(json.dumps(document, ensure_ascii=False, indent=2)))
    else:
        show(console, found.diagnostics)
        console.line(f"host {host}: not compared, {console.paint(str(verdict), STYLES[verdict])}")
        for reason in reasons:
            console.wrapped("  ", one_line(reason, WIDTH), indent=4)
    return EXIT[verdict] or 1


def _reasons(found: Status, surveyed: Survey) -> tuple[str, ...]:
    """The drift from the last apply, then the basis of the verdict, each once."""
    parts = (each for each in surveyed.health.parts if not each.target.startswith("unit:"))
    lines = [named(each.target, each.why) for each in parts]
    silent = len(surveyed.health.uncovered)
    verb = "has" if silent == 1 else "have"
    counted = [f"{plan_text.counted(silent, 'signal')} {verb} no data: octoform health names them"] if silent else []
    return tuple(dict.fromkeys((*found.reasons, *lines, *counted)))


def _document(found: Status, surveyed: Survey, reasons: Sequence[str]) -> dict[str, Any]:
    process = found.process
    return {
        "format": 1,
        "host": found.host,
        "in_sync": found.sync,
        "health": str(surveyed.health.status),
        "reasons": list(reasons),
        "tools": list(found.tools),
        "running": process.running is not None,
        "process": None if process.running is None else {**asdict(process.running), **(process.reported or {})},
        "estop": process.estop,
        "tokens": process.tokens,
        "others": list(found.others),
        "recorded": bool(found.recorded),
        "warnings": [to_json(item) for item in found.warnings],
    }


def _watched(daemon: Record | None) -> str:
    if daemon is None:
        return "no one watches it: octoform watch keeps it alive"
    return f"a daemon watches it: process {daemon.process.pid} since {daemon.since}; octoform health shows its findings"


def _process(process: Process) -> Iterator[str]:
    """The facts of the process; members of its answer that this octoform does not know are omitted."""
    running, found = process.running, process.reported or {}
    if running is None:
        return
    clients = found.get("clients")
    count = f", {plan_text.counted(clients, 'local client')}" if isinstance(clients, int) else ""
    yield f"process {running.pid} since {running.since}, scope {running.scope}{count}"
    if running.url:
        yield f"at {running.url}, open to {plan_text.counted(process.tokens, 'token')}"
    if isinstance(found.get("tunnel"), Mapping):
        yield _tunnel(found["tunnel"])
    gate = found.get("gate")
    if isinstance(gate, Mapping):
        yield from _gate(gate)


def _gate(gate: Mapping[str, Any]) -> Iterator[str]:
    if gate.get("mode") in _MODES:
        yield _MODES[gate["mode"]]
    for stuck in gate.get("stuck") or ():
        yield _stuck(stuck)
    if gate.get("approvals"):
        yield f"{plan_text.counted(int(gate['approvals']), 'call')} waiting for an approval"
    if gate.get("audit"):
        yield f"the audit log cannot be written: {gate['audit']}"


def _stuck(call: Mapping[str, Any]) -> str:
    buses = f", which keeps {', '.join(call['buses'])}" if call.get("buses") else ""
    return f"stuck: {call.get('tool')} for {call.get('seconds')} s{buses} (octoform restart ends it)"


def _tunnel(tunnel: Mapping[str, Any]) -> str:
    state = tunnel.get("state")
    if state == "running":
        return f"tunnel: {tunnel.get('url')} since {tunnel.get('since')}"
    reason = tunnel.get("reason")
    return f"tunnel: {state}{f' ({reason})' if reason else ''}"


def _estop(estop: Mapping[str, Any]) -> str:
    reason = f": {estop['reason']}" if estop.get("reason") else ""
    since = f" at {estop['since']}" if estop.get("since") else ""
    return f"engaged by {estop.get('by')}{since}{reason} (octoform estop -clear opens it)"
