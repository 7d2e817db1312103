"""A privileged step: for the one device that the evidence corroborates, an agent says what to try; octoform tries it.

A step runs for a device that IDENTIFY annotated with the step's profile and for which that profile holds by octoform's
own evaluation. Without such a device nothing runs at all. With several of them nobody could say which one a tool
would move, so the step is refused and names them.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from octoform.apply import adopting, step_proof
from octoform.apply.assignment import Assignment, of_stage
from octoform.apply.context import Context
from octoform.apply.gate import Verdict, artifacts, digest_of
from octoform.apply.result import Finished
from octoform.apply.settling import text_of
from octoform.apply.stage import fulfil
from octoform.contracts.model import Artifacts
from octoform.contracts.stepping import StepFacts, corroborated
from octoform.diagnostics import Diagnostic, error, has_errors, warning
from octoform.harness.port import Usage
from octoform.perception.camera_selection import Camera, best, cameras
from octoform.protocol.steps import FRAME, Step
from octoform.state.artifacts.instances import read_instances

SERVER = "server.py"


@dataclass(frozen=True, slots=True)
class Ground:
    """What a step stands on: its facts for the rules, the one device (None where nothing moves), what there is to see.

    ``known`` are the accepted artifacts.
    """

    step: Step
    known: Artifacts
    device: str | None
    cameras: tuple[Camera, ...]


def run_step(context: Context, node: str) -> Finished:
    """Run the step's agent and carry out what it wants tried, or skip it; never raises for what an agent does."""
    started = context.clock.monotonic()
    step = context.steps[node]
    ground, problem = _ground(context, step)
    if problem is not None:
        skipped = problem.severity != "error"
        verdict = _skipped(context, step, problem) if skipped else Verdict((problem,))
        return Finished(verdict, 0, Usage(), context.clock.monotonic() - started)
    # A killed run may have left another server in service than the one that is to be proved.
    found = adopting.put_back(context)
    if has_errors(found):
        return Finished(Verdict(tuple(found)), 0, Usage(), context.clock.monotonic() - started)
    try:
        return fulfil(context, _assignment(context, ground))
    except BaseException:
        # Nobody waits for the proof any more: what was only being tried is not left in service.
        adopting.put_back(context)
        raise


def _ground(context: Context, step: Step) -> tuple[Ground, Diagnostic | None]:
    """What the step stands on, and why it does not run on it: a warning skips it, an error refuses it."""
    known = artifacts(context, step.node, None)
    ledger, _ = read_instances(context.layout)
    hint = context.manifest.camera_hint().get("perception.camera")
    seen = cameras(known.probe or {}, known.identify or {}, known.interface or {}, hint, ledger)
    devices = corroborated(step.profile, known) if step.profile is not None else ()
    facts = StepFacts(
        name=step.name,
        kind=step.proof.kind,
        minimum=step.proof.minimum,
        devices=devices,
        needs_profile=step.profile is not None,
        disabled=_disabled(context, step),
        cameras=tuple(camera.to_json() for camera in seen),
        best=chosen.device if (chosen := best(seen)) is not None else None,
    )
    device = devices[0] if devices else None
    ground = Ground(step, replace(known, step=facts), device, seen)
    return ground, _objection(ground, devices)


def _objection(ground: Ground, devices: tuple[str, ...]) -> Diagnostic | None:
    step = ground.step
    if step.proof.kind == FRAME:
        return None if ground.cameras else _uncorroborated(step, "no tool of this host takes a picture")
    if step.profile is None:
        return None
    if not devices:
        return _uncorroborated(step, f"no device of this host is corroborated by the profile {step.profile}")
    if len(devices) > 1:
        return error(
            "STEP-SEVERAL-DEVICES",
            f"the step {step.name} is for one device, and the profile {step.profile} holds for {', '.join(devices)}",
            hint="unplug all but one, or give each its own profile, whose evidence tells it from the other, and a step",
        )
    if not _tools_of(ground):
        return _uncorroborated(step, f"{devices[0]} has no tool")
    return None


def _uncorroborated(step: Step, reason: str) -> Diagnostic:
    hint = "octoform profile check tells which evidence is missing; a step may stay listed without its hardware"
    return warning("STEP-NOT-CORROBORATED", f"the step {step.name} is skipped: {reason}", hint=hint)


def _skipped(context: Context, step: Step, why: Diagnostic) -> Verdict:
    """The accepted outcome of a step that has nothing to prove: no agent ran, and nothing is claimed."""
    value = {"format": 1, "step": step.name, "device": None, "server": None}
    value |= {"trials": [], "skipped": [], "camera": None}
    reason = why.summary.partition(": ")[2]
    return Verdict(
        (why,),
        value=value,
        digest=digest_of(context, step.node, value),
        files={"output.json": text_of(value)},
        found=f"skipped: {reason}",
        detail={"skipped": reason},
    )


def _disabled(context: Context, step: Step) -> Mapping[str, str]:
    return next((profile.rig.disabled for profile in context.profiles if profile.name == step.profile), {})


def _tools_of(ground: Ground) -> list[dict[str, Any]]:
    """The tools that the step is about: its device's, the cameras' where nothing moves, else all."""
    interface = ground.known.interface or {"tools": []}
    if ground.step.proof.kind == FRAME:
        seeing = {camera.tool for camera in ground.cameras}
        return [tool for tool in interface["tools"] if tool["name"] in seeing]
    return [tool for tool in interface["tools"] if ground.device is None or ground.device in tool["devices"]]


def _assignment(context: Context, ground: Ground) -> Assignment:
    step, node, server = ground.step, ground.step.node, str(ground.known.serve)
    return replace(
        of_stage(context, node),
        given=json.dumps(_input(ground), indent=1, ensure_ascii=False).encode() + b"\n",
        beside={SERVER: server.encode()},
        judge=step_proof.judge_of(ground.known),
        prove=step_proof.prove_of(step, ground.known),
    )


def _input(ground: Ground) -> dict[str, Any]:
    """What the agent reads beside its spec."""
    step, identify = ground.step, ground.known.identify or {"devices": []}
    proof = {"kind": step.proof.kind, "minimum": step.proof.minimum, "unit": step.proof.unit}
    return {
        "format": 1,
        "step": step.name,
        "proof": {**proof, "settle": step.proof.settle},
        "device": next((item for item in identify["devices"] if item["id"] == ground.device), None),
        "tools": _tools_of(ground),
        "cameras": [camera.to_json() for camera in ground.cameras],
        "server": SERVER,
    }
