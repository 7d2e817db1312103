"""Start, stop and restart the endpoint's process for a person."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.endpoint.access import tunnel
from octoform.endpoint.files import of_another
from octoform.endpoint.process import desired_state, lifecycle
from octoform.endpoint.process.record import Running, running
from octoform.engine.tools import layout_of
from octoform.state.layout import Layout


@dataclass(frozen=True, slots=True)
class Started:
    """The running endpoint; ``before`` is the process that was there already, or was ended for this one."""

    host: str
    process: Running
    before: Running | None


@dataclass(frozen=True, slots=True)
class Stopped:
    """What was ended; ``process`` is None when nothing ran, ``firmly`` when it had to be killed."""

    host: str
    process: Running | None
    firmly: bool


def start(project: Path, environ: Mapping[str, str]) -> tuple[Started | None, list[Diagnostic]]:
    """Start the endpoint; an endpoint that runs is left alone. In a copied or moved folder it is made anew."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    before = running(layout)
    return _start(layout, environ, before, anew=before is None)


def restart(project: Path, environ: Mapping[str, str]) -> tuple[Started | None, list[Diagnostic]]:
    """End the endpoint's process, if one runs, and start another; what a person stopped stays so."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    refused = desired_state.refusal(layout)
    if refused is not None:
        return None, [refused]
    problem = lifecycle.obstacle(layout)
    if problem is not None:
        return None, [problem]
    before = running(layout) if of_another(layout) else lifecycle.stop(layout).process
    return _start(layout, environ, before, anew=True)


def _start(
    layout: Layout, environ: Mapping[str, str], before: Running | None, *, anew: bool
) -> tuple[Started | None, list[Diagnostic]]:
    """``anew``: nothing runs, or what does is to be ended; what was written for another folder becomes this one's."""
    tunnel.allow(layout)
    try:
        foreign = of_another(layout) if anew else None
        if foreign is not None:
            from octoform.engine.unattended.takeover import take_over  # heavy, and once in the life of a copy

            problem = take_over(layout, environ, foreign)
            if problem is not None:
                return None, [problem]
        process, problem = lifecycle.start(layout)
    finally:
        # Last: a daemon that finds neither a process nor the mark takes it for a death, and starts one as well.
        desired_state.unmark(layout)
    if process is None:
        return None, [problem] if problem else []
    return Started(layout.host, process, before), []


def stop(project: Path, environ: Mapping[str, str], host: str | None) -> tuple[Stopped | None, list[Diagnostic]]:
    """End the endpoint's process of the manifest's host, or of ``host``, and let nothing start it by itself."""
    layout, found = layout_of(project, environ) if host is None else _named(project, host)
    if layout is None:
        return None, found
    # First the mark: whoever sees the process end finds that a person wanted it.
    problem = desired_state.mark(layout)
    done = lifecycle.stop(layout)
    if problem is not None and done.process is None:
        return None, [problem]
    return Stopped(layout.host, done.process, done.firmly), [problem] if problem else []


def _named(project: Path, host: str) -> tuple[Layout | None, list[Diagnostic]]:
    known = sorted(path.parent.name for path in project.glob(".octoform/*/run"))
    if host in known:
        return Layout(project, host), []
    near = did_you_mean(host, known)
    hint = f"did you mean {near}?" if near else f"hosts with an endpoint: {', '.join(known) or 'none'}"
    return None, [error("ENDPOINT-NOT-APPLIED", f"{host} has no endpoint in this folder", hint=hint)]
