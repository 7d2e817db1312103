"""``doctor`` for a person and for a program: every check with its status, and what to do."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict

from octoform.base.escaping import escaped_json
from octoform.diagnostics import to_json
from octoform.engine.doctor import Diagnosis, Group, Installed, InstallResult
from octoform.harness.doctor_checks import Check, Status
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.format.values import one_line

_COLOURS = {Status.PASS: "green", Status.FAIL: "red", Status.UNKNOWN: "yellow"}
_WIDTH = 240
_NAME = 10


def show(console: Console, found: Diagnosis, *, as_json: bool) -> int:
    """All checks; exit code 1 when something that is needed failed."""
    if as_json:
        _document(console, found)
        return 0 if found.ok else 1
    problems.show(console, found.diagnostics)
    for group in found.groups:
        console.line(console.paint(_title(group), "bold"))
        _checks(console, group.checks)
        console.line()
    console.line(console.paint("this machine", "bold"))
    _checks(console, found.machine)
    console.line()
    counts = {status: sum(check.status is status for check in found.checks) for status in Status}
    console.line(", ".join(f"{counts[status]} {status.value}" for status in Status))
    return 0 if found.ok else 1


def _title(group: Group) -> str:
    model = f", {group.model}" if group.model else ""
    return one_line(f"{group.harness}{model} ({', '.join(group.used_for)})", _WIDTH)


def _checks(console: Console, checks: Sequence[Check]) -> None:
    for check in checks:
        status = console.paint(f"{check.status.value:<8}", _COLOURS[check.status])
        console.line(f"  {status} {check.name:<{_NAME}} {one_line(check.detail, _WIDTH)}")
        if check.hint and check.status is not Status.PASS:
            console.line(f"  {'':<8} {'':<{_NAME}} help: {one_line(check.hint, _WIDTH)}")


def _document(console: Console, found: Diagnosis) -> None:
    document = {
        "format": 1,
        "host": found.host,
        "ok": found.ok,
        "agents": [asdict(group) for group in found.groups],
        "machine": [asdict(check) for check in found.machine],
        "diagnostics": [to_json(item) for item in found.diagnostics],
    }
    console.raw(escaped_json(json.dumps(document, ensure_ascii=False, indent=2)))


# ``install`` for a person and for a program: each step while it runs, and what is there at the end.

_INSTALL_WIDTH = 200


def steps(console: Console) -> Callable[[str], None]:
    """Shows each step on standard error."""
    return lambda text: console.problem(one_line(text, _INSTALL_WIDTH))


def show_installation(console: Console, result: InstallResult, *, as_json: bool) -> int:
    """Show the installed programs; exit code 1 when something could not be installed."""
    failed = 1 if result.diagnostics else 0
    if as_json:
        document = {
            "format": 1,
            "installed": [asdict(item) for item in result.installed],
            "diagnostics": [to_json(item) for item in result.diagnostics],
        }
        console.raw(escaped_json(json.dumps(document, ensure_ascii=False, indent=2)))
        return failed
    for item in result.installed:
        console.line(_line(console, item))
    problems.show(console, result.diagnostics)
    return failed


def _line(console: Console, item: Installed) -> str:
    if item.state == "nothing":
        return f"{item.harness}: nothing to install, {item.detail}"
    text = console.paint("installed", "green") if item.state == "installed" else "installed already"
    return f"{item.harness} {item.version}: {text}, {item.detail}"
