"""What the rules of a privileged step are held to: its proof, the devices that it may move, the cameras there are."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol


class Holding(Protocol):
    """Facts of a profile: for which devices its evidence rule holds."""

    @property
    def holds(self) -> frozenset[str]:
        """Ids of PROBE devices."""


class Known(Protocol):
    """What says for which devices a step may run: IDENTIFY's artifact, and the profiles' facts by their names."""

    @property
    def identify(self) -> Mapping[str, Any] | None:
        """The accepted artifact."""

    @property
    def profiles(self) -> Mapping[str, Holding]:
        """The facts of each profile."""


@dataclass(frozen=True, slots=True)
class StepFacts:
    """One step as octoform knows it before the agent has said anything.

    ``kind`` and ``minimum`` are those of its proof. ``devices`` are the ones that it may run for, see `corroborated`
    (with ``needs_profile`` False: any annotated device). ``disabled`` are the units that the profile switches off, with
    their reasons. ``cameras`` are as the step's input has them, ``best`` the device of the one that should be chosen.
    """

    name: str
    kind: str
    minimum: float
    devices: tuple[str, ...] = ()
    needs_profile: bool = True
    disabled: Mapping[str, str] = field(default_factory=dict)
    cameras: tuple[Mapping[str, Any], ...] = ()
    best: str | None = None

    @property
    def idle(self) -> bool:
        """True where there is nothing to do the step with: it is skipped, and its artifact claims nothing."""
        if self.kind == "frame":
            return not self.cameras
        return self.needs_profile and not self.devices


def corroborated(profile: str, artifacts: Known) -> tuple[str, ...]:
    """The devices that a step may run for which needs that profile, in IDENTIFY's order.

    IDENTIFY annotated them with it, and its evidence rule holds for them: neither alone is enough.
    """
    facts = artifacts.profiles.get(profile)
    devices = artifacts.identify["devices"] if artifacts.identify is not None else ()
    holds = facts.holds if facts is not None else frozenset[str]()
    return tuple(item["id"] for item in devices if item.get("profile") == profile and item["id"] in holds)
