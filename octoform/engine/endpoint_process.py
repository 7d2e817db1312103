"""Start, stop and restart the endpoint's process for a person."""

import os
import sys
from collections.abc import Mapping
from pathlib import Path

from octoform.base.files import private_folder
from octoform.diagnostics import Diagnostic, as_warning, did_you_mean, error
from octoform.endpoint.access import tunnel
from octoform.endpoint.process import record, start_stop, systemd
from octoform.endpoint.process.record import Running, running
from octoform.endpoint.process.systemd import watch_name, watch_path, watch_text, watches
from octoform.endpoint.published_files import LAUNCHER, of_another
from octoform.engine.tools import layout_of
from octoform.records import dataclass
from octoform.state.files import foreign, name_of, write_atomic
from octoform.state.layout import Layout


@dataclass(frozen=True, slots=True)
class Started:
    """The running endpoint; ``before`` is the process that was there already, or was ended for this one."""

    host: str
    process: Running
    before: Running | None


@dataclass(frozen=True, slots=True)
class Stopped:
    """The result of a stop; ``process`` is None when nothing ran, ``firmly`` when it had to be killed."""

    host: str
    process: Running | None
    firmly: bool


def start(project: Path, environ: Mapping[str, str]) -> tuple[Started | None, list[Diagnostic]]:
    """Start the endpoint; an endpoint that runs is left alone. In a copied or moved folder it is made again."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    before = running(layout)
    return _start(layout, environ, before, again=before is None)


def restart(project: Path, environ: Mapping[str, str]) -> tuple[Started | None, list[Diagnostic]]:
    """End the endpoint's process, if one runs, and start another; what a person stopped stays so."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    refused = record.refusal(layout)
    if refused is not None:
        return None, [refused]
    problem = start_stop.obstacle(layout)
    if problem is not None:
        return None, [problem]
    before = running(layout) if of_another(layout) else start_stop.stop(layout).process
    return _start(layout, environ, before, again=True)


def _start(
    layout: Layout, environ: Mapping[str, str], before: Running | None, *, again: bool
) -> tuple[Started | None, list[Diagnostic]]:
    """``again``: nothing runs, or what does is to be ended; what was written for another folder becomes this one's."""
    tunnel.allow(layout)
    try:
        foreign = of_another(layout) if again else None
        if foreign is not None:
            from octoform.engine.unattended.session import take_over  # heavy, and once in the life of a copy

            problem = take_over(layout, environ, foreign)
            if problem is not None:
                return None, [problem]
        process, problem = start_stop.start(layout)
    finally:
        # Last: a daemon that finds neither a process nor the mark takes it for a death, and starts one as well.
        record.unmark(layout)
    if process is None:
        return None, [problem] if problem else []
    return Started(layout.host, process, before), []


def stop(project: Path, environ: Mapping[str, str], host: str | None) -> tuple[Stopped | None, list[Diagnostic]]:
    """End the endpoint's process of the manifest's host, or of ``host``, and let nothing start it by itself.

    A manifest, spec or profile with errors is in no one's way: they are warnings where the folder has one endpoint.
    """
    layout, found = layout_of(project, environ) if host is None else _named(project, host)
    if layout is None and host is None:
        layout, found = _only(project, found)
    if layout is None:
        return None, found
    # First the mark: an observer of the process's end finds that a person wanted it.
    problem = record.mark(layout)
    done = start_stop.stop(layout)
    found = [*found, problem] if problem is not None else found
    if problem is not None and done.process is None:
        return None, found
    return Stopped(layout.host, done.process, done.firmly), found


def _hosts(project: Path) -> list[str]:
    return sorted(path.parent.name for path in project.glob(".octoform/*/run"))


def _only(project: Path, found: list[Diagnostic]) -> tuple[Layout | None, list[Diagnostic]]:
    """The one host of the folder, where the manifest cannot be read; else None, and the command that names one."""
    hosts = _hosts(project)
    layout = Layout(project, hosts[0]) if len(hosts) == 1 else None
    if layout is not None and foreign(layout) is None:
        return layout, [as_warning(each) for each in found]
    if len(hosts) > 1:
        hint = " or ".join(f"octoform stop {name}" for name in hosts[:5])
        found = [*found, error("ENDPOINT-NOT-APPLIED", "which endpoint is to be stopped is not known", hint=hint)]
    return None, found


