"""What the contract of a privileged step is held to, from the step, the accepted artifacts and the profiles. Pure."""

from collections.abc import Iterable

from octoform.contracts.model import Artifacts
from octoform.contracts.stepping import StepFacts, corroborated
from octoform.perception.camera_selection import Camera, best
from octoform.profiles import Profile
from octoform.protocol import Step


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
