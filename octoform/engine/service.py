"""Install the endpoint as a service of a person's own systemd, and take it away. Light."""

import getpass
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from octoform.diagnostics import Diagnostic, error
from octoform.endpoint import supervising, systemd
from octoform.endpoint.files import LAUNCHER
from octoform.endpoint.running import Running
from octoform.engine.serving import layout_of
from octoform.state.files import write_atomic
from octoform.state.layout import Layout

SYSTEM_FOLDER = Path("/etc/systemd/system")


@dataclass(frozen=True, slots=True)
class Unit:
    """What would be written, and where; ``own`` for the person's own manager, else for the whole machine."""

    layout: Layout
    name: str
    path: Path
    text: str
    own: bool
    account: str


def unit_of(project: Path, environ: Mapping[str, str], *, own: bool) -> tuple[Unit | None, list[Diagnostic]]:
    """The unit of the project's host; nothing is written."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    if not systemd.fits(layout):
        return None, [error("SERVICE-PATH", "a path with a line break cannot stand in a unit", path=str(project))]
    name, account = systemd.unit_name(layout), getpass.getuser()
    path = systemd.unit_path(layout, environ) if own else SYSTEM_FOLDER / name
    text = systemd.unit_text(layout, environ.get("PATH") or os.defpath, None if own else account)
    return Unit(layout, name, path, text, own, account), []


def missing(unit: Unit) -> Diagnostic | None:
    """That there is nothing yet which the unit could start."""
    if (unit.layout.endpoint / LAUNCHER).is_file():
        return None
    hint = "run octoform apply, which builds it"
    return error("ENDPOINT-NOT-APPLIED", f"{unit.layout.host} has no endpoint yet", hint=hint)


def obstacle(unit: Unit) -> Diagnostic | None:
    """Why the unit can be neither installed nor taken away; asks systemd whether it is there."""
    if unit.path.exists() and not systemd.is_ours(unit.layout, unit.path):
        summary = f"{unit.name} is there already, and it does not start this endpoint"
        hint = "give one of the two hosts another name, or move that unit away"
        return error("SERVICE-FOREIGN-UNIT", summary, path=str(unit.path), hint=hint)
    answer = systemd.systemctl("show-environment")
    if answer.status == 0:
        return None
    hint = (
        "octoform start runs the endpoint without it; in a session without one, set XDG_RUNTIME_DIR=/run/user/$(id -u)"
    )
    return error("SERVICE-NO-SYSTEMD", "this person's systemd does not answer", detail=answer.said or None, hint=hint)


def install(unit: Unit) -> tuple[Running | None, list[Diagnostic]]:
    """Write the unit, hand the endpoint over to systemd and wait until it serves."""
    supervising.stop(unit.layout)
    unit.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    if problem := write_atomic(unit.path, unit.text.encode(), 0o600):
        return None, [problem]
    for words in (("daemon-reload",), ("enable", "--now", unit.name)):
        if problem := _told(*words):
            return None, [problem]
    process, problem = supervising.start(unit.layout)
    return process, [problem] if problem else []


def uninstall(unit: Unit) -> tuple[bool, list[Diagnostic]]:
    """Stop the endpoint and take the unit away; False when none was installed."""
    if not unit.path.exists():
        return False, []
    problem = _told("disable", "--now", unit.name)
    supervising.stop(unit.layout)
    unit.path.unlink(missing_ok=True)
    again = _told("daemon-reload")
    return True, [item for item in (problem, again) if item]


def _told(*words: str) -> Diagnostic | None:
    answer = systemd.systemctl(*words)
    if answer.status == 0:
        return None
    summary = f"systemctl --user {' '.join(words)} failed"
    return error("SERVICE-FAILED", summary, detail=answer.said or None, hint="octoform logs shows what was printed")
