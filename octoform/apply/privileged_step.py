"""A privileged step: for the one device that the evidence matches, an agent reports what to try; octoform tries it.

A step runs for a device that IDENTIFY identified with the step's profile and for which that profile holds by octoform's
own evaluation. Without such a device nothing runs at all. With several of them no one could say which one a tool
would move, so the step is refused and names them.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from octoform import events
from octoform.apply.camera_trial import by_frame, by_view
from octoform.apply.context import Context
from octoform.apply.reading_trial import Bench, Tried, by_reading
from octoform.apply.rewrite import promotion
from octoform.apply.rewrite.scope import beyond, others, own_tools
from octoform.apply.stage.acceptance import Finished, Verdict, artifacts, digest_of, display, fresh, read_value
from octoform.apply.stage.artifact_writer import counted, text_of
from octoform.apply.stage.assignment import Assignment, Judge, Prove, of_stage
from octoform.apply.stage.attempt_loop import fulfil
from octoform.apply.stage.secret_scan import leaked
from octoform.apply.trial_tools import Hand, LiveHand
from octoform.base.files import read_plain
from octoform.base.shape import pointer
from octoform.contracts.artifact_parser import MAX_SOURCE_BYTES, parse
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts, StepFacts, corroborated
from octoform.diagnostics import Diagnostic, error, has_errors, warning
from octoform.harness.port import Task, Usage
from octoform.perception.camera_selection import Camera, best, cameras
from octoform.protocol.model import FRAME, READING, Step
from octoform.records import dataclass, replace
from octoform.state.artifact_cache import read_instances
from octoform.state.files import write_atomic

# The gate of a privileged step: its artifact, a server that it rewrote, and then the hardware tests.
#
# Cheap judgement comes first: schema and rules, then the rewritten server as text, its import, the endpoint with it.
# Only what passes all of that may move anything.

SERVER = "server.py"
TRIALS = "trials.json"
PICTURES = "pictures"


@dataclass(frozen=True, slots=True)
class Proposal:
    """An agent's proposal: the artifact, and the text of the server where it rewrote that."""

    value: dict[str, Any]
    server: str | None


def judge_of(known: Artifacts) -> Judge:
    """The judge of a step's output: all that needs nothing but values and text."""

    def judge(context: Context, task: Task, data: bytes) -> tuple[Any, list[Diagnostic]]:
        value: Any
        value, found = read_value(task, data)
        if value is None:
            return None, found
        found += check(task.stage, value, known, context.schemas, display(task.output))
        if has_errors(found) or value["server"] is None:
            return Proposal(value, None), found
        text, more = _rewritten(context, task, known, value)
        return Proposal(value, text), found + more

    return judge


def prove_of(step: Step, known: Artifacts, hand: Callable[[Context], Hand] | None = None) -> Prove:
    """The proof of a step: the tests, through the live endpoint unless a test gives another hand."""

    def prove(context: Context, task: Task, proposal: Proposal, found: list[Diagnostic]) -> Verdict:
        if proposal.server is not None:
            found = [*found, *promotion.offer(context, task, proposal.server)]
        if has_errors(found):
            return Verdict((*found, *promotion.put_back(context)))
        tools = {tool["name"]: tool for tool in (known.interface or {"tools": []})["tools"]}
        means = hand(context) if hand is not None else LiveHand(context.layout)
        bench = Bench(step.proof, means, tools, context.clock, fresh(task.workdir / PICTURES))
        tried = list(carried_out(context, step, bench, proposal.value))
        problem = write_atomic(
            task.workdir / TRIALS, text_of({"format": 1, "trials": [one.to_document() for one in tried]})
        )
        found = [*found, *([problem] if problem is not None else []), *(item for one in tried for item in one.found)]
        if has_errors(found):
            return Verdict((*found, *promotion.put_back(context)))
        return _accepted(context, step, proposal, tried, found)

    return prove


def carried_out(context: Context, step: Step, bench: Bench, value: Mapping[str, Any]) -> Iterator[Tried]:
    """Each test in turn; ends where no further one makes sense."""
    if value["camera"] is not None:
        context.emit(events.Checking(step.node, f"looking through {value['camera']['device']}"))
        one = by_frame(bench, value["camera"])
        context.emit(events.StepTried(step.node, one.unit, not has_errors(one.found), describe(step, one)))
        yield one
        return
    way = by_reading if step.proof.kind == READING else by_view
    for index, trial in enumerate(value["trials"]):
        context.emit(events.Checking(step.node, f"moving {trial['unit']} with {trial['move']['tool']}, and back"))
        one = way(bench, trial, pointer("trials", index))
        if one.over and not has_errors(one.found):
            hint = "the emergency stop was given, or the endpoint went away, while the units were tried; apply again"
            one.blame(
                "STEP-CALL-REFUSED",
                "the hardware tests ended early: the endpoint accepts no call now",
                pointer("trials", index),
                hint=hint,
            )
        context.emit(events.StepTried(step.node, one.unit, not has_errors(one.found), describe(step, one)))
        yield one
        if one.over:
            return


