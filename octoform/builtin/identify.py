"""The stage: every device of PROBE is identified or omitted with a reason; the class modules judge, in one order.

The order is the meaning: the first module that claims a unit states what it is. Functions that define a product (a
camera, a printer, a network adapter) stand before functions that many products have besides (LEDs, a temperature).
"""

import re
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any

from octoform.base.id_databases import IdDatabases
from octoform.builtin import other_sources
from octoform.builtin.classes import (
    buses,
    inputs,
    macos,
    media,
    network,
    office,
    outputs,
    position,
    power,
    sensors,
    storage,
    words,
)
from octoform.builtin.description import product_names
from octoform.builtin.description.class_model import (
    ACTUATOR,
    BIDIRECTIONAL,
    INFRASTRUCTURE,
    READ,
    SENSOR,
    UNKNOWN,
    Capability,
    Claim,
    Evidence,
    Leave,
)
from octoform.builtin.description.device_evidence import Device
from octoform.builtin.description.identity import CLASS_ONLY, NOTHING, Identity, identity
from octoform.builtin.description.product_names import GENERIC
from octoform.builtin.task import Profiles, Task
from octoform.patterns import regex

# Makes a device unknown whose name the stage's contract would refuse, so that one string never ends an onboarding.
#
# The agent knows the rule from the spec, in its own terms: a name that gives only how a product is wired names no
# product. It is judged on the final annotation, whatever the source of the name: strings, a database, an answer, a
# profile.

_MISSING = "The name that it goes by shows only how it is wired; what is this device, by maker and model?"
_ASKED = "Its own strings could not be taken unchanged; what is this device, by maker and model?"
_MUTE = "It shows a line for bytes and no word of its own; what is this device, by maker and model?"
_UNTOLD = "none of its own strings could be taken unchanged"
_ACTING = (SENSOR, ACTUATOR, BIDIRECTIONAL)
_MEASURING = frozenset(("video4linux", "hwmon", "thermal", "iio", "power_supply"))
_SHINING = frozenset(("leds", "backlight"))
_PIPES = frozenset(("tty", "hid", "hidraw", "hiddev", "usb", "usb_device", "usbmisc"))
"""Classes of the kernel whose nodes carry bytes and no meaning."""
_MEANT = ("01", "06", "07", "08", "0b", "0e", "0f", "dc", "ef/05", "e0", "fe", "03/01/01", "03/01/02")
"""USB class codes that show what an interface is for (usb.org, "Defined Class Codes"); of HID the keyboard's and the
mouse's."""
_MODEM_MANAGER = "udev.ID_MM_"
_USB_VIDEO = "0e"  # USB class code of video devices, usb.org "Defined Class Codes"
_WIRES = frozenset(
    (
        *("serial", "uart", "usart", "rs232", "rs422", "rs485", "ttl", "bridge"),
        *("i2c", "smbus", "spi", "jtag", "vcp"),
    )
)
_HEADS = frozenset(("adapter", "adaptor", "converter", "bridge", "cable", "dongle", "chip"))
_FILLER = frozenset(
    (
        *("usb", "usb2", "usb3", "to", "the", "a", "an", "of", "and", "for", "port", "ports", "device", "interface"),
        *("generic", "unknown", "unidentified", "controller", "virtual", "com", "cdc", "acm", "hid", "composite"),
        *("tty", "single", "dual", "quad", "full", "high", "speed", "chipset", "ic", "board", "module", "based"),
        *("inc", "ltd", "co", "corp", "corporation", "limited", "gmbh", "international", "electronics", "technology"),
        *("technologies", "semiconductor", "semiconductors", "labs", "laboratories", "devices", "company", "vendor"),
    )
)
_PART_NUMBER = regex(r"[a-z]{0,5}\d{2,6}[a-z0-9]{0,6}")
_MAKER_LINE = regex(r"^[^:\n]*(?:manufacturer|vendor|maker)[^:\n]*:(.*)$", re.IGNORECASE | re.MULTILINE)
_APPOSITION = regex(r"\s(?:with|via|through|behind|over|using|on)\s|[(,;:]", re.IGNORECASE)
_STANDARD = regex(r"(?i)\brs[- ]?(232|422|485)\b")


def accepted(device: Device, annotation: dict[str, Any]) -> dict[str, Any]:
    """The annotation, or that of an unknown device with the reason where its name would be refused."""
    name, makers = annotation["identified_as"], [line.strip() for line in _MAKER_LINE.findall(device.raw)]
    # A maker's own words may hide that all behind them is wiring.
    bare = next((name[len(maker) :] for maker in makers if maker and name.startswith(maker)), name)
    if annotation["category"] not in _ACTING:
        return annotation
    if any(names_wires(text, device.raw) for text in (name, bare)):
        return unknown(annotation, _MISSING)
    is_noun = annotation["method"] == "kernel_class" or not product_names.model_words(name)
    return unknown(annotation, _MUTE) if is_noun and _is_mute(device) else annotation


