"""Look through a camera of the host, once or again and again, and keep what is known of it. (Heavy.)

A heartbeat is nothing but looks at an interval, so a person in the foreground and a process that watches the host
call the same function. A look without a picture is a look as well: it is noted with its reason.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from octoform.apply.context import Clock
from octoform.contracts.artifact_parser import parse
from octoform.diagnostics import Diagnostic, did_you_mean, error, has_errors, warning
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.terminal import Person
from octoform.engine.plan.configuration import Compiled, compile_project
from octoform.engine.plan.refresh import artifacts_there
from octoform.manifest.model import Perception
from octoform.perception import camera_selection
from octoform.perception.camera_selection import best
from octoform.perception.capture import FROZEN_PICTURES, Taken, take
from octoform.perception.frames import Camera, Record, keep
from octoform.records import dataclass, field
from octoform.state.artifact_cache import read_instances
from octoform.state.files import display, foreign, read_regular, refused, write_atomic
from octoform.state.layout import Layout

PERCEIVE = "step.perceive"
_STAGES = ("probe", "identify", "interface")
REPEAT_SECONDS = 2.0
"""Seconds between the pictures that show whether a camera is frozen, once it gave the same one twice."""
Take = Callable[[Layout, ToolCall, Person | None], Taken | Diagnostic]


@dataclass(frozen=True, slots=True)
class Eye:
    """A camera that is looked through, with the host's settings; ``blind`` is why there is none."""

    layout: Layout
    settings: Perception
    camera: Camera | None = None
    blind: Diagnostic | None = None


@dataclass(frozen=True, slots=True)
class Look:
    """One look: when it ended (RFC 3339), its picture or why there is none, and the record after it.

    ``record`` is None where nothing could be kept; ``found`` are the diagnostics of the keeping.
    """

    at: str
    camera: Camera | None
    outcome: Taken | Diagnostic
    record: Record | None
    found: tuple[Diagnostic, ...] = field(default=())

    @property
    def problem(self) -> str | None:
        """Why the picture shows nothing (``black``, ``uniform``, ``frozen``); None for one that does, and for none."""
        frame = self.record.current if self.record else None
        return frame.problem if frame and isinstance(self.outcome, Taken) else None

    @property
    def suspected(self) -> bool:
        """True when more pictures are needed to determine whether the camera stands still."""
        frame = self.record.current if self.record else None
        return frame is not None and frame.suspected


def open_eye(
    project: Path, environ: Mapping[str, str], device: str | None = None
) -> tuple[Eye | None, list[Diagnostic]]:
    """The camera to look through: ``device``, else the one of the step perceive, else the best; changes nothing.

    None with the diagnostics where the project does not compile, is not applied, or has no camera ``device``.
    """
    compiled, found = compile_project(project, environ)
    if compiled is None:
        return None, found
    artifacts, missing = artifacts_there(compiled, _STAGES, _STAGES)
    problem = foreign(compiled.layout) or missing
    if problem is not None:
        return None, [*found, problem]
    eye, more = _chosen(compiled, artifacts, device)
    return eye, [*found, *more]


def look(eye: Eye, person: Person | None = None, clock: Clock | None = None, take: Take = take) -> Look:
    """Take one picture and note it, or note why there is none. The endpoint is started if need be.

    Where the camera gave the same picture again, a few more are taken at once: they show whether it is frozen.
    """
    clock = clock or Clock()
    seen = _look(eye, person, clock, take)
    for _ in range(FROZEN_PICTURES):
        if not seen.suspected:
            break
        clock.sleep(REPEAT_SECONDS)
        seen = _look(eye, person, clock, take)
    return seen