def describe(step: Step, tried: Tried) -> str:
    """The result of a test, on one line: the readings, the differences of the pictures, or why there is nothing."""
    if has_errors(tried.found):
        return next(item.summary for item in tried.found if item.severity == "error")
    if tried.moved is not None and tried.returned is not None:
        seen = f"the picture differs by {tried.moved:g} after the move, by {tried.returned:g} after the way back"
        return f"{seen}, by {tried.noise or 0:g} while nothing moves"
    if tried.before is not None and tried.after is not None and tried.back is not None:
        return f"{tried.before:g} -> {tried.after:g} -> {tried.back:g} {step.proof.unit}".rstrip()
    return f"{tried.tool} shows something"


def _rewritten(
    context: Context, task: Task, known: Artifacts, value: Mapping[str, Any]
) -> tuple[str | None, list[Diagnostic]]:
    """The rewritten server, or what is wrong with it; None when it is the accepted one, byte for byte."""
    path = display(task.workdir / SERVER)
    data = read_plain(task.workdir / SERVER, MAX_SOURCE_BYTES + 1)
    if data is None:
        return None, [error("ARTIFACT-LINK", "the rewritten server is not a separate plain file", path=path)]
    text, found = parse("serve", data, path)
    if not isinstance(text, str) or text == known.serve:
        return None, found
    found += leaked(replace(task, stage="serve"), data)
    found += check("serve", text, known, context.schemas, SERVER)
    if has_errors(found):
        return None, found
    device = value["device"] or (value["camera"] or {}).get("device", "")
    deploy = known.deploy or {"imports": []}
    interface = known.interface or {"tools": []}
    found += beyond(str(known.serve), text, own_tools(interface, device), deploy, others(interface, device))
    found += check("deploy", deploy, replace(known, serve=text), context.schemas)
    return text, found


def _accepted(context: Context, step: Step, proposal: Proposal, tried: list[Tried], found: list[Diagnostic]) -> Verdict:
    value = proposal.value
    text = counted(len(value["trials"]), "unit") + " moved" if value["trials"] else f"camera {tried[0].unit}"
    text += f", {len(value['skipped'])} skipped" if value["skipped"] else ""
    text += ", with a rewritten server" if proposal.server is not None else ""
    trials = [{name: part for name, part in one.to_document().items() if name != "readings"} for one in tried]
    return Verdict(
        diagnostics=tuple(found),
        value=value,
        digest=digest_of(context, step.node, value),
        files={"output.json": text_of(value)},
        found=text,
        detail={"device": value["device"] or tried[0].unit, "trials": trials, "skipped_units": value["skipped"]},
        rewritten=proposal.server,
    )


@dataclass(frozen=True, slots=True)
class Ground:
    """The preconditions of a step: its facts for the rules, the one device (None where nothing moves), the cameras.

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
    found = promotion.put_back(context)
    if has_errors(found):
        return Finished(Verdict(tuple(found)), 0, Usage(), context.clock.monotonic() - started)
    try:
        return fulfil(context, _assignment(context, ground))
    except BaseException:
        # The proof is no longer awaited: what was only being tried is not left in service.
        promotion.put_back(context)
        raise


def _ground(context: Context, step: Step) -> tuple[Ground, Diagnostic | None]:
    """The step's preconditions, and why it does not run: a warning skips it, an error refuses it."""
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
        return _uncorroborated(step, f"no device of this host is matched by the profile {step.profile}")
    if len(devices) > 1:
        return error(
            "STEP-SEVERAL-DEVICES",
            f"the step {step.name} is for one device, and the profile {step.profile} matches {', '.join(devices)}",
            hint="unplug all but one, or give each a profile with different evidence, and a step",
        )
    if not _tools_of(ground):
        return _uncorroborated(step, f"{devices[0]} has no tool")
    return None


def _uncorroborated(step: Step, reason: str) -> Diagnostic:
    hint = "octoform profile check shows the missing evidence; a step may stay listed without its hardware"
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
        seeing = {camera.call.tool for camera in ground.cameras}
        return [tool for tool in interface["tools"] if tool["name"] in seeing]
    return [tool for tool in interface["tools"] if ground.device is None or ground.device in tool["devices"]]


def _assignment(context: Context, ground: Ground) -> Assignment:
    step, node, server = ground.step, ground.step.node, str(ground.known.serve)
    own = of_stage(context, node)
    return replace(
        own,
        given=json.dumps(_input(ground), indent=1, ensure_ascii=False).encode() + b"\n",
        beside={**own.beside, SERVER: server.encode()},
        profiles=() if step.profile is None else (step.profile,),
        judge=judge_of(ground.known),
        prove=prove_of(step, ground.known),
    )


def _input(ground: Ground) -> dict[str, Any]:
    """The agent's input file."""
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