def _is_mute(device: Device) -> bool:
    """True for a USB device of which nothing shows but a pipe: no string, usage or rule of the system states anything.

    What a vendor's own interfaces are arranged like, or a driver is called after, is no statement either.
    """
    strings = (device.product_text, *(text for text, _ in device.names("hid", "name")), device.text("name", "model"))
    labels = [word for one in device.interfaces for word in _words(one.label) if not _is_filler(word)]
    usages = [usage for fact in device.of("hid", "usages") for usage in fact.text.split(",")]
    marked = any(
        fact.key.startswith("udev.") and fact.text == "1" and not fact.key.startswith(_MODEM_MANAGER)
        for fact in device.facts
    )
    silent = all(map(product_names.says_nothing, (*strings, *labels)))
    declared = marked or not all(usage.startswith("ff") for usage in usages) or device.usb(*_MEANT) is not None
    return device.bus == "usb" and device.classes <= _PIPES and silent and not declared


def categorised(device: Device, annotation: dict[str, Any]) -> dict[str, Any]:
    """The annotation with the category that classes and effects bear out, whatever a word of its name means elsewhere.

    What is called a lamp and only gives temperatures is a sensor, and a dock with a camera in it is one too.
    """
    effects = {capability["effect"] for capability in annotation["capabilities"]}
    films = any(interface.triple[0] == _USB_VIDEO for interface in device.interfaces)
    category = annotation["category"]
    if category == ACTUATOR and effects == {"read"} and (films or device.classes & _MEASURING):
        category = SENSOR
    elif category == INFRASTRUCTURE and effects and films:
        category = SENSOR if effects == {"read"} else BIDIRECTIONAL
    elif category == SENSOR and device.classes and device.classes <= _SHINING and not device.interfaces:
        category = BIDIRECTIONAL if "read" in effects else ACTUATOR
    return {**annotation, "category": category}


