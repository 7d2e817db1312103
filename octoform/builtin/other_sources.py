"""Handles units that no class module claims: a reason for each, or an open question for a USB device.

A USB device was plugged in by someone and does something; when nothing shows what, a person is asked. Everything else
that no module claims is part of the machine.
"""

import re
from collections.abc import Mapping
from typing import Any

from octoform.builtin.classes import network, words
from octoform.builtin.description import product_names
from octoform.builtin.description.class_model import (
    ACTUATOR,
    BIDIRECTIONAL,
    INFRASTRUCTURE,
    READ,
    SENSOR,
    UNKNOWN,
    Claim,
    Evidence,
    Leave,
)
from octoform.builtin.description.device_evidence import Device
from octoform.builtin.description.identity import CLASS_ONLY, FULL, names_its_chip
from octoform.builtin.task import Profiles, holding, parameters
from octoform.patterns import regex

_ROOT_HUB = regex(r"/usb\d+$")
_PCI_BUSES = ("06", "0c", "08", "05", "0604")
_BUSES = frozenset(("pci_bus", "mdio_bus", "thunderbolt", "typec", "mei", "wmi", "nvmem", "rapidio", "memory"))
_BUSES |= {"macos-usb-controller", "macos-thunderbolt"}
_PARAVIRTUAL = "virtio-pci"
_MISSING = "What is this USB device?"


def leave_first(device: Device) -> Leave | None:
    """Units that are never identified, whatever class devices they have."""
    if device.context:
        return network.leave_context(device)
    if device.bus == "usb" and _ROOT_HUB.search(device.path):
        return Leave("bus_infrastructure", "root hub of a USB host controller")
    if _PARAVIRTUAL in device.drivers:
        return Leave("duplicate_path", "what it does is in an entry of its own, the virtio device behind it")
    return None


def leave(device: Device) -> Leave:
    """Why a unit that no module claims is omitted."""
    if device.bus == "virtual":
        return Leave("virtual", "made by the kernel; no hardware behind it")
    if device.pci_class.startswith(_PCI_BUSES) or device.bus in _BUSES:
        return Leave("bus_infrastructure", "carries other devices")
    if "tty" in device.classes:
        return Leave("unknown_meaning", "a serial port; what is connected to it is not known")
    if device.bus == "pci":
        name = product_names.join(device.database.vendor, device.database.product)
        return Leave("no_standard_interface", name or "no kernel class drives it")
    if device.bus in ("i2c", "spi", "hid", "w1"):
        return Leave("no_standard_interface", "no kernel class drives it")
    return Leave("no_function", "part of the machine; nothing to read or set through a standard interface")


def claim_named(device: Device) -> Claim | None:
    """A USB device whose own strings name a product, though nothing shows what kind of thing it is.

    What it is called is known, and that it speaks a language of its own; a profile defines what it does. A loader's or
    a reference design's string names no product, nor does that of a chip.
    """
    if device.bus != "usb" or not device.product or not device.interfaces:
        return None
    product, maker = device.product_text, device.text("manufacturer")
    named = (
        product_names.is_short(device.product.text)
        and product_names.names_a_product(product)
        and product_names.adds_to(maker, product)
        and not names_its_chip(device)
    )
    if (
        not named
        or product_names.describes_wires(product)
        or product_names.describes_chip(product)
        or product_names.makes_chips(maker)
        or product_names.speaks_of_a_part(product)
    ):
        return None
    evidence = Evidence(device.interfaces[0].line, "an interface of its own, for a program of its own")
    return Claim("vendor", BIDIRECTIONAL, "USB device", (evidence,), settled=False)


def unknown(device: Device) -> Claim:
    """A USB device of which nothing shows what it does."""
    evidence = [device.cite_self("no interface class, driver or word shows what it does")]
    found = device.product or device.fact("manufacturer", "product_id")
    if found:
        evidence = [Evidence(found.line, "names no kind of device")]
    if device.interfaces:
        evidence.append(Evidence(device.interfaces[0].line, "a vendor's own interface"))
    return Claim("unknown", UNKNOWN, "USB device", tuple(evidence), missing=_MISSING)


# A device that a person spoke of: it is what the sentence names, and does no more than the kernel's classes show.
#
# An answer supplies a name where the evidence gives none. It is no proof of an interface, so nothing becomes possible
# by it; and where the device names itself the sentence only joins the evidence. It is data: it is shortened and
# compared.

