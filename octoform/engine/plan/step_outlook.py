"""What the privileged steps would do, as far as accepted artifacts tell: they move hardware, and a plan says which."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from octoform.contracts.model import Artifacts, ProfileFacts
from octoform.contracts.stepping import corroborated
from octoform.perception.camera_selection import best, cameras
from octoform.plan.model import Action, PlannedAction, StepOutlook
from octoform.profiles import Profile, devices_of, near
from octoform.protocol import Step
from octoform.protocol.model import FRAME
from octoform.state.artifacts.cache import read_instances
from octoform.state.layout import Layout

_OF_CAMERAS = ("probe", "identify", "interface")


@dataclass(frozen=True, slots=True)
class Known:
    """What is known: artifacts by stage, the profiles and answers in force, the camera that the manifest names."""

    layout: Layout
    artifacts: Mapping[str, Any]
    profiles: Collection[Profile]
    answers: Mapping[str, str]
    camera: str | None = None


def outlooks(steps: Iterable[Step], known: Known, actions: Iterable[PlannedAction]) -> tuple[StepOutlook, ...]:
    """One for each step, in order; ``actions`` tell which of the artifacts stay as they are."""
    stay = frozenset(item.node for item in actions if item.action is Action.NOOP)
    return tuple(_outlook(step, known, stay) for step in steps)


def _outlook(step: Step, known: Known, stay: frozenset[str]) -> StepOutlook:
    devices = _devices(step, known, stay)
    found = StepOutlook(step.node, step.about, step.proof.kind, devices, step.profile)
    if devices != () or step.profile is None:
        return found
    for device, profile, word in near(known.profiles, known.artifacts["probe"], known.answers):
        if profile == step.profile:
            return StepOutlook(step.node, step.about, step.proof.kind, devices, profile, device, word)
    return found


def _devices(step: Step, known: Known, stay: frozenset[str]) -> tuple[str, ...] | None:
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


def _camera(known: Known, stay: frozenset[str]) -> tuple[str, ...] | None:
    if not all(name in stay and name in known.artifacts for name in _OF_CAMERAS):
        return None
    ledger, _ = read_instances(known.layout)
    probe, identify, interface = (known.artifacts[name] for name in _OF_CAMERAS)
    found = best(cameras(probe, identify, interface, known.camera, ledger))
    return (found.device,) if found is not None else ()
