"""Observe: state, artifacts, hardware and the live side as the plain values that the plan compares. (Heavy.)"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import octoform
from octoform import host
from octoform.apply.stage.acceptance import offered
from octoform.base import digest, files
from octoform.base.shape import fits
from octoform.contracts.artifact_parser import parse
from octoform.contracts.canonical import schema_path
from octoform.contracts.contract_check import check, has_shape
from octoform.contracts.model import Artifacts, ProfileFacts, StepFacts, corroborated
from octoform.diagnostics import Diagnostic, Severity, error
from octoform.endpoint.drift import observe as observe_endpoint
from octoform.engine.plan.configuration import Compiled
from octoform.perception.camera_selection import Camera, best, cameras
from octoform.plan.diff import Observed, Prior
from octoform.profiles import Profile, commands, definition, devices_of
from octoform.protocol import DUTIES, Step
from octoform.records import dataclass, replace
from octoform.state.accepted import observe as observe_files
from octoform.state.artifact_cache import read_instances
from octoform.state.files import display, read_regular
from octoform.state.layout import STAGES, Layout
from octoform.state.model import NodeState, Snapshot

# What the contract of a privileged step is held to, from the step, the accepted artifacts and the profiles. Pure.


def facts_of(
    step: Step, artifacts: Artifacts, profiles: Iterable[Profile], cameras: tuple[Camera, ...] = ()
) -> StepFacts:
    """``artifacts`` has IDENTIFY and the facts of the profiles; ``cameras`` are those of the host."""
    profile = next((item for item in profiles if item.name == step.profile), None)
    chosen = best(cameras)
    return StepFacts(
        name=step.name,
        kind=step.proof.kind,
        minimum=step.proof.minimum,
        devices=corroborated(step.profile, artifacts) if step.profile is not None else (),
        needs_profile=step.profile is not None,
        disabled=dict(profile.rig.disabled) if profile is not None else {},
        cameras=tuple(item.to_json() for item in cameras),
        best=chosen.device if chosen is not None else None,
    )


MAX_NAMED = 40  # a device has a line for each of its parts; the view makes one of them


@dataclass(frozen=True, slots=True)
class Situation:
    """The prior and the observed side of one host."""

    prior: Mapping[str, Prior]
    observed: Observed
    fingerprint: host.Fingerprint
    contract: str
    artifacts: Mapping[str, Any]


def look(compiled: Compiled, snapshot: Snapshot, environ: Mapping[str, str]) -> Situation:
    """Everything that a plan compares; reads only."""
    layout = compiled.layout
    files = observe_files(layout)
    fingerprint = host.fingerprint(host.root_from_environment(environ))
    contract = contract_digest(compiled.schemas)
    found = {stage: facts.digest for stage, facts in files.items()}
    artifacts = read_artifacts(compiled, snapshot, found)
    observed = Observed(
        fingerprint=fingerprint.digest,
        files=found,
        links=frozenset(stage for stage, facts in files.items() if facts.is_link),
        contract=_complaints(compiled, snapshot, artifacts, contract),
        endpoint=tuple(observe_endpoint(layout).reasons) if "endpoint" in snapshot.nodes else (),
        hardware=_hardware(layout, fingerprint),
        instances_gone=not layout.instances.is_file(),
    )
    prior = {name: _prior(state) for name, state in snapshot.nodes.items()}
    return Situation(prior, observed, fingerprint, contract, artifacts)


def contract_digest(schemas: Path) -> str:
    """The digest of the rules for accepted artifacts: the schemas' bytes and the version that holds the rules."""
    duties = {schema_path(name, schemas) for name in DUTIES}  # no artifact is held to these
    texts = {path.name: digest.of_file(path) for path in sorted(schemas.glob("*.json")) if path not in duties}
    return digest.of_value({"octoform": octoform.__version__, **texts})


def _prior(state: NodeState) -> Prior:
    usage = state.usage.model_dump(exclude_none=True)
    last = {"seconds": state.seconds, "attempts": state.attempts, **usage}
    return Prior(
        state.status.value,
        state.key_parts,
        state.output_digest,
        state.file_digest,
        state.tainted,
        last,
        state.accepted_at or "",
    )


