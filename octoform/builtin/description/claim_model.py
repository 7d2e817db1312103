"""The values that the class modules give and the stage writes: evidence, capabilities, claims.

A `Claim` is one class module's reading of one device ("this unit holds a camera, because ..."). Several modules may
claim one unit, because a unit is a bus device and may carry several kernel classes (a drive with a temperature
sensor). The first claim in the order of the modules states what the unit is; the capabilities of all of them count.
"""

from collections.abc import Mapping
from dataclasses import field
from typing import Any

from octoform.records import dataclass

READ, ACTUATE = "read", "actuate"
SENSOR, ACTUATOR, BIDIRECTIONAL = "sensor", "actuator", "bidirectional"
INFRASTRUCTURE, UNKNOWN = "infrastructure", "unknown"


@dataclass(frozen=True, slots=True)
class Evidence:
    """A quote that stands verbatim in the device's PROBE entry, and what follows from it."""

    quote: str
    says: str = ""

    def as_json(self) -> dict[str, str]:
        """The schema's object; both texts within its bounds."""
        value = {"quote": self.quote[:500]}
        return {**value, "says": self.says[:300]} if self.says else value


@dataclass(frozen=True, slots=True)
class Capability:
    """One thing that a caller could do, through one standard interface, with what INTERFACE must know about it."""

    name: str
    description: str
    via: str
    effect: str = READ
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """The schema's object; no `parameters` when there are none."""
        value: dict[str, Any] = {
            "name": self.name,
            "description": self.description[:500],
            "via": self.via[:200],
            "effect": self.effect,
        }
        return {**value, "parameters": dict(self.parameters)} if self.parameters else value


@dataclass(frozen=True, slots=True)
class Claim:
    """One class module's reading of a unit.

    ``kind`` is the class word of the annotation, ``noun`` what the thing is called when nothing names the product.
    ``names`` are the kernel's own strings for it, best first, each with the lines it is in. ``settled`` is false
    where even the class is an inference: the annotation then stays below one half.
    """

    kind: str
    category: str
    noun: str
    evidence: tuple[Evidence, ...]
    capabilities: tuple[Capability, ...] = ()
    names: tuple[tuple[str, ...], ...] = ()
    settled: bool = True
    missing: str = ""


@dataclass(frozen=True, slots=True)
class Leave:
    """A unit that is not identified, and why; ``reason`` is one of the schema's words."""

    reason: str
    detail: str
