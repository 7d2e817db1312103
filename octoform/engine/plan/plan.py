"""Plan: compile, look, compare; nothing is written and nothing is started. (Heavy.)

What an apply would change of the endpoint's tools, where that is known: INTERFACE was accepted and is not served.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import octoform
from octoform.apply.stage.assignment import calling, unpriced
from octoform.contracts.model import Artifacts, ProfileFacts, corroborated
from octoform.diagnostics import Diagnostic, as_warning, did_you_mean, error, has_errors, warning
from octoform.endpoint.expected_tools import published
from octoform.endpoint.policy_check import doubts
from octoform.endpoint.process.record import running_beside
from octoform.engine.plan import device_knowledge
from octoform.engine.plan.configuration import Compiled, compile_project, source_files
from octoform.engine.plan.refresh import Situation, look
from octoform.engine.results import PlanResult
from octoform.graph.model import Graph
from octoform.harness import logins
from octoform.harness.containment.sandbox import kernel, missing_walls, unconfined
from octoform.manifest.model import MODEL_FREE, STEP, HarnessSpec, Manifest
from octoform.perception.camera_selection import best, cameras
from octoform.plan import model, planfile
from octoform.plan.diff import Offer, Offers, Tool, Wishes, changes, diff, with_reuse
from octoform.plan.model import Action, Cause, Change, Plan, PlannedAction, Reason, StepOutlook
from octoform.profiles import Profile, near
from octoform.profiles.selection import devices_of
from octoform.protocol import Step
from octoform.protocol.model import FRAME
from octoform.records import dataclass, field, replace
from octoform.state import reusable
from octoform.state.artifact_cache import read_instances
from octoform.state.files import foreign, read_regular, write_atomic
from octoform.state.git_repository import repository_facts
from octoform.state.layout import Layout
from octoform.state.model import Snapshot
from octoform.state.store.lock import Holder, Liveness, liveness, myself, read_holder
from octoform.state.store.store import StateStore

# Which agents of a run no sandbox will hold, or one that lacks a wall: reported before they run, and when the run ends.


def without_sandbox(manifest: Manifest, plan: Plan, environ: Mapping[str, str]) -> Iterator[Diagnostic]:
    """A warning for each reason why an agent runs without a sandbox, and for each wall that a sandbox lacks here.

    A recording and the embedded agent, which is a part of octoform, are not spoken of. Asks bubblewrap once for each
    setting, and only where an agent is called at all.
    """
    why = cache(lambda sandbox: unconfined(environ, sandbox))
    reasons: dict[str, list[str]] = {}
    for item in plan.work:
        for spec in _agents(manifest, item.node) if item.calls_agent else ():
            if spec.name not in MODEL_FREE:
                nodes = reasons.setdefault(why(spec.sandbox), [])
                nodes += [] if item.node in nodes else [item.node]
    confined = reasons.pop("", [])
    for wall in missing_walls(kernel()) if confined else ():
        yield warning(
            "HARNESS-WALL-MISSING",
            f"the sandbox of {', '.join(confined)} lacks a wall: {wall}",
            hint="octoform explain HARNESS-WALL-MISSING explains how to close it",
        )
    for reason, nodes in reasons.items():
        yield warning(
            "HARNESS-UNCONFINED",
            f"the agent of {', '.join(nodes)} runs without a sandbox: {reason}",
            hint="it may write everything that you may write; octoform explain HARNESS-UNCONFINED",
        )


def _agents(manifest: Manifest, node: str) -> Iterator[HarnessSpec]:
    settings = manifest.step if node.startswith(STEP) else manifest.stages.get(node)
    if settings is not None:
        yield settings.harness
        if settings.escalate is not None:
            yield settings.escalate.harness


# What the privileged steps would do, as far as accepted artifacts show: they move hardware, and a plan names it.

_OF_CAMERAS = ("probe", "identify", "interface")


@dataclass(frozen=True, slots=True)
class KnownInputs:
    """The known inputs: artifacts by stage, the profiles and answers in force, the camera that the manifest names."""

    layout: Layout
    artifacts: Mapping[str, Any]
    profiles: Collection[Profile]
    answers: Mapping[str, str]
    camera: str | None = None


def outlooks(steps: Iterable[Step], known: KnownInputs, actions: Iterable[PlannedAction]) -> tuple[StepOutlook, ...]:
    """One for each step, in order; ``actions`` show which of the artifacts stay as they are."""
    stay = frozenset(item.node for item in actions if item.action is Action.NOOP)
    return tuple(_outlook(step, known, stay) for step in steps)


def _outlook(step: Step, known: KnownInputs, stay: frozenset[str]) -> StepOutlook:
    devices = _devices(step, known, stay)
    found = StepOutlook(step.node, step.about, step.proof.kind, devices, step.profile)
    if devices != () or step.profile is None:
        return found
    for device, profile, word in near(known.profiles, known.artifacts["probe"], known.answers):
        if profile == step.profile:
            return StepOutlook(step.node, step.about, step.proof.kind, devices, profile, device, word)
    return found


def _devices(step: Step, known: KnownInputs, stay: frozenset[str]) -> tuple[str, ...] | None:
    """The devices whose tools a step would prove; None where that comes out only when it is applied."""
    if step.profile is None:
        return _camera(known, stay) if step.proof.kind == FRAME else None
    if "probe" not in stay or "probe" not in known.artifacts:
        return None
    profile = next(item for item in known.profiles if item.name == step.profile)
    held = devices_of(profile, known.artifacts["probe"], known.answers)
    if "identify" not in stay or "identify" not in known.artifacts:
        return tuple(sorted(held))
    facts = {step.profile: ProfileFacts(step.profile, held)}
    return corroborated(step.profile, Artifacts(identify=known.artifacts["identify"], profiles=facts))


def _camera(known: KnownInputs, stay: frozenset[str]) -> tuple[str, ...] | None:
    if not all(name in stay and name in known.artifacts for name in _OF_CAMERAS):
        return None
    ledger, _ = read_instances(known.layout)
    probe, identify, interface = (known.artifacts[name] for name in _OF_CAMERAS)
    found = best(cameras(probe, identify, interface, known.camera, ledger))
    return (found.device,) if found is not None else ()


def tool_changes(layout: Layout, artifacts: Mapping[str, Any]) -> tuple[Change, ...]:
    """Tools that are renamed, come or go; none where there is no endpoint or no accepted INTERFACE to compare."""
    offered = published(layout)
    if not offered or "interface" not in artifacts:
        return ()
    before = [Tool(name, frozenset(tool["buses"]), tool["effect"]) for name, tool in offered.items()]
    wanted = artifacts["interface"]["tools"]
    return changes(before, [Tool(tool["name"], frozenset(tool["devices"]), tool["effect"]) for tool in wanted])


@dataclass(frozen=True, slots=True)
class Request:
    """A person's request to plan or apply; ``project`` is absolute, ``reuse`` allows other hosts' outputs.

    ``tier1``: as if no person had described the hardware, without profiles and answers.
    """

    project: Path
    environ: Mapping[str, str]
    targets: tuple[str, ...] = ()
    replace: tuple[str, ...] = ()
    destroy: bool = False
    reuse: bool = True
    tier1: bool = False


@dataclass(frozen=True, slots=True)
class Outlook:
    """A plan together with all that it was made from; apply goes on from here."""

    compiled: Compiled
    snapshot: Snapshot
    situation: Situation
    plan: Plan
    diagnostics: tuple[Diagnostic, ...] = field(default=())


def make_plan(request: Request, out: Path | None = None) -> PlanResult:
    """The plan of a project folder; saved to ``out`` when that is given."""
    outlook, found = prepare(request)
    if outlook is None:
        return PlanResult(None, tuple(found))
    if not request.destroy:
        manifest, plan = outlook.compiled.manifest, outlook.plan
        found += [*unpriced(manifest, request.environ, plan), *_doubts(outlook)]
        found += map(as_warning, logins.problems(manifest, request.environ, calling(plan)))
    if has_errors(found):
        return PlanResult(None, tuple(found))
    if out is None:
        return PlanResult(outlook.plan, tuple(found))
    problem = _in_the_way(out) or write_atomic(out, save(request, outlook), 0o600)
    return PlanResult(outlook.plan, (*found, *([problem] if problem else [])), None if problem else str(out))


def _in_the_way(out: Path) -> Diagnostic | None:
    """What is in the place of a plan to be saved and would be lost; a former plan and an empty file may be."""
    data, problem = read_regular(out)
    if problem is None and (not data or planfile.is_one(data)):
        return None
    hint = "what is there stays; give the plan another name"
    return error("PLAN-NOT-A-PLAN", "the file in its place is not a saved plan", path=str(out), hint=hint)


def _doubts(outlook: Outlook) -> list[Diagnostic]:
    """The policy's rules for tools that are not there, as far as the tools are known and stay as they are."""
    artifacts = outlook.situation.artifacts
    if "interface" not in artifacts or "probe" not in artifacts or any(item.calls_agent for item in outlook.plan.work):
        return []
    answers = outlook.compiled.manifest.answers
    held = [(profile, devices_of(profile, artifacts["probe"], answers)) for profile in outlook.compiled.profiles]
    holding = [(profile, ids) for profile, ids in held if ids]
    return doubts(outlook.compiled.manifest.policy, artifacts["interface"]["tools"], holding)


