"""``install`` for a person and for a program: each step while it runs, and what is there at the end."""

import json
from collections.abc import Callable
from dataclasses import asdict

from octoform.diagnostics import to_json
from octoform.engine.installation import Installed, InstallResult
from octoform.escaping import escaped_json
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.format.values import one_line

_WIDTH = 200


def steps(console: Console) -> Callable[[str], None]:
    """Shows each step on standard error."""
    return lambda text: console.problem(one_line(text, _WIDTH))


def show(console: Console, result: InstallResult, *, as_json: bool) -> int:
    """What is there; exit code 1 when something could not be installed."""
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
    said = console.paint("installed", "green") if item.state == "installed" else "installed already"
    return f"{item.harness} {item.version}: {said}, {item.detail}"
