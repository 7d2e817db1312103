"""Install the endpoint and its daemon as services of a person's own systemd, and take them away. Light."""

import getpass
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.files import LAUNCHER, of_another
from octoform.endpoint.process import desired_state, lifecycle, start_command, systemd
from octoform.endpoint.process.record import Running
from octoform.endpoint.process.systemd_watch import watch_name, watch_path, watch_text, watches
from octoform.engine.tools import layout_of
from octoform.state.files import write_atomic
from octoform.state.layout import Layout

SYSTEM_FOLDER = Path("/etc/systemd/system")


@dataclass(frozen=True, slots=True)
class Companion:
    """The daemon's unit, beside the endpoint's."""

    name: str
    path: Path
    text: str


@dataclass(frozen=True, slots=True)
class Unit:
    """What would be written, and where; ``own`` for the person's own manager, else for the whole machine."""

    layout: Layout
    name: str
    path: Path
    text: str
    own: bool
    account: str
    watch: Companion


def unit_of(project: Path, environ: Mapping[str, str], *, own: bool) -> tuple[Unit | None, list[Diagnostic]]:
    """The units of the project's host; nothing is written."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    if not systemd.fits(layout):
        return None, [error("SERVICE-PATH", "a path with a line break cannot stand in a unit", path=str(project))]
    name, account = systemd.unit_name(layout), getpass.getuser()
    path = systemd.unit_path(layout, environ) if own else SYSTEM_FOLDER / name
    programs, user = environ.get("PATH") or os.defpath, None if own else account
    text = systemd.unit_text(layout, programs, user)
    beside = watch_path(layout, environ) if own else SYSTEM_FOLDER / watch_name(layout)
    watch = Companion(watch_name(layout), beside, watch_text(layout, programs, user))
    return Unit(layout, name, path, text, own, account, watch), []


def missing(unit: Unit) -> Diagnostic | None:
    """That there is nothing yet which the unit could start for long, or only what would start another's endpoint."""
    if (unit.layout.endpoint / LAUNCHER).is_file():
        return of_another(unit.layout) or _temporary()
    hint = "run octoform apply, which builds it"
    return error("ENDPOINT-NOT-APPLIED", f"{unit.layout.host} has no endpoint yet", hint=hint)


def _temporary() -> Diagnostic | None:
    """That the daemon's unit would name a program which is gone as soon as a cache is cleaned."""
    if start_command.stays(os.environ):
        return None
    hint = (
        "install it where it stays (uv tool install octoform, pipx install octoform), then run this again with that one"
    )
    summary = "octoform runs from a cache, and systemd would not find it there later"
    return error("SERVICE-COMMAND-TEMPORARY", summary, detail=sys.prefix, hint=hint)


def obstacle(unit: Unit) -> Diagnostic | None:
    """Why the units can be neither installed nor taken away; asks systemd whether it is there."""
    hint = "give one of the two hosts another name, or move that unit away"
    if unit.path.exists() and not systemd.is_ours(unit.layout, unit.path):
        summary = f"{unit.name} is there already, and it does not start this endpoint"
        return error("SERVICE-FOREIGN-UNIT", summary, path=str(unit.path), hint=hint)
    if unit.watch.path.exists() and not watches(unit.layout, unit.watch.path):
        summary = f"{unit.watch.name} is there already, and it does not watch this project"
        return error("SERVICE-FOREIGN-UNIT", summary, path=str(unit.watch.path), hint=hint)
    answer = systemd.systemctl("show-environment")
    if answer.status == 0:
        return None
    hint = (
        "octoform start runs the endpoint without it; in a session without one, set XDG_RUNTIME_DIR=/run/user/$(id -u)"
    )
    return error("SERVICE-NO-SYSTEMD", "this person's systemd does not answer", detail=answer.said or None, hint=hint)


def install(unit: Unit) -> tuple[Running | None, list[Diagnostic]]:
    """Write the units, hand the endpoint over to systemd and wait until it serves; then its daemon."""
    desired_state.mark(unit.layout)  # or a daemon that runs already would start it again at once
    lifecycle.stop(unit.layout)
    unit.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    for path, text in ((unit.path, unit.text), (unit.watch.path, unit.watch.text)):
        if problem := write_atomic(path, text.encode(), 0o600):
            return None, [problem]
    desired_state.unmark(unit.layout)
    for words in (("daemon-reload",), ("enable", "--now", unit.name)):
        if problem := _told(*words):
            return None, [problem]
    process, problem = lifecycle.start(unit.layout)
    if process is not None:
        problem = _told("enable", "--now", unit.watch.name)
    return (None if problem else process), [problem] if problem else []


def uninstall(unit: Unit) -> tuple[bool, list[Diagnostic]]:
    """Stop the daemon and the endpoint, and take the units away; False when none was installed.

    The endpoint is marked as stopped by a person, so that no other daemon starts it again; ``octoform start`` does.
    """
    if not unit.path.exists() and not unit.watch.path.exists():
        return False, []
    problems = [_told("disable", "--now", unit.watch.name)] if unit.watch.path.exists() else []
    unit.watch.path.unlink(missing_ok=True)
    if unit.path.exists():
        problems.append(desired_state.mark(unit.layout))
        problems.append(_told("disable", "--now", unit.name))
        lifecycle.stop(unit.layout)
        unit.path.unlink(missing_ok=True)
    problems.append(_told("daemon-reload"))
    return True, [item for item in problems if item]


def _told(*words: str) -> Diagnostic | None:
    answer = systemd.systemctl(*words)
    if answer.status == 0:
        return None
    summary = f"systemctl --user {' '.join(words)} failed"
    return error("SERVICE-FAILED", summary, detail=answer.said or None, hint="octoform logs shows what was printed")
