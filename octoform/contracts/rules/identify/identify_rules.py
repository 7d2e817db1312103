"""Rules for IDENTIFY: every statement about a device rests on what PROBE recorded of that very device.

A wrong name costs more than a missing one: somebody will move an arm that is a lamp. So what cannot be shown stays
unknown, visibly, with the sentence that would settle it.
"""

import operator
from collections import defaultdict

from octoform.base.escaping import display, listed
from octoform.base.shape import pointer
from octoform.contracts.device_kinds import RAW, speaks_bytes
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.name_clues import is_chip_name, is_filler, same_act, tokens
from octoform.contracts.name_words import has_digit, word_set, words
from octoform.contracts.rules import raw_line_rules
from octoform.contracts.rules.identify import (
    annotation_rules,
    answer_rules,
    channel_rules,
    fact_rules,
    name_rules,
    prose_rules,
)
from octoform.contracts.rules.identify.annotation_rules import capabilities
from octoform.contracts.rules.text_rules import in_values
from octoform.diagnostics import Diagnostic, did_you_mean, error, warning
from octoform.patterns import regex

MANY_DEVICES = 40
MANY_CAPABILITIES = 5
_EMPTY_WORDS = frozenset(
    {"", "none", "n/a", "na", "unknown", "tbd", "todo", "null", "-", "?", "some library", "library"}
)
_NO_WAY = regex(
    r"(?i)\b(?:appropriate|suitable|relevant|corresponding|unspecified|unknown)\b"
    r"|\bto be (?:determined|found|decided)\b|\bt\.?b\.?[ad]\b"
)
_STRINGS = regex(r"(?m)^(product|manufacturer|model|name|hid\[\d+\]\.name): (.*)$")
_UNBROKEN = regex(r"[0-9A-Za-z]+")
_ACTING = ("sensor", "actuator", "bidirectional")