def without_refused(artifact: dict[str, Any], refused: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """The artifact again, without what was refused of it: such a device is unknown, and one that was is omitted.

    Whatever rule of the contract this agent does not know costs one device, and never the host.
    """
    before = {str(entry.get("id")): entry.get("category") for entry in refused}
    kept, left_out = [], list(artifact["left_out"])
    for annotation in artifact["devices"]:
        category = before.get(annotation["id"])
        if category == UNKNOWN:
            left_out.append({"id": annotation["id"], "reason": "unknown_meaning", "detail": _UNTOLD})
        else:
            kept.append(annotation if category is None else unknown(annotation, _ASKED))
    return {**artifact, "devices": kept, "left_out": left_out}


def unknown(annotation: dict[str, Any], missing: str) -> dict[str, Any]:
    """The annotation as that of a device of which nothing is known but its name; ``missing`` is the open question."""
    kept: dict[str, Any] = {
        key: annotation[key] for key in ("id", "identified_as", "class", "evidence") if key in annotation
    }
    return {
        **kept,
        "category": UNKNOWN,
        "confidence": 0.0,
        "method": "none",
        "capabilities": [],
        "missing": missing,
    }


def is_borne_out(named: Identity, cited: Iterable[Evidence]) -> bool:
    """True when each telling word of a name is in a quote, or as a plain word in what follows from one."""
    evidence = (*named.evidence, *cited)
    quoted = {word for each in evidence for word in product_names.words(each.quote)}
    quoted |= {word for each in evidence for word in re.findall(r"[^\W_]+", each.quote.casefold())}
    names = {word for each in evidence for word in product_names.words(each.says)}
    if named.method == "id_database":
        quoted |= names
    missing = [
        word for word in re.findall(r"[^\W_]+", product_names.spread(named.name)) if not _is_class(word.casefold())
    ]
    return all(word.casefold() in quoted or (word.islower() and word.isalpha() and word in names) for word in missing)


def _is_class(word: str) -> bool:
    return word in GENERIC or word in _FILLER or word in _WIRES or word in _HEADS or len(word) < 2


def names_wires(name: str, raw: str) -> bool:
    """True for a name that states how a product is wired, or which chip wires it, and nothing of the product."""
    words = _words(_APPOSITION.split(name.strip(), maxsplit=1)[0] or name)
    if _WIRES.isdisjoint(words):
        return False
    makers = {word for line in _MAKER_LINE.findall(raw) for word in _words(line)}
    left = [word for word in words if not _is_filler(word) and word not in makers]
    return not left or (words[-1] in _HEADS and len(left) <= 1)


def _is_filler(word: str) -> bool:
    if word in _WIRES or word in _HEADS or word in _FILLER or len(word) < 2:
        return True
    return word.isdigit() or _PART_NUMBER.fullmatch(word) is not None


def _words(text: str) -> list[str]:
    return [word for word in re.split(r"[^0-9a-z]+", _STANDARD.sub(r"rs\1", text).casefold()) if word]


MAX_CAPABILITIES = 40
MAX_EVIDENCE = 6
MAX_NAME = 120
SAID = 0.6
_BOARD = frozenset(("platform", "acpi", "wmi", "i2c", "spi", "amba", "auxiliary", "hid"))
RULES: tuple[Callable[[Device], Claim | None], ...] = (
    buses.claim_hub,
    media.claim,
    office.claim,
    office.claim_security,
    words.claim_instrument,
    network.claim_bluetooth,
    network.claim,
    storage.claim,
    inputs.claim_game,
    media.claim_audio,
    outputs.claim_backlight,
    outputs.claim_display,
    office.claim_service,
    inputs.claim_hid,
    macos.claim,
    words.claim,
    position.claim,
    office.claim_phone,
    outputs.claim_breakout,
    sensors.claim_iio,
    inputs.claim,
    inputs.claim_force,
    power.claim,
    buses.claim_usb_bridge,
    network.claim_serial,
    sensors.claim_counter,
    outputs.claim_gpio,
    sensors.claim_hwmon,
    sensors.claim_driver,
    sensors.claim_one_wire,
    sensors.claim_clock,
    outputs.claim_leds,
    buses.claim_bridge,
    words.claim_plain,
    media.claim_vendor,
    buses.claim_part,
    other_sources.claim_named,
)


def run(task: Task) -> str:
    """Write the IDENTIFY artifact of the task; the summary line (``41 identified (2 unknown), 120 skipped``)."""
    artifact = identify(task.read_input(), IdDatabases(task.sysroot), task.profiles, task.answers)
    artifact = without_refused(artifact, task.refused)
    task.write(artifact)
    unknown = sum(device["category"] == UNKNOWN for device in artifact["devices"])
    return f"{len(artifact['devices'])} identified ({unknown} unknown), {len(artifact['left_out'])} skipped"


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
        judged = other_sources.completed(device, judge(device), answers.get(device.id, ""))
        verdict = other_sources.product(device, judged, profiles)
        if isinstance(verdict, Leave):
            left_out.append({"id": device.id, "reason": verdict.reason, "detail": verdict.detail[:300]})
        else:
            verdict = accepted(device, categorised(device, verdict))
            devices.append(macos.without_tools(device, verdict) if mac else verdict)
    return {"format": 1, "devices": devices, "left_out": left_out}


def judge(device: Device) -> dict[str, Any] | Leave:
    """The annotation of one device, or why it is omitted."""
    refused = other_sources.leave_first(device)
    if refused:
        return refused
    claims = [claim for rule in RULES if (claim := rule(device))]
    if claims:
        return annotate(device, claims)
    return annotate(device, [other_sources.unknown(device)]) if device.bus == "usb" else other_sources.leave(device)


def annotate(device: Device, claims: list[Claim]) -> dict[str, Any]:
    """The schema's device object: kind from the first claim, capabilities from all of them."""
    first = claims[0]
    named = identity(device, first)
    if names_wires(named.name, device.raw) and not names_wires(first.noun, device.raw):
        named = Identity(first.noun, NOTHING, "kernel_class")  # its string gives its wiring; its class what it is
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
        return min(named.confidence, CLASS_ONLY)  # no class of the kernel: only its bus or its driver shows it
    if any(claim.kind == "gnss" and claim.capabilities for claim in claims) and named.method == "descriptor_strings":
        return max(named.confidence, SAID)  # the strings say what it is, whichever model
    return named.confidence if is_borne_out(named, claims[0].evidence) else min(named.confidence, CLASS_ONLY)


def _with_drivers(device: Device, named: Identity) -> Identity:
    """The name of a USB product with those of its parts in brackets that the kernel calls after their driver."""
    fields = {fact.text.strip('"'): fact for fact in device.of("input", "name") if device.bus == "usb"}
    parts = [fields[driver] for driver in sorted(device.drivers) if driver in fields and driver not in named.name]
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
    names, found = [named.name], set(product_names.words(named.name))
    evidence, confidence = list(named.evidence[:1]), named.confidence
    for claim in others:
        other = identity(device, claim)
        if not found.issuperset(product_names.words(other.name)) and len(", ".join([*names, other.name])) <= MAX_NAME:
            names.append(other.name)
            found.update(product_names.words(other.name))
            evidence += other.evidence[:1]
            confidence = min(confidence, other.confidence)
    acts = {claim.category for claim in (first, *others)} - {INFRASTRUCTURE, UNKNOWN}
    category = first.category if len(acts) == 1 else BIDIRECTIONAL
    if len(names) == 1:
        return named, category
    return Identity(", ".join(names), confidence, named.method, tuple(evidence)), category


def _evidence(cited: Iterable[Evidence]) -> list[dict[str, str]]:
    """Each quote once, with all that follows from it: of a product string its name, and the kind by a word in it."""
    seen: dict[str, Evidence] = {}
    for evidence in cited:
        known = seen.get(evidence.quote)
        if known and evidence.says not in known.says:
            extends = evidence.says.startswith(known.says)
            says = evidence.says if extends else f"{known.says}; {evidence.says}"
            seen[evidence.quote] = Evidence(evidence.quote, says)
        elif not known:
            seen[evidence.quote] = evidence
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