METHOD = "user_answer"
MAX_EVIDENCE = 6
_LEAD = regex(r"^(?:(?:this|it|that)(?: is|'s)\s+)?(?:(?:the|a|an|my|our)\s+)?", re.IGNORECASE)
_END = regex(r"[.;!?](?:\s|$)|\n")
_BESIDE = regex(r"\s(?:of|for|with|via|through|behind|over|using|on)\s|[(,;:]", re.IGNORECASE)
# What the wire is; a sentence that names only the wire names no product behind it.
_WIRES = frozenset(
    ("serial", "uart", "usart", "rs232", "rs422", "rs485", "ttl", "bridge", "i2c", "smbus", "spi", "jtag", "vcp")
)
_PLUGS = frozenset(("adapter", "adaptor", "converter", "bridge", "cable", "dongle", "chip"))

# The last word of a name identifies what moves: a camera's rail is a rail, whatever it carries.
_MOVERS = frozenset(
    (
        "arm",
        "rail",
        "slider",
        "gimbal",
        "gantry",
        "gripper",
        "robot",
        "turntable",
        "motor",
        "stepper",
        "servo",
        "actuator",
    )
)


def completed(device: Device, judged: dict[str, Any] | Leave, sentence: str) -> dict[str, Any] | Leave:
    """The class modules' annotation of the device, completed by a person's sentence about it; "" changes nothing."""
    if not sentence or leave_first(device) is not None:
        return judged
    known = {} if isinstance(judged, Leave) else judged
    fields = {**known, "id": device.id, "evidence": _answer_evidence(device, known, sentence)}
    if known and known["category"] != UNKNOWN:
        return fields if known["confidence"] > CLASS_ONLY else fields | _name(device, sentence)
    kind, category = _kind(sentence, str(known.get("class", "device")))
    capabilities = list(known.get("capabilities", ()))
    fields |= {**_name(device, sentence), "class": kind, "category": category, "capabilities": capabilities}
    return {name: value for name, value in fields.items() if name != "missing"}


def _name(device: Device, sentence: str) -> dict[str, Any]:
    return {"identified_as": short(sentence, device.id), "method": METHOD, "confidence": FULL}


def short(sentence: str, device: str = "") -> str:
    """The name in a sentence: its first clause without the words that only lead to it."""
    text = sentence.strip().removeprefix(f"{device}:").strip()
    text = _END.split(text, maxsplit=1)[0]
    return (
        product_names.tidy(_LEAD.sub("", text))
        or product_names.tidy(sentence)
        or sentence.strip()[: product_names.MAX_NAME]
    )


def _kind(sentence: str, known: str) -> tuple[str, str]:
    """(class, category) by the general words of the sentence; what only names a wire carries others."""
    head = product_names.words(_BESIDE.split(short(sentence), maxsplit=1)[0])
    if head and head[-1] in _MOVERS:
        return ACTUATOR, ACTUATOR
    entry = words.spoken_of(sentence)
    is_wire = not _WIRES.isdisjoint(head) and (entry is None or head[-1] in _PLUGS)
    if is_wire:
        return known, INFRASTRUCTURE
    return (entry[0], entry[1]) if entry is not None else (known, BIDIRECTIONAL)


def _answer_evidence(device: Device, known: dict[str, Any], sentence: str) -> list[dict[str, str]]:
    shown = known.get("evidence") or [device.cite_self("what the host shows of it").as_json()]
    quoted = len(re.findall(r"\w", sentence[:500])) > 1
    answer = [Evidence(sentence, "the owner's answer").as_json()] if quoted else []
    return [*answer, *shown][:MAX_EVIDENCE]


# A device for which a profile of the owner holds: it is that product, and does what the profile's protocol definition
# has.
#
# octoform itself evaluated for which devices a profile holds; the task names them. What the kernel shows of the device
# stays evidence; what it can do through the kernel's own classes stays a capability where there is no protocol
# definition.

_CLASSES = ("line_protocol", "register_bus")


def product(device: Device, judged: dict[str, Any] | Leave, profiles: Profiles) -> dict[str, Any] | Leave:
    """The class modules' annotation of the device, completed by its profile; without one unchanged."""
    profile = None if device.context else holding(profiles, device.id)
    if profile is None:
        return judged
    known = {} if isinstance(judged, Leave) else judged
    own = known.get("capabilities", []) if known.get("category") not in (None, INFRASTRUCTURE, UNKNOWN) else []
    grammar = profile.get("grammar") or {}
    spoken = [_capability(profile, command) for command in grammar.get("commands", ())]
    capabilities = spoken or own  # a description is closed: the device does what it lists and nothing else
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
    """The lines of PROBE for the device, its own strings first; the rule itself was evaluated by octoform."""
    says = f"the match rule of the profile {profile['name']} matches this device"
    facts = [fact for fact in (device.product, device.fact("manufacturer"), device.fact("product_id")) if fact]
    cited = [Evidence(fact.line, says) for fact in facts] or [device.cite_self(says)]
    quotes = {item.quote: item.as_json() for item in cited}
    for item in known.get("evidence", ()):
        quotes.setdefault(item["quote"], item)
    return list(quotes.values())[:MAX_EVIDENCE]