def invented_device(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Every id is in PROBE."""
    known = _probed(artifacts)
    out = []
    for member in ("devices", "left_out"):
        for index, item in enumerate(value[member]):
            if item["id"] not in known:
                guess = did_you_mean(item["id"], list(known)[:2000])
                hint = f"did you mean {guess}?" if guess else "name only devices that PROBE lists"
                summary = f"{display(item['id'])} is not a device of PROBE"
                where = pointer(member, index, "id")
                out.append(error("IDENTIFY-INVENTED-DEVICE", summary, pointer=where, hint=hint))
    return out


def duplicate_device(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Each device is identified or omitted, once."""
    first: dict[str, str] = {}
    out = []
    for member in ("devices", "left_out"):
        for index, item in enumerate(value[member]):
            where = pointer(member, index, "id")
            before = first.setdefault(item["id"], where)
            if before != where:
                summary = f"{display(item['id'])} is at {before} already"
                hint = "put a device into devices or into left_out: into one of the two, once"
                out.append(error("IDENTIFY-DUPLICATE-DEVICE", summary, pointer=where, hint=hint))
    return out


def device_unaccounted(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """No device that PROBE lists is passed over in silence."""
    names = {item["id"] for member in ("devices", "left_out") for item in value[member]}
    silent = [name for name in _probed(artifacts) if name not in names]
    if not silent:
        return []
    summary = f"{len(silent)} of PROBE's devices are neither identified nor skipped: {listed(silent)}"
    hint = "put each of them into devices, or into left_out with a reason"
    return [error("IDENTIFY-DEVICE-UNACCOUNTED", summary, pointer="/left_out", hint=hint)]


def quote_not_verbatim(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A quote is a piece of that device's own PROBE text, or of a person's answer about it, letter by letter."""
    known = _probed(artifacts)
    out = []
    for index, device in enumerate(value["devices"]):
        source = known.get(device["id"])
        for at, evidence in enumerate(device["evidence"] if source else ()):
            quote = evidence["quote"]
            if source is None or answer_rules.is_quoted(quote, source, artifacts):
                if source is None or answer_rules.is_whole_quote(quote, source, artifacts):
                    continue
                summary = f"the quote {display(quote)} begins or ends inside of a word of {display(device['id'])}"
                hint = "quote whole words: a piece of a word names something else"
            else:
                summary = f"the quote {display(quote)} is not in PROBE's text of {display(device['id'])}"
                hint = (
                    "copy it letter by letter from that device's name or raw_descriptor; write what follows into `says`"
                )
            where = pointer("devices", index, "evidence", at, "quote")
            out.append(error("IDENTIFY-QUOTE-NOT-VERBATIM", summary, pointer=where, hint=hint))
    return out


def chip_not_product(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """``identified_as`` names the product, not the bridge chip in front of it."""
    known = _probed(artifacts)
    out = []
    for index, device in enumerate(value["devices"]):
        entry = known.get(device["id"], {})
        # What only carries others may be read where a class of the kernel speaks of it, and never through its line.
        through = bool(device["capabilities"]) and RAW.issuperset(entry.get("classes", ()))
        acts = device["category"] in _ACTING or (device["category"] == "infrastructure" and through)
        chip = is_chip_name(device["identified_as"], entry.get("raw_descriptor", ""))
        if acts and (
            chip or (not raw_line_rules.known_by_a_person(device, artifacts) and _named_by_its_chip(device, entry))
        ):
            summary = f"{display(device['identified_as'])} names a bridge, not the product behind it"
            hint = "name the product if the evidence shows it; otherwise the category is unknown, without capabilities"
            where = pointer("devices", index, "identified_as")
            out.append(error("IDENTIFY-CHIP-NOT-PRODUCT", summary, pointer=where, hint=hint))
    return out


def unknown_capability(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """An unknown device has no capability."""
    return [
        error(
            "IDENTIFY-UNKNOWN-CAPABILITY",
            f"{display(device['id'])} is unknown and has {len(device['capabilities'])} capabilities",
            pointer=pointer("devices", index, "capabilities"),
            hint="leave capabilities empty, or show by evidence what the device is",
        )
        for index, device in _unknown(value)
        if device["capabilities"]
    ]


def unknown_confidence(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """An unknown device has the confidence 0."""
    return [
        error(
            "IDENTIFY-UNKNOWN-CONFIDENCE",
            f"{display(device['id'])} is unknown with a confidence of {device['confidence']}",
            pointer=pointer("devices", index, "confidence"),
            hint="write 0.0",
        )
        for index, device in _unknown(value)
        if device["confidence"] != 0
    ]


def unknown_missing(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """An unknown device has the question whose answer would identify it."""
    return [
        error(
            "IDENTIFY-UNKNOWN-MISSING",
            f"{display(device['id'])} is unknown, and `missing` has no question about it",
            pointer=pointer("devices", index),
            hint="write into `missing` the one sentence from a person that would settle it",
        )
        for index, device in _unknown(value)
        if len(device.get("missing", "").split()) < 2
    ]


def neighbour_promoted(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A device that PROBE saw merely nearby gets no capability."""
    context = {name for name, device in _probed(artifacts).items() if device.get("context") is True}
    return [
        error(
            "IDENTIFY-NEIGHBOUR-PROMOTED",
            f"{display(device['id'])} is a neighbour on a network or radio, not a device of this host",
            pointer=pointer("devices", index, "capabilities"),
            hint="leave it out with the reason network_neighbour",
        )
        for index, device in enumerate(value["devices"])
        if device["id"] in context and device["capabilities"]
    ] + [
        error(
            "IDENTIFY-NEIGHBOUR-PROMOTED",
            f"{display(capability['name'])} of {display(device['id'])} searches what is merely near",
            pointer=pointer("devices", index, "capabilities", at),
            hint="leave the capability out: whom a port of the network belongs to no one here knows",
        )
        for index, at, device, capability in capabilities(value)
        if _searches(capability)
    ]


def _searches(capability: JsonObject) -> bool:
    """Whether a capability goes over the ports or the computers of a network."""
    if set(tokens(capability["via"])) & _SEARCHERS:
        return True
    spoken = set(tokens(capability["name"]))
    return bool(spoken & {"scan", "sweep", "enumerate"} and spoken & {"port", "ports", "subnet", "lan", "hosts"})


_SEARCHERS = frozenset({"nmap", "masscan", "zmap", "netdiscover", "arping", "aircrack", "airodump", "nikto", "hydra"})


def no_via(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A capability names the library or interface that makes it possible."""
    return [
        error(
            "IDENTIFY-NO-VIA",
            f"the capability {display(capability['name'])} does not name what it works through",
            pointer=pointer("devices", index, "capabilities", at, "via"),
            hint="name the library or the operating-system interface; without one the device is infrastructure",
        )
        for index, at, _, capability in capabilities(value)
        if capability["via"].strip().casefold() in _EMPTY_WORDS or _NO_WAY.search(capability["via"])
    ]


def profile_evidence(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A profile contributes only where its own match rule holds, as octoform evaluated it."""
    out = []
    for index, device in enumerate(value["devices"]):
        name = device.get("profile")
        where = pointer("devices", index, "profile")
        if name is None:
            if device["method"] == "profile":
                summary = f"{display(device['id'])} was identified by a profile that is not named"
                out.append(error("IDENTIFY-PROFILE-EVIDENCE", summary, pointer=pointer("devices", index)))
            continue
        facts = artifacts.profiles.get(name)
        if facts is None:
            summary = f"there is no profile {display(name)}"
            guess = did_you_mean(name, list(artifacts.profiles))
            known = f"the manifest has {listed(sorted(artifacts.profiles))}" if artifacts.profiles else "it has none"
            hint = f"did you mean {guess}?" if guess else f"name a profile of the manifest, or none; {known}"
        elif device["id"] not in facts.holds:
            summary = f"the match rule of {display(name)} does not match {display(device['id'])}"
            hint = "identify the device without the profile, or leave it unknown"
        else:
            continue
        out.append(error("IDENTIFY-PROFILE-EVIDENCE", summary, pointer=where, hint=hint))
    return out


def infrastructure_actuates(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Infrastructure may be read, never driven."""
    return [
        error(
            "IDENTIFY-INFRASTRUCTURE-ACTUATES",
            f"{display(device['id'])} is infrastructure, and {display(capability['name'])} is no read",
            pointer=pointer("devices", index, "capabilities", at, "effect"),
            hint="drop the capability, or give the device the category that it really has",
        )
        for index, at, device, capability in capabilities(value)
        if device["category"] == "infrastructure" and capability["effect"] != "read"
    ]


def duplicate_capability(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A device has a capability once, under one name; what a profile calls twice is its owner's matter."""
    out = []
    seen: dict[int, list[str]] = defaultdict(list)
    for index, at, device, capability in capabilities(value):
        name = capability["name"]
        same = operator.eq if "profile" in device else same_act
        before = next((each for each in seen[index] if same(each, name)), "")
        if before:
            summary = f"{display(device['id'])} has the capability {display(name)} twice"
            summary += f", as {display(before)}" if before != name else ""
            where = pointer("devices", index, "capabilities", at, "name")
            hint = "merge the two, or name them apart"
            out.append(error("IDENTIFY-DUPLICATE-CAPABILITY", summary, pointer=where, hint=hint))
        seen[index].append(name)
    return out


def effect_conflict(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """One capability name has one effect on all devices, since it becomes one tool."""
    first: dict[str, tuple[str, str]] = {}
    out = []
    for index, at, device, capability in capabilities(value):
        effect, owner = first.setdefault(capability["name"], (capability["effect"], device["id"]))
        if effect != capability["effect"]:
            summary = f"{display(capability['name'])} is {capability['effect']} here and {effect} on {display(owner)}"
            where = pointer("devices", index, "capabilities", at, "effect")
            hint = "give capabilities with different effects different names"
            out.append(error("IDENTIFY-EFFECT-CONFLICT", summary, pointer=where, hint=hint))
    return out


def many_devices(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """So many devices with capabilities are rarely all meant for an agent."""
    able = sum(1 for device in value["devices"] if device["capabilities"])
    if able <= MANY_DEVICES:
        return []
    summary = f"{able} devices have capabilities, more than an agent can choose from"
    hint = "leave out what no one would ask an agent to use"
    return [warning("IDENTIFY-MANY-DEVICES", summary, pointer="/devices", hint=hint)]


def many_capabilities(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Above five, some are mostly one ability under several names; a profile's commands are what they are."""
    out = []
    for index, device in enumerate(value["devices"]):
        count = len(device["capabilities"])
        if count > MANY_CAPABILITIES and device["method"] != "profile":
            summary = f"{device['id']} has {count} capabilities; two to five serve a device of consequence"
            hint = "make one of those that differ in a channel, a direction or a unit: these are parameters"
            where = f"/devices/{index}/capabilities"
            out.append(warning("IDENTIFY-MANY-CAPABILITIES", summary, pointer=where, hint=hint))
    return out


RULES = (
    Rule("IDENTIFY-INVENTED-DEVICE", invented_device),
    Rule("IDENTIFY-DUPLICATE-DEVICE", duplicate_device),
    Rule("IDENTIFY-DEVICE-UNACCOUNTED", device_unaccounted),
    Rule("IDENTIFY-QUOTE-NOT-VERBATIM", quote_not_verbatim),
    *name_rules.RULES,
    Rule("IDENTIFY-CHIP-NOT-PRODUCT", chip_not_product),
    Rule("IDENTIFY-UNKNOWN-CAPABILITY", unknown_capability),
    Rule("IDENTIFY-UNKNOWN-CONFIDENCE", unknown_confidence),
    Rule("IDENTIFY-UNKNOWN-MISSING", unknown_missing),
    Rule("IDENTIFY-NEIGHBOUR-PROMOTED", neighbour_promoted),
    Rule("IDENTIFY-NO-VIA", no_via),
    Rule("IDENTIFY-PROFILE-EVIDENCE", profile_evidence),
    Rule("IDENTIFY-INFRASTRUCTURE-ACTUATES", infrastructure_actuates),
    Rule("IDENTIFY-DUPLICATE-CAPABILITY", duplicate_capability),
    Rule("IDENTIFY-EFFECT-CONFLICT", effect_conflict),
    Rule("IDENTIFY-MANY-DEVICES", many_devices),
    Rule("IDENTIFY-MANY-CAPABILITIES", many_capabilities),
    *answer_rules.RULES,
    *raw_line_rules.IDENTIFY_STOPS,
    *annotation_rules.CAPABILITY_RULES,
    *raw_line_rules.RULES,
    *annotation_rules.RULES,
    *fact_rules.RULES,
    *channel_rules.RULES,
    *prose_rules.RULES,
    Rule("IDENTIFY-UNESCAPED-TEXT", in_values("IDENTIFY-UNESCAPED-TEXT")),
)


def _named_by_its_chip(device: JsonObject, entry: JsonObject) -> bool:
    """Whether a name at a raw line is that of its driver, or of a string that itself names a bridge."""
    if not speaks_bytes(entry) or "tty" not in entry.get("classes", ()):
        return False
    raw = str(entry.get("raw_descriptor", ""))
    wires = [text for key, text in _STRINGS.findall(raw) if key != "manufacturer" and is_chip_name(text, raw)]
    others = [text for _, text in _STRINGS.findall(raw) if text not in wires]
    chips = word_set([*entry.get("drivers", ()), *wires]) - word_set(others)
    name = device["identified_as"]
    named = {word.casefold() for word in words(name)}
    # "I2C" is spelt as two words, of which neither is a chip.
    wiring = {part.casefold() for word in _UNBROKEN.findall(name) if is_filler(word.casefold()) for part in words(word)}
    return any(has_digit(word) and word in chips and not is_filler(word) for word in named - wiring)


def _probed(artifacts: Artifacts) -> dict[str, JsonObject]:
    return {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}


def _unknown(value: JsonObject) -> list[tuple[int, JsonObject]]:
    return [(index, item) for index, item in enumerate(value["devices"]) if item["category"] == "unknown"]