def read_artifacts(compiled: Compiled, snapshot: Snapshot, digests: Mapping[str, str | None]) -> dict[str, Any]:
    """The artifacts that can be read as values; one that cannot is represented by its digest or its absence.

    ``digests`` are those of the files as they lie there. What is not as it was accepted must have its stage's shape
    to be read at all: anyone who uses the values relies on it.
    """
    found = {}
    for stage in (*STAGES, *compiled.steps):
        path = compiled.layout.output(stage)
        if digests.get(stage) is None or not path.is_file() or path.is_symlink():
            continue
        value, _ = parse(stage, files.read(path), str(path))
        state = snapshot.nodes.get(stage)
        as_accepted = state is not None and state.file_digest == digests[stage]
        if value is not None and (as_accepted or has_shape(stage, value, compiled.schemas)):
            found[stage] = value
    return found


def artifacts_there(
    compiled: Compiled, stages: Sequence[str], needed: Sequence[str]
) -> tuple[dict[str, Mapping[str, Any]], Diagnostic | None]:
    """What lies there for the stages, empty for one without an artifact of its shape; an error where one is needed."""
    found: dict[str, Mapping[str, Any]] = {}
    for stage in stages:
        path = compiled.layout.output(stage)
        data, _ = read_regular(path)
        value = parse(stage, data, str(path))[0] if data is not None else None
        found[stage] = value if isinstance(value, dict) and has_shape(stage, value, compiled.schemas) else {}
        if not found[stage] and stage in needed:
            what = "has no accepted output yet" if data is None else "has an output that is damaged"
            hint = "run `octoform apply`"
            return found, error("ARTIFACT-MISSING", f"{stage} {what}", path=display(path), hint=hint)
    return found, None


def _complaints(compiled: Compiled, snapshot: Snapshot, artifacts: Mapping[str, Any], contract: str) -> dict[str, str]:
    """Accepted artifacts verified again where the contract has moved since; cheap, and no agent runs for it."""
    out = {}
    for stage in (*STAGES, *compiled.steps):
        state = snapshot.nodes.get(stage)
        if state is None or stage not in artifacts or state.detail.get("contract") == contract:
            continue
        errors = [item for item in verify(compiled, stage, artifacts) if item.severity is Severity.ERROR]
        if errors:
            out[stage] = f"{errors[0].code}: {errors[0].summary}"
    return out


def verify(compiled: Compiled, stage: str, artifacts: Mapping[str, Any]) -> list[Diagnostic]:
    """The contract's word on the artifact of ``stage``, which is one of ``artifacts``."""
    needed = STAGES[: STAGES.index(stage)] if stage in STAGES else STAGES
    before = {name: artifacts[name] for name in needed if name in artifacts}
    if len(before) < len(needed):
        return []  # a predecessor is gone; that is a reason of its own
    probe = artifacts.get("probe")
    manifest = compiled.manifest
    held = {item.name: devices_of(item, probe, manifest.answers) for item in compiled.profiles}
    facts = {
        item.name: ProfileFacts(item.name, held[item.name], item.limits, commands(item), item.product, definition(item))
        for item in compiled.profiles
    }
    budget = manifest.budget_for("interface").tools
    matching = offered(compiled.profiles, probe, manifest.answers)
    known = Artifacts(**before, profiles=facts, answers=manifest.answers, tools_budget=budget, offered=matching)
    step = compiled.steps.get(stage)
    if step is not None:
        known = replace(known, step=facts_of(step, known, compiled.profiles, _cameras(compiled, before)))
    return check(stage, artifacts[stage], known, compiled.schemas)


def _cameras(compiled: Compiled, artifacts: Mapping[str, Any]) -> tuple[Camera, ...]:
    hint = compiled.manifest.camera_hint().get("perception.camera")
    ledger, _ = read_instances(compiled.layout)
    return cameras(artifacts["probe"], artifacts["identify"], artifacts["interface"], hint, ledger)


def _hardware(layout: Layout, now: host.Fingerprint) -> tuple[str, ...]:
    """The devices that came and went since PROBE was accepted, as far as this machine remembers."""
    try:
        kept = files.read_json(layout.fingerprint)
    except (OSError, ValueError):
        kept = None
    if not fits(kept, {"entries": [str]}):
        return ()  # nothing is remembered; the digests alone say that it moved
    appeared, gone = host.difference(kept["entries"], now.entries)
    return (*_named("appeared", appeared), *_named("gone", gone))


def _named(word: str, entries: tuple[str, ...]) -> tuple[str, ...]:
    shown = [f"{word} {entry}" for entry in entries[:MAX_NAMED]]
    more = len(entries) - len(shown)
    return (*shown, f"{more} more {word}") if more > 0 else tuple(shown)