def _look(eye: Eye, person: Person | None, clock: Clock, take: Take) -> Look:
    outcome: Taken | Diagnostic
    if eye.camera is None:
        outcome = eye.blind or error("PERCEPTION-NO-CAMERA", "there is no camera")
    else:
        outcome = take(eye.layout, ToolCall(eye.camera.tool, eye.camera.arguments), person)
    at = clock.stamp()
    record, found = keep(eye.layout, eye.camera.model_dump() if eye.camera else {}, outcome, at)
    return Look(at, eye.camera, outcome, record, tuple(found))


def heartbeat(
    eye: Eye, seconds: float, person: Person | None = None, clock: Clock | None = None, take: Take = take
) -> Iterator[Look]:
    """A look now and every so many seconds from then on, without an end; a look that took longer is not made up for."""
    clock = clock or Clock()
    due = clock.monotonic()
    while True:
        yield look(eye, person, clock, take)
        missed = max(0.0, clock.monotonic() - due) // seconds
        due += (missed + 1) * seconds
        clock.sleep(max(0.0, due - clock.monotonic()))


def save(taken: Taken, path: Path) -> Diagnostic | None:
    """Write the picture's bytes as the tool gave them, readable by the owner alone; None when that is done."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        return refused(problem, path)
    return write_atomic(path, taken.data, 0o600)


def _chosen(
    compiled: Compiled, artifacts: Mapping[str, Mapping[str, Any]], device: str | None
) -> tuple[Eye | None, list[Diagnostic]]:
    layout, settings = compiled.layout, compiled.manifest.perception
    ledger, found = read_instances(layout)
    if has_errors(found):
        return None, found
    probe, identify, interface = (artifacts[stage] for stage in _STAGES)
    known = camera_selection.cameras(probe, identify, interface, settings.camera, ledger)
    if device is not None:
        named = next((item for item in known if item.device == device), None)
        return (Eye(layout, settings, _call(named)), []) if named else (None, [_no_such(device, known)])
    proved, found = _proved(layout)
    if proved is not None or has_errors(found):
        return (Eye(layout, settings, proved) if proved else None), found
    first = best(known)
    if first is None:
        hint = "connect a camera and run octoform apply; a tool that takes a picture answers with image content"
        blind = error("PERCEPTION-NO-CAMERA", "no tool of this host takes a picture", hint=hint)
        return Eye(layout, settings, blind=blind), []
    return Eye(layout, settings, _call(first)), [_unproved(first)]


def _call(camera: camera_selection.Camera) -> Camera:
    return Camera(device=camera.device, tool=camera.call.tool, arguments=dict(camera.call.arguments))


def _proved(layout: Layout) -> tuple[Camera | None, list[Diagnostic]]:
    """The camera of the accepted step; (None, []) where it did not run or chose none."""
    path = layout.output(PERCEIVE)
    data, problem = read_regular(path)
    if data is None:
        return None, [problem] if problem is not None else []
    value, found = parse(PERCEIVE, data, str(path))
    camera = value.get("camera") if isinstance(value, dict) else None
    if found or camera is None:
        return None, found
    try:
        return Camera.model_validate(camera), []
    except ValidationError:
        hint = "octoform apply -replace step.perceive makes it again"
        return None, [error("PERCEPTION-NO-CAMERA", "the step perceive names no camera", path=display(path), hint=hint)]


def _no_such(device: str, known: tuple[camera_selection.Camera, ...]) -> Diagnostic:
    names = [item.device for item in known]
    meant = did_you_mean(device, names)
    hint = f"did you mean {meant}?" if meant else f"cameras here: {', '.join(names) or 'none'}"
    return error("PERCEPTION-NO-CAMERA", f"{device!r} is no camera of this host", hint=hint)


def _unproved(camera: camera_selection.Camera) -> Diagnostic:
    summary = f"no step has tested which camera to use; {camera.device} was chosen"
    hint = "privileged_steps: [perceive] tests one; -device chooses another for this time"
    detail = f"it shares a hub with {', '.join(camera.hub_shared_with)}" if camera.hub_shared_with else None
    return warning("PERCEPTION-UNPROVED", summary, detail=detail, hint=hint)
