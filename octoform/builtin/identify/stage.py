"""The stage: every device of PROBE is annotated or left out with a reason; the class modules judge, in one order.

The order is the meaning: the first module that claims a unit says what it is. Functions that define a product (a
camera, a printer, a network adapter) stand before functions that many products have besides (LEDs, a temperature).
"""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any

from octoform.base.id_databases import IdDatabases
from octoform.builtin.grammars import Profiles
from octoform.builtin.identify import answered, leftover, naming, profiled, refusable
from octoform.builtin.identify.classes import (
    audio,
    buses,
    cameras,
    clock,
    counters,
    display,
    force,
    gnss,
    gpio,
    hid,
    inputs,
    light,
    macos,
    network,
    office,
    power,
    security,
    sensors,
    serial,
    service,
    storage,
    words,
)
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.identity import CLASS_ONLY, NOTHING, Identity, identity
from octoform.builtin.identify.verdict import (
    BIDIRECTIONAL,
    INFRASTRUCTURE,
    READ,
    UNKNOWN,
    Capability,
    Claim,
    Evidence,
    Leave,
)
from octoform.builtin.task import Task

MAX_CAPABILITIES = 40
MAX_EVIDENCE = 6
MAX_NAME = 120
SAID = 0.6
_BOARD = frozenset(("platform", "acpi", "wmi", "i2c", "spi", "amba", "auxiliary", "hid"))
RULES: tuple[Callable[[Device], Claim | None], ...] = (
    buses.claim_hub,
    cameras.claim,
    office.claim,
    security.claim,
    words.claim_instrument,
    network.claim_bluetooth,
    network.claim,
    storage.claim,
    inputs.claim_game,
    audio.claim,
    light.claim_backlight,
    display.claim,
    service.claim,
    hid.claim,
    macos.claim,
    words.claim,
    gnss.claim,
    office.claim_phone,
    gpio.claim_breakout,
    sensors.claim_iio,
    inputs.claim,
    force.claim,
    power.claim,
    buses.claim_usb_bridge,
    serial.claim,
    counters.claim,
    gpio.claim,
    sensors.claim_hwmon,
    sensors.claim_driver,
    sensors.claim_one_wire,
    clock.claim,
    light.claim_leds,
    buses.claim_bridge,
    words.claim_plain,
    audio.claim_vendor,
    buses.claim_part,
    leftover.claim_named,
)


def run(task: Task) -> str:
    """Write the IDENTIFY artifact of the task; the summary line (``41 devices annotated, 120 left out``)."""
    artifact = identify(task.read_input(), IdDatabases(task.sysroot), task.profiles, task.answers)
    artifact = refusable.without_refused(artifact, task.refused)
    task.write(artifact)
    unknown = sum(device["category"] == UNKNOWN for device in artifact["devices"])
    return f"{len(artifact['devices'])} annotated ({unknown} unknown), {len(artifact['left_out'])} left out"


def identify(
    probe: dict[str, Any],
    databases: IdDatabases,
    profiles: Profiles = (),
    answers: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, Any]:
    """The artifact for a PROBE artifact: same input, same output. ``profiles`` are those that hold for a device."""
    devices: list[dict[str, Any]] = []
    left_out: list[dict[str, str]] = []
    mac = probe.get("platform", {}).get("os") == macos.SYSTEM
    for entry in probe["devices"]:
        device = Device(entry, databases)
        judged = answered.told(device, judge(device), answers.get(device.id, ""))
        verdict = profiled.product(device, judged, profiles)
        if isinstance(verdict, Leave):
            left_out.append({"id": device.id, "reason": verdict.reason, "detail": verdict.detail[:300]})
        else:
            verdict = refusable.accepted(device, verdict)
            devices.append(macos.without_tools(device, verdict) if mac else verdict)
    return {"format": 1, "devices": devices, "left_out": left_out}


def judge(device: Device) -> dict[str, Any] | Leave:
    """The annotation of one device, or why it is left out."""
    refused = leftover.leave_first(device)
    if refused:
        return refused
    claims = [claim for rule in RULES if (claim := rule(device))]
    if claims:
        return annotate(device, claims)
    return annotate(device, [leftover.unknown(device)]) if device.bus == "usb" else leftover.leave(device)


