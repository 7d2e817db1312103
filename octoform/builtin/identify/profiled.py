"""A device for which a profile of the owner holds: it is that product, and does what the profile's grammar says.

octoform itself evaluated for which devices a profile holds; the task names them. What the kernel shows of the device
stays evidence; what it can do through the kernel's own classes stays a capability where there is no grammar.
"""

from collections.abc import Mapping
from typing import Any

from octoform.builtin.grammars import Profiles, holding, parameters
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.identity import FULL
from octoform.builtin.identify.verdict import (
    ACTUATOR,
    BIDIRECTIONAL,
    INFRASTRUCTURE,
    READ,
    SENSOR,
    UNKNOWN,
    Evidence,
    Leave,
)

MOST_EVIDENCE = 6
_CLASSES = ("line_protocol", "register_bus")


def product(device: Device, judged: dict[str, Any] | Leave, profiles: Profiles) -> dict[str, Any] | Leave:
    """What the class modules judged of the device, as the profile that holds for it completes it; else unchanged."""
    profile = None if device.context else holding(profiles, device.id)
    if profile is None:
        return judged
    known = {} if isinstance(judged, Leave) else judged
    own = known.get("capabilities", []) if known.get("category") not in (None, INFRASTRUCTURE, UNKNOWN) else []
    grammar = profile.get("grammar") or {}
    spoken = [_capability(profile, command) for command in grammar.get("commands", ())]
    capabilities = spoken or own  # a description is closed: the device does what stands in it and nothing else
    return {
        "id": device.id,
        "identified_as": str(profile["product"])[:300],
        "category": _category(capabilities),
        "class": _CLASSES["registers" in grammar] if spoken else known.get("class", "profiled"),
        "confidence": FULL,
        "method": "profile",
        "evidence": _evidence(device, profile, known),
        "capabilities": capabilities,
        "profile": str(profile["name"]),
    }


def _category(capabilities: list[dict[str, Any]]) -> str:
    reads = {capability["effect"] == READ for capability in capabilities}
    return {frozenset({True}): SENSOR, frozenset({False}): ACTUATOR}.get(frozenset(reads), BIDIRECTIONAL)


def _capability(profile: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    values = parameters(profile, command)
    return {
        "name": str(command["tool"]),
        "description": str(command["about"])[:500],
        "via": _via(profile)[:200],
        "effect": str(command["effect"]),
        **({"parameters": values} if values else {}),
        **({"stops": True} if command.get("do") == "stop" else {}),
    }


def _via(profile: Mapping[str, Any]) -> str:
    if bank := profile["grammar"].get("registers"):
        return f"{bank['library']['distribution']}, with the registers of the profile {profile['name']}"
    return f"pyserial, with the line protocol of the profile {profile['name']}"


def _evidence(device: Device, profile: Mapping[str, Any], known: Mapping[str, Any]) -> list[dict[str, str]]:
    """What PROBE says of the device, first its own words; the rule itself was evaluated by octoform."""
    says = f"the evidence rule of the profile {profile['name']} holds for this device"
    facts = [fact for fact in (device.product, device.fact("manufacturer"), device.fact("product_id")) if fact]
    cited = [Evidence(fact.line, says) for fact in facts] or [device.cite_self(says)]
    quotes = {item.quote: item.as_json() for item in cited}
    for item in known.get("evidence", ()):
        quotes.setdefault(item["quote"], item)
    return list(quotes.values())[:MOST_EVIDENCE]