def prepare(request: Request, store: StateStore | None = None) -> tuple[Outlook | None, list[Diagnostic]]:
    """Compile, open the state, look, compare. ``store`` is given by apply, which holds the lock."""
    compiled, found = compile_project(request.project, request.environ, named=not request.tier1)
    if compiled is None:
        return None, found
    if shut := foreign(compiled.layout):
        return None, [*found, shut]
    found += _unknown_nodes(compiled.graph, (*request.targets, *request.replace))
    found += [] if has_errors(found) else _outside_of_targets(compiled.graph, request)
    found += _prevented(compiled) if request.destroy else []
    if store is None:
        store, more = StateStore.open(compiled.layout)
        found += [*more, *_under_way(compiled.layout), *_beside(compiled.layout)]
    if store is None or has_errors(found):
        return None, found
    situation = look(compiled, store.snapshot, request.environ)
    if not request.destroy:
        found += device_knowledge.stray(situation.artifacts, compiled.manifest.answers)
        found += [] if request.tier1 else device_knowledge.offers(situation.artifacts, compiled)
        found += device_knowledge.unmatched(situation.artifacts, compiled)
    plan = _plan(request, compiled, store.snapshot, situation)
    found += without_sandbox(compiled.manifest, plan, request.environ)
    return Outlook(compiled, store.snapshot, situation, plan, tuple(found)), found