def _named(project: Path, host: str) -> tuple[Layout | None, list[Diagnostic]]:
    known = _hosts(project)
    if host in known:
        return Layout(project, host), []
    near = did_you_mean(host, known)
    hint = f"did you mean {near}?" if near else f"hosts with an endpoint: {', '.join(known) or 'none'}"
    return None, [error("ENDPOINT-NOT-APPLIED", f"{host} has no endpoint in this folder", hint=hint)]


# Install the endpoint and its daemon as services of a person's own systemd, and take them away. Light.

SYSTEM_FOLDER = Path("/etc/systemd/system")


@dataclass(frozen=True, slots=True)
class Companion:
    """The daemon's unit, beside the endpoint's."""

    name: str
    path: Path
    text: str


@dataclass(frozen=True, slots=True)
class Unit:
    """The unit files to write, with their paths; ``own`` for the person's own manager, else for the whole machine."""

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
        return None, [error("SERVICE-PATH", "a path with a line break cannot be in a unit", path=str(project))]
    name, account = systemd.unit_name(layout), name_of(os.getuid())
    path = systemd.unit_path(layout, environ) if own else SYSTEM_FOLDER / name
    programs, user = environ.get("PATH") or os.defpath, None if own else account
    text = systemd.unit_text(layout, programs, user)
    beside = watch_path(layout, environ) if own else SYSTEM_FOLDER / watch_name(layout)
    watch = Companion(watch_name(layout), beside, watch_text(layout, programs, user))
    return Unit(layout, name, path, text, own, account, watch), []


def missing(unit: Unit) -> Diagnostic | None:
    """A diagnostic when the unit could start no endpoint, or only that of another user; else None."""
    if (unit.layout.endpoint / LAUNCHER).is_file():
        return of_another(unit.layout) or _temporary()
    hint = "run octoform apply, which builds it"
    return error("ENDPOINT-NOT-APPLIED", f"{unit.layout.host} has no endpoint yet", hint=hint)


def _temporary() -> Diagnostic | None:
    """A diagnostic when the daemon's unit would name a program below a cache; else None."""
    if systemd.stays(os.environ):
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
    record.mark(unit.layout)  # or a daemon that runs already would start it again at once
    start_stop.stop(unit.layout)
    private_folder(unit.path.parent)
    for path, text in ((unit.path, unit.text), (unit.watch.path, unit.watch.text)):
        if problem := write_atomic(path, text.encode(), 0o600):
            return None, [problem]
    record.unmark(unit.layout)
    for words in (("daemon-reload",), ("enable", "--now", unit.name)):
        if problem := _notify_systemd(*words):
            return None, [problem]
    process, problem = start_stop.start(unit.layout)
    if process is not None:
        problem = _notify_systemd("enable", "--now", unit.watch.name)
    return (None if problem else process), [problem] if problem else []


def uninstall(unit: Unit) -> tuple[bool, list[Diagnostic]]:
    """Stop the daemon and the endpoint, and take the units away; False when none was installed.

    The endpoint is marked as stopped by a person, so that no other daemon starts it again; ``octoform start`` does.
    """
    if not unit.path.exists() and not unit.watch.path.exists():
        return False, []
    problems = [_notify_systemd("disable", "--now", unit.watch.name)] if unit.watch.path.exists() else []
    unit.watch.path.unlink(missing_ok=True)
    if unit.path.exists():
        problems.append(record.mark(unit.layout))
        problems.append(_notify_systemd("disable", "--now", unit.name))
        start_stop.stop(unit.layout)
        unit.path.unlink(missing_ok=True)
    problems.append(_notify_systemd("daemon-reload"))
    return True, [item for item in problems if item]


def _notify_systemd(*words: str) -> Diagnostic | None:
    answer = systemd.systemctl(*words)
    if answer.status == 0:
        return None
    summary = f"systemctl --user {' '.join(words)} failed"
    return error("SERVICE-FAILED", summary, detail=answer.said or None, hint="octoform logs shows what was printed")