def annotate(device: Device, claims: list[Claim]) -> dict[str, Any]:
    """The schema's device object: kind from the first claim, capabilities from all of them."""
    first = claims[0]
    named = identity(device, first)
    if refusable.names_wires(named.name, device.raw) and not refusable.names_wires(first.noun, device.raw):
        named = Identity(first.noun, NOTHING, "kernel_class")  # its string says how it is wired; its class what it is
    named, category = _composed(device, claims, _with_drivers(device, named))
    annotation: dict[str, Any] = {
        "id": device.id,
        "identified_as": named.name[:300],
        "category": category,
        "class": first.kind,
        "confidence": _confidence(device, named, claims),
        "method": named.method,
        "evidence": _evidence((*named.evidence, *first.evidence)),
        "capabilities": [],
    }
    if first.category == UNKNOWN:
        annotation["missing"] = first.missing
    else:
        annotation["capabilities"] = [capability.as_json() for capability in _merged(claims)]
    return annotation


def _confidence(device: Device, named: Identity, claims: list[Claim]) -> float:
    """How sure the name is, once it is held against what is cited for it and against what the kernel shows."""
    shown = bool(device.classes or device.pci_class or device.interfaces)
    if named.method == "kernel_class" and not shown:
        return min(named.confidence, CLASS_ONLY)  # no class of the kernel: its bus or its driver alone says so
    if any(claim.kind == "gnss" and claim.capabilities for claim in claims) and named.method == "descriptor_strings":
        return max(named.confidence, SAID)  # the strings say what it is, whichever model
    return named.confidence if refusable.is_borne_out(named, claims[0].evidence) else min(named.confidence, CLASS_ONLY)


def _with_drivers(device: Device, named: Identity) -> Identity:
    """The name of a USB product with those of its parts in brackets that the kernel calls after their driver."""
    told = {fact.text.strip('"'): fact for fact in device.of("input", "name") if device.bus == "usb"}
    parts = [told[driver] for driver in sorted(device.drivers) if driver in told and driver not in named.name]
    name = f"{named.name} ({', '.join(fact.text for fact in parts)})"
    if not parts or len(name) > MAX_NAME:
        return named
    cited = tuple(Evidence(fact.line, "a part that is called after its driver") for fact in parts)
    return Identity(name, named.confidence, named.method, (*named.evidence, *cited))


def _composed(device: Device, claims: list[Claim], named: Identity) -> tuple[Identity, str]:
    """The name and the category of a part of the board with several functions: it is called by each of them.

    A laptop's firmware driver has hot keys, a lamp and a fan; none of them is what it is.
    """
    first = claims[0]
    if device.bus not in _BOARD or first.category in (UNKNOWN, INFRASTRUCTURE) or named.method != "kernel_class":
        return named, first.category
    others = [claim for claim in claims[1:] if claim.capabilities and claim.kind != first.kind]
    names, said = [named.name], set(naming.words(named.name))
    evidence, confidence = list(named.evidence[:1]), named.confidence
    for claim in others:
        other = identity(device, claim)
        if not said.issuperset(naming.words(other.name)) and len(", ".join([*names, other.name])) <= MAX_NAME:
            names.append(other.name)
            said.update(naming.words(other.name))
            evidence += other.evidence[:1]
            confidence = min(confidence, other.confidence)
    acts = {claim.category for claim in (first, *others)} - {INFRASTRUCTURE, UNKNOWN}
    category = first.category if len(acts) == 1 else BIDIRECTIONAL
    if len(names) == 1:
        return named, category
    return Identity(", ".join(names), confidence, named.method, tuple(evidence)), category


def _evidence(cited: Iterable[Evidence]) -> list[dict[str, str]]:
    seen: dict[str, Evidence] = {}
    for evidence in cited:
        seen.setdefault(evidence.quote, evidence)
    return [evidence.as_json() for evidence in list(seen.values())[:MAX_EVIDENCE]]


def _merged(claims: list[Claim]) -> list[Capability]:
    """Capabilities of all claims; the same one from two kernel classes becomes one with both lists of channels."""
    found: dict[str, Capability] = {}
    for claim in claims:
        for capability in claim.capabilities:
            if claims[0].category == INFRASTRUCTURE and capability.effect != READ:
                continue  # the lights of a network adapter are its driver's
            known = found.get(capability.name)
            found[capability.name] = _joined(known, capability) if known else capability
    return list(found.values())[:MAX_CAPABILITIES]


def _joined(one: Capability, other: Capability) -> Capability:
    parameters = dict(one.parameters)
    for key, value in other.parameters.items():
        held = parameters.get(key)
        parameters[key] = [*held, *value] if isinstance(held, list) and isinstance(value, list) else held or value
    return Capability(one.name, one.description, f"{one.via}; {other.via}", one.effect, parameters)