def _under_way(layout: Layout) -> list[Diagnostic]:
    """A plan takes no lock; it states when somebody is changing what it looks at."""
    holder = read_holder(layout)
    if not isinstance(holder, Holder) or liveness(holder.process, myself()) is Liveness.DEAD:
        return []
    summary = f"{holder.operation} is under way since {holder.created} (process {holder.process.pid})"
    hint = "what it is working on looks interrupted until it ends; plan again then"
    return [warning("PLAN-RUN-UNDER-WAY", summary, hint=hint)]


def _beside(layout: Layout) -> list[Diagnostic]:
    """Endpoints that are open, and that nothing in this plan concerns."""
    summary = "the endpoint of host {} runs, and octopus.yaml does not name that host"
    return [
        warning("PLAN-OTHER-ENDPOINT", summary.format(host), hint=f"octoform stop {host} ends it")
        for host in running_beside(layout)
    ]


def _unknown_nodes(graph: Graph, names: Iterable[str]) -> list[Diagnostic]:
    found = []
    for name in names:
        if name not in graph.names():
            near = did_you_mean(name, graph.names())
            hint = f"did you mean {near}?" if near else f"the nodes are {', '.join(graph.names())}"
            found.append(error("PLAN-UNKNOWN-NODE", f"there is no node {name!r}", hint=hint))
    return found


def _outside_of_targets(graph: Graph, request: Request) -> list[Diagnostic]:
    """Diagnostics for nodes to replace that the targets exclude: one of the two is a mistake."""
    kept_out = [name for name in request.replace if request.targets and name not in graph.upstream(request.targets)]
    summary = "-replace {} has no effect: -target {} keeps it out of this run"
    hint = "omit -target, or name the node that should be replaced"
    return [
        error("PLAN-REPLACE-OUTSIDE", summary.format(name, ", ".join(request.targets)), hint=hint) for name in kept_out
    ]


def _prevented(compiled: Compiled) -> list[Diagnostic]:
    if not compiled.manifest.lifecycle.prevent_destroy:
        return []
    summary = f"host {compiled.layout.host} cannot be destroyed: lifecycle.prevent_destroy is true"
    hint = "set it to false in the manifest first, if this host really is to go"
    return [error("PLAN-PREVENT-DESTROY", summary, path=str(compiled.manifest.path), hint=hint)]


def _plan(request: Request, compiled: Compiled, snapshot: Snapshot, situation: Situation) -> Plan:
    steps: tuple[StepOutlook, ...] = ()
    if request.destroy:
        actions = _destruction(compiled.graph, snapshot)
    else:
        actions = _construction(request, compiled, situation)
        steps = _steps(compiled, situation, actions)
        actions = _without_idle_agents(actions, steps)
    facts, _ = repository_facts(compiled.layout.project, source_files(compiled))
    targets = compiled.graph.upstream(request.targets) if request.targets else frozenset()
    known = {} if request.destroy else _known(compiled, situation)
    return Plan(
        host=compiled.layout.host,
        operation="destroy" if request.destroy else "apply",
        actions=actions,
        lineage=snapshot.lineage,
        serial=snapshot.serial,
        revision=facts.revision if facts else None,
        dirty=facts.dirty if facts else (),
        changes=() if request.destroy else (*_changes(situation), *tool_changes(compiled.layout, situation.artifacts)),
        tier1=request.tier1,
        steps=steps,
        targets=tuple(name for name in compiled.graph.names() if name in targets),
        **known,
    )


def _construction(request: Request, compiled: Compiled, situation: Situation) -> tuple[PlannedAction, ...]:
    wishes = Wishes(
        replace=frozenset(request.replace),
        targets=compiled.graph.upstream(request.targets) if request.targets else None,
        ignore=frozenset(compiled.manifest.lifecycle.ignore),
    )
    actions = diff(compiled.graph, situation.prior, situation.observed, wishes)
    if not request.reuse or not any(action.calls_agent for action in actions):
        return actions
    return with_reuse(compiled.graph, actions, situation.prior, offers(compiled.layout))


def _steps(compiled: Compiled, situation: Situation, actions: tuple[PlannedAction, ...]) -> tuple[StepOutlook, ...]:
    manifest = compiled.manifest
    known = KnownInputs(
        layout=compiled.layout,
        artifacts=situation.artifacts,
        profiles=compiled.profiles,
        answers=manifest.answers,
        camera=manifest.camera_hint().get("perception.camera"),
    )
    return outlooks(compiled.steps.values(), known, actions)


def _without_idle_agents(
    actions: tuple[PlannedAction, ...], steps: tuple[StepOutlook, ...]
) -> tuple[PlannedAction, ...]:
    """A step that is skipped asks no agent."""
    idle = {item.node for item in steps if item.skipped}
    return tuple(replace(item, calls_agent=False, calls_model=False) if item.node in idle else item for item in actions)


def offers(layout: Layout) -> Offers:
    """The accepted outputs of the repository's other hosts, as the plan compares them."""
    return {
        stage: tuple(
            Offer(one.host, one.state.key_parts, one.state.output_digest) for equal in by_key.values() for one in equal
        )
        for stage, by_key in reusable.find(layout).items()
    }


def _destruction(graph: Graph, snapshot: Snapshot) -> tuple[PlannedAction, ...]:
    """Order destruction from the end: no node is left that depends on a removed one."""
    reason = Reason(Cause.REQUESTED, text="destroy")
    order = [*(name for name in snapshot.nodes if name not in graph.names()), *reversed(graph.names())]
    names = [name for name in order if name in snapshot.nodes]
    return tuple(PlannedAction(name, Action.DESTROY, certain=True, reasons=(reason,)) for name in names)


def _changes(situation: Situation) -> tuple[Change, ...]:
    """Hardware that came or went, as the kernel announces it: all that is known before PROBE runs."""
    words = {"appeared": Action.CREATE, "gone": Action.DESTROY}
    out = []
    for text in situation.observed.hardware:
        word, _, entry = text.partition(" ")
        if word in words:
            out.append(Change("hardware", entry, words[word]))
    return tuple(out)


def _known(compiled: Compiled, situation: Situation) -> dict[str, Any]:
    """The plan's facts of the devices themselves, by its fields."""
    answers, profiles, artifacts = compiled.manifest.answers, compiled.profiles, situation.artifacts
    return {
        "questions": device_knowledge.questions(artifacts, answers),
        "devices": device_knowledge.devices(artifacts, profiles, situation.prior),
        "profiles": device_knowledge.profile_uses(artifacts, profiles, answers, situation.prior),
        "near": device_knowledge.near_profiles(artifacts, profiles, answers),
    }


def save(request: Request, outlook: Outlook) -> bytes:
    """The plan file of an outlook."""
    situation, plan = outlook.situation, outlook.plan
    document = planfile.PlanFile(
        octoform=octoform.__version__,
        host=plan.host,
        lineage=plan.lineage if outlook.snapshot.nodes else None,
        targets=list(request.targets) or None,
        replace=list(request.replace),
        reuse=request.reuse,
        tier1=request.tier1,
        units=planfile.units(outlook.compiled.graph, plan, situation.prior, situation.observed),
        plan=model.to_json(plan),
    )
    return document.model_dump_json(indent=1).encode() + b"\n"
