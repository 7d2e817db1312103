"""Rules for IDENTIFY's facts of a device beside its name: how it was found out, what kind it is, why it is omitted.

Each of these statements can be held against what PROBE shows of the device, and is refused only where that shows the
opposite: a driver that did not bind decided nothing, and a camera of the kernel is neither unknown nor without a use.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.shape import pointer
from octoform.contracts.device_kinds import MEASURED, RAW, WAYS, is_blank, measures, speaks_bytes
from octoform.contracts.device_kinds import visible_kinds as ways_of
from octoform.contracts.model import Artifacts, JsonObject, Rule, does_stop
from octoform.contracts.name_clues import (
    changes,
    is_chip_name,
    is_passthrough,
    is_reading,
    offers_a_pipe,
    raw_facts,
    tokens,
)
from octoform.contracts.rules.identify import answer_rules
from octoform.contracts.rules.identify.name_rules import CLAIMED, PAGE
from octoform.contracts.rules.raw_line_rules import known_by_a_person
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex

# Classes of the kernel with one meaning and a standard interface, by what they have in common.
_FAMILIES = (
    frozenset({"video4linux"}),
    frozenset({"sound"}),
    frozenset({"power_supply"}),
    frozenset({"hwmon", "thermal"}),
    frozenset({"backlight"}),
    frozenset({"nvme", "block"}),
)
_EVIDENT = frozenset().union(*_FAMILIES)
# What a person would name although it is built in, and what a hand works on.
_WANTED = frozenset({"video4linux", "sound"})
_INPUT_KINDS = regex(r"(?m)^input\[\d+\]\.kinds: .*\b(?:keyboard|mouse|touchpad|touchscreen)\b")
_PRODUCT = regex(r"(?m)^(?:product|name): (.*)$")
_ATTACHED = regex(r"^/sys/devices/(?!virtual/)(?!.*/bluetooth/)")
# Drivers that bind to whatever is there; that of a hub or of a bridge identifies it.
_GENERAL_DRIVERS = frozenset({"usb", "usb-generic"})
# A code of USB or PCI for a kind of function: 00 leaves it to the interfaces, ff to the maker.
_CLASS_CODE = regex(r"(?im)class(?:_?code)?\W+(?:0x)?(?!00|ff)[0-9a-f]{2}(?![g-z])")
# Keys of lines that carry numbers, drivers and what a database has; every other line with a word is a string.
_NO_STRING = regex(
    r"(?i)(?:.*[\W_])?(?:interface\W*\d*|\w*class(?:_?code)?|drivers?|modalias|alias|module|subsystem|devtype|bus|speed"
    r"|\w+_from_database)"
)
_USB_PORT = regex(r"\d+-\d+(?:\.\d+)*")
_NUMBER = regex(r"(?:0x)?[0-9a-f]{1,8}(?:[:.,/ ]+(?:0x)?[0-9a-f]{1,8})*", re.IGNORECASE)
_UNREAL = regex(r"(?i)\b(?:qemu|virtual\w*|virtio|vmware|hyper-?v|vbox|gadget|dummy|emulated|simulated|xen|kvm)\b")
# What the firmware lists is there; LNX marks what Linux adds to its tables.
_FIRMWARE = regex(r"(?m)^modalias: (?:acpi|pnp):(?!LNX)")
_ATTRIBUTE = regex(r"(?m)^([\w-]+)\[\d+\]\.(\w+): .+$")
_NAMES = frozenset({"name", "label", "driver", "id", "role", "kinds", "events", "usages", "product", "vendor", "model"})
# Reasons that the class of a device can contradict; the others are judgements.
_DENYING = frozenset({"no_function", "no_standard_interface", "bus_infrastructure", "duplicate_path"})


def method_false(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The method that decided is one that the device has: a driver that bound, a class, an answer that is quoted."""
    probed = _probed(artifacts)
    out = []
    for index, device in enumerate(value["devices"]):
        entry = probed.get(device["id"])
        if entry is not None and device["method"] in ("kernel_class", "descriptor_driver") and not _is_linux(artifacts):
            continue  # other systems have other words for drivers and classes
        why = _without_method(device, entry, artifacts) if entry is not None else None
        if why is not None:
            summary = f"{display(device['id'])} was identified by {device['method']}, and {why[0]}"
            where = pointer("devices", index, "method")
            out.append(error("IDENTIFY-METHOD-FALSE", summary, pointer=where, hint=why[1]))
    return out


def known_called_unknown(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A device of which the kernel made something with one meaning is known, at least by its kind."""
    probed = _probed(artifacts)
    return [
        error(
            "IDENTIFY-KNOWN-CALLED-UNKNOWN",
            f"{display(device['id'])} is unknown, and PROBE shows {listed(evident)} of it",
            pointer=pointer("devices", index, "category"),
            hint="name the kind of thing that this class shows, with method kernel_class, or leave it out",
        )
        for index, device in enumerate(value["devices"])
        if device["category"] == "unknown" and (evident := _evident(probed.get(device["id"], {}), artifacts))
        # What calls itself by its wires alone may be anything behind them, whatever it measures.
        if not _is_wires(probed[device["id"]])
    ]


def reason_false(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The reason for which a device is omitted is true of it, as far as PROBE shows."""
    probed = _probed(artifacts)
    kept = [probed[device["id"]] for device in value["devices"] if device["id"] in probed]
    out = []
    for index, item in enumerate(value["left_out"]):
        entry = probed.get(item["id"], {})
        if not entry or entry in kept:
            continue  # another rule's finding
        why = _contradicted(item["reason"], entry, kept, artifacts)
        if why is not None:
            summary = f"{display(item['id'])} is skipped as {item['reason']}, and PROBE shows {why[0]}"
            where = pointer("left_out", index, "reason")
            out.append(error("IDENTIFY-REASON-FALSE", summary, pointer=where, hint=why[1]))
    return out


def capability_on_a_guess(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Below one half nothing is done through a raw line: a class of the kernel is a way for devices of any maker."""
    probed = _probed(artifacts)
    return [
        error(
            "IDENTIFY-CAPABILITY-ON-A-GUESS",
            f"{display(device['id'])} has capabilities through a raw line at a confidence of {device['confidence']}",
            pointer=pointer("devices", index, "capabilities"),
            hint=f"leave them out below 0.5; `octoform profile new {device['id']}` drafts what a person knows of it",
        )
        for index, device in enumerate(value["devices"])
        if 0 < device["confidence"] < CLAIMED and device["category"] != "unknown"
        # What has no class at all, and what is a pipe, is another rule's finding.
        if (entry := probed.get(device["id"])) and ways_of(entry) and speaks_bytes(entry)
        if not known_by_a_person(device, artifacts)
        if any(each["effect"] == "read" and not is_passthrough(each["name"]) for each in device["capabilities"])
    ]


def definition_differs(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Where a profile has a protocol definition, each command is one capability, with its effect and its stop."""
    out = []
    for index, at, profile, capability, commands in _commanded(value, artifacts):
        command, stops = commands.get(capability["name"]), capability.get("stops", False)
        where: tuple[str, ...]
        if command is None:
            summary = f"{display(capability['name'])} is no command of the profile {display(profile)}"
            where, hint = ("name",), f"its commands are {listed(list(commands), 12)}"
        elif command["effect"] != capability["effect"]:
            summary = f"{display(capability['name'])} is {capability['effect']}, "
            summary += f"and {display(profile)} declares another effect"
            where, hint = ("effect",), f"write {command['effect']}"
        elif stops is not does_stop(command):
            end = "no end of a movement" if stops else "the end of a movement"
            summary = (
                f"{display(capability['name'])} is {end} by the profile {display(profile)}, and is marked otherwise"
            )
            where = ("stops",) if "stops" in capability else ()
            hint = 'write "stops": false, or leave it out' if stops else 'write "stops": true'
        else:
            continue
        place = pointer("devices", index, "capabilities", at, *where)
        out.append(error("IDENTIFY-GRAMMAR", summary, pointer=place, hint=hint))
    for index, device in enumerate(value["devices"]):
        facts = artifacts.profiles.get(device.get("profile", ""))
        has = {capability["name"] for capability in device["capabilities"]}
        if facts is None or not has or device["id"] not in facts.holds:
            continue
        if absent := [str(command["tool"]) for command in facts.commands if command["tool"] not in has]:
            owner = f"the protocol definition of {display(facts.name)}"
            summary = f"{display(device['id'])} lacks {listed(absent)}, which {owner} has"
            place, hint = pointer("devices", index, "capabilities"), "make one capability of each command, in its name"
            out.append(error("IDENTIFY-GRAMMAR", summary, pointer=place, hint=hint))
    return out


RULES = (
    Rule("IDENTIFY-METHOD-FALSE", method_false),
    Rule("IDENTIFY-KNOWN-CALLED-UNKNOWN", known_called_unknown),
    Rule("IDENTIFY-REASON-FALSE", reason_false),
    Rule("IDENTIFY-CAPABILITY-ON-A-GUESS", capability_on_a_guess),
    Rule("IDENTIFY-GRAMMAR", definition_differs),
)


def _probed(artifacts: Artifacts) -> dict[str, JsonObject]:
    return {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}


def _is_wires(entry: JsonObject) -> bool:
    raw = str(entry["raw_descriptor"])
    if entry["interface"] == "usb" and {*entry["classes"]} <= {"hwmon", "thermal"}:
        return True  # a chip's own sensor beside a function that no class shows
    return any(is_chip_name(text, raw) for text in (entry["name"], *_PRODUCT.findall(raw)))


def _is_linux(artifacts: Artifacts) -> bool:
    return bool((artifacts.probe or {}).get("platform", {}).get("os") == "linux")


def _evident(entry: JsonObject, artifacts: Artifacts) -> list[str]:
    """The classes of a device that say what it is for; none on systems whose classes are not the kernel's of Linux."""
    if not _is_linux(artifacts) or entry.get("context"):
        return []
    alone = "sysfs" in entry.get("instance", {}) and "/virtual/" not in str(entry["instance"]["sysfs"])
    return sorted(_EVIDENT.intersection(entry.get("classes", ()))) if alone else []


def _without_method(device: JsonObject, entry: JsonObject, artifacts: Artifacts) -> tuple[str, str] | None:
    """The objection to a method, and what to write; None without one."""
    method, known = device["method"], device["confidence"] >= CLAIMED
    strings = "write descriptor_strings where its own strings decided, or the method that did"
    if method == "none" and known and device["category"] != "unknown":
        return f"its confidence is {device['confidence']}", strings
    if method == "descriptor_driver" and known and not {*entry.get("drivers", ())} - _GENERAL_DRIVERS:
        return "no driver of its own has bound", strings
    if method == "kernel_class" and known and not ways_of(entry) and not _CLASS_CODE.search(entry["raw_descriptor"]):
        return "the kernel made no class of it", strings
    if method == "descriptor_strings" and known and not _has_string(entry):
        drivers = {*entry.get("drivers", ())} - _GENERAL_DRIVERS
        other = (
            "descriptor_driver" if drivers else "kernel_class" if _CLASS_CODE.search(entry["raw_descriptor"]) else ""
        )
        return "it has no string of its own", f"write {other or 'id_database where one decided, or none'}"
    if method == "id_database" and known and not _is_registered(entry, artifacts):
        return "no database of the host has its numbers", strings
    if method == "web_search" and known and not any(PAGE.search(item.get("says", "")) for item in device["evidence"]):
        return "no evidence has the address of a page", "write it into `says`, or the method that did decide"
    if method == answer_rules.METHOD and device["id"] in artifacts.answers:
        found = answer_rules.texts(device["id"], artifacts)
        spoken = len(re.findall(r"\w", found[0])) >= 2
        verbatim = all(answer_rules.is_quoted(item["quote"], entry, artifacts) for item in device["evidence"])
        if spoken and verbatim and not any(item["quote"] in text for item in device["evidence"] for text in found):
            return "no evidence is of that answer", "quote the owner's answer beside what PROBE shows"
    return None


def _is_registered(entry: JsonObject, artifacts: Artifacts) -> bool:
    """Whether a database of the host has an entry of a device, or no one looked."""
    known = artifacts.registered is None or artifacts.registered.get(entry["id"])
    return bool(known) or "_FROM_DATABASE" in entry["raw_descriptor"]


def _has_string(entry: JsonObject) -> bool:
    """Whether a device of USB or PCI states anything of itself that is no number."""
    if entry["interface"] not in ("usb", "pci"):
        return True
    name = str(entry["name"]).removeprefix(f"{entry['interface']} ").removeprefix("device ")
    for line in (f"name: {name}", *entry["raw_descriptor"].splitlines()):
        key, _, text = line.partition(next((sign for sign in ":= " if sign in line), " "))
        if text.strip(" :") and not _NUMBER.fullmatch(text.strip(" :")) and not _NO_STRING.fullmatch(key.strip()):
            return True
    return False


def _contradicted(
    reason: str, entry: JsonObject, kept: list[JsonObject], artifacts: Artifacts
) -> tuple[str, str] | None:
    """The objection in PROBE to a reason, and what to write; None without one."""
    evident = _evident(entry, artifacts)
    annotate = "add it to devices: skip only what offers nothing or is a part of another entry"
    place = str(entry.get("instance", {}).get("sysfs", ""))
    if reason == "network_neighbour" and not entry.get("context") and _ATTACHED.search(place):
        return f"it on {entry['interface']}, without context", annotate
    twins = [other["id"] for other in kept if entry.get("vid") and _numbers(other) == _numbers(entry)]
    if reason == "duplicate_path" and twins and all(_apart(entry, other) for other in kept if other["id"] in twins):
        return f"a port of its own for it, as for its twin {twins[0]}", "add it to devices as its twin is"
    text = f"{entry['name']}\n{entry['raw_descriptor']}"
    if reason == "no_credentials" and evident and not entry.get("context") and _ATTACHED.search(place):
        return f"{listed(evident)} of it, which asks for none", annotate
    if reason == "virtual" and entry["interface"] == "usb" and not _UNREAL.search(text):
        return "it plugged into usb", annotate
    listed_there = bool(_FIRMWARE.search(entry["raw_descriptor"])) and entry["interface"] != "virtual"
    if reason == "virtual" and listed_there and "/virtual/" not in place and not _UNREAL.search(text):
        cure = "give the reason that is true of it, such as no_function, or duplicate_path of what it is an entry of"
        return "that the firmware of the computer lists it", cure
    if reason == "not_permitted" and not entry.get("context") and (read := _read_of(entry)):
        return f"{display(read)}, which was read of it", annotate
    evident += ["input"] if _INPUT_KINDS.search(text) else []
    if not evident or (reason not in _DENYING and not (reason == "out_of_scope" and _WANTED.intersection(evident))):
        return None
    if reason == "duplicate_path":
        family = next((each for each in _FAMILIES if each & set(evident)), frozenset(evident))
        near = [other for other in kept if family.intersection(other.get("classes", ())) or _together(entry, other)]
        if any(_together(entry, other) or not family <= _OF_A_UNIT or _named_alike(entry, other) for other in near):
            return None
    return f"{listed(evident)} of it", annotate


def _read_of(entry: JsonObject) -> str | None:
    """A line of PROBE that was read through a class of the kernel with a meaning, beyond names and drivers."""
    classes = {*entry.get("classes", ())} - RAW
    found = _ATTRIBUTE.finditer(entry["raw_descriptor"])
    return next((each[0] for each in found if each[1] in classes and each[2] not in _NAMES), None)


def _together(entry: JsonObject, other: JsonObject) -> bool:
    """Whether two entries are one piece of hardware: the same numbers, or one below the other."""
    one, two = (str(each.get("instance", {}).get("sysfs", "")) for each in (entry, other))
    below = bool(one and two) and (one.startswith(f"{two}/") or two.startswith(f"{one}/"))
    return below or (bool(entry.get("vid")) and _numbers(entry) == _numbers(other) and not _apart(entry, other))


def _apart(entry: JsonObject, other: JsonObject) -> bool:
    """Whether two entries are plugged in at different ports of USB, or into different slots of PCI."""
    ports = [str(each.get("instance", {}).get("port", "")) for each in (entry, other)]
    slots = [port.rpartition(".")[0] if _PCI_PORT.fullmatch(port) else port for port in ports]
    known = all(map(_USB_PORT.fullmatch, ports)) or all(map(_PCI_PORT.fullmatch, ports))
    return known and slots[0] != slots[1]


_PCI_PORT = regex(r"[0-9a-f]{4,}:[0-9a-f]{2}:[0-9a-f]{2}\.[0-7]")
_OF_A_UNIT = frozenset({"block", "nvme", "input"})
"""Classes of which two devices are two things, unless one is below the other or they have one name."""


def _named_alike(entry: JsonObject, other: JsonObject) -> bool:
    one, two = (str(each["name"]).casefold() for each in (entry, other))
    texts = [str(each["raw_descriptor"]).casefold() for each in (entry, other)]
    return one in two or two in one or one in texts[1] or two in texts[0]


def _numbers(entry: JsonObject) -> tuple[str | None, str | None]:
    return entry.get("vid"), entry.get("pid")


def _commanded(
    value: JsonObject, artifacts: Artifacts
) -> Iterator[tuple[int, int, str, JsonObject, Mapping[str, Mapping[str, Any]]]]:
    """(device, capability, profile, the capability, commands by name) of devices with a protocol definition."""
    for index, device in enumerate(value["devices"]):
        facts = artifacts.profiles.get(device.get("profile", ""))
        if facts is None or not facts.commands or device["id"] not in facts.holds:
            continue
        commands = {str(command["tool"]): command for command in facts.commands}
        for at, capability in enumerate(device["capabilities"]):
            yield index, at, facts.name, capability, commands


# Rules for the capabilities of a device: a way that PROBE shows, an effect that the words do not belie.
#
# A capability becomes a tool that somebody calls. So the kernel's classes have to show a way to what it promises (no
# picture comes out of a temperature sensor), a verb that destroys is no `read`, and a pipe for bytes is none, whatever
# it is called. A person who answered, or a profile that holds, may know of a way that no class shows.

_CLASSES = RAW | {way for ways in (*WAYS.values(), *MEASURED.values()) for way in ways if "-" not in way}


def without_class(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """PROBE shows a class of the kernel that leads to what the capability promises."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    if (artifacts.probe or {}).get("platform", {}).get("os") != "linux":
        return []
    out = []
    for index, at, device, capability in capabilities(value):
        entry = probed.get(device["id"])
        if entry is None or entry.get("context") or known_by_a_person(device, artifacts):
            continue
        if device["category"] == "unknown":
            continue  # another rule's finding: what is unknown can do nothing
        shows = ways_of(entry)
        if is_pipe(capability) or (capability["effect"] != "read" and speaks_bytes(entry)):
            continue  # another rule's finding: what acts through a raw line needs a profile
        spoken = tokens(capability["name"])
        wanted = [WAYS[word] for word in spoken if word in WAYS]
        measured = [word for word in spoken if word in MEASURED] if not (wanted or shows & RAW) else []
        right = any(shows.intersection(ways) for ways in wanted) or any(measures(entry, word) for word in measured)
        reached = _reached(capability)
        if shows and (right or not (wanted or measured)) and reached <= shows:
            continue
        wanted += [MEASURED[word] for word in measured]
        name = display(capability["name"])
        has = f"it has {listed(sorted(shows))}" if shows else "it has none"
        summary = f"no class that PROBE shows of {display(device['id'])} leads to {name}; {has}"
        hint = (
            "PROBE shows no channel of it that measures this; leave it out"
            if shows and is_blank(entry)
            else f"{listed(list(dict.fromkeys(way for ways in wanted for way in ways)))} would; leave it out"
            if wanted
            else f"leave it out; `octoform profile new {device['id']}` drafts what a person knows of it"
        )
        where = pointer("devices", index, "capabilities", at)
        out.append(error("IDENTIFY-CAPABILITY-WITHOUT-CLASS", summary, pointer=where, hint=hint))
    return out


def effect_understated(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A capability that changes or destroys something is no read, and a read's name begins with a word of reading."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    return [
        error(
            "IDENTIFY-EFFECT-UNDERSTATED",
            f"{display(capability['name'])} is declared read, and {display(verb)} is no reading",
            pointer=pointer("devices", index, "capabilities", at, "effect"),
            hint="write irreversible where nothing brings back what was there, else actuate; or name what it reads, "
            "with a verb such as read, get, list, measure",
        )
        for index, at, device, capability in capabilities(value)
        if capability["effect"] == "read"
        and not is_pipe(capability)
        and not _is_command(device, capability, artifacts)
        and (verb := _deed(device, capability, probed.get(device["id"])))
    ]


def passthrough(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """No capability is a raw pipe to the device, by its name, by its description or by what it takes."""
    out = []
    for index, at, _device, capability in capabilities(value):
        if member := is_pipe(capability):
            summary = f"the {member} of the capability {display(capability['name'])} offers a raw pipe to the device"
            where = pointer("devices", index, "capabilities", at, member)
            hint = "name what the device does, with typed parameters; a device with no such thing is unknown"
            out.append(error("IDENTIFY-PASSTHROUGH", summary, pointer=where, hint=hint))
    return out


def _deed(device: JsonObject, capability: JsonObject, entry: JsonObject | None) -> str | None:
    """The word by which a capability changes something, or does not read; a raw line has a rule of its own."""
    if verb := changes(capability["name"], capability["description"]):
        return verb
    named = is_reading(capability["name"]) or device["method"] == "profile" or entry is None or speaks_bytes(entry)
    return None if named else tokens(capability["name"])[0]


def _is_command(device: JsonObject, capability: JsonObject, artifacts: Artifacts) -> bool:
    """Whether a profile that holds states what a capability is: its effect is there."""
    facts = artifacts.profiles.get(device.get("profile", ""))
    return facts is not None and any(command["tool"] == capability["name"] for command in facts.commands)


def _reached(capability: JsonObject) -> frozenset[str]:
    """The classes by which a capability states that its device is reached."""
    parameters = capability.get("parameters", {})
    named = (parameters.get(name) for name in ("class", "kernel_class", "subsystem"))
    return frozenset(name for name in named if isinstance(name, str) and name in _CLASSES)


def is_pipe(capability: JsonObject) -> str:
    """The member by which a capability is a raw pipe; "" for what is none."""
    if is_passthrough(capability["name"]):
        return "name"
    if offers_a_pipe(capability["description"]):
        return "description"
    return "parameters" if raw_facts(capability.get("parameters", {}), capability["effect"]) else ""


def capabilities(value: JsonObject) -> Iterator[tuple[int, int, JsonObject, JsonObject]]:
    """(device index, capability index, device, capability) of every capability."""
    for index, device in enumerate(value["devices"]):
        for at, capability in enumerate(device["capabilities"]):
            yield index, at, device, capability


def evidenced(value: JsonObject, artifacts: Artifacts) -> Iterator[tuple[int, int, JsonObject, JsonObject, JsonObject]]:
    """The same with PROBE's entry of the device, where it has one and no person has described the device."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    for index, at, device, capability in capabilities(value):
        if device["id"] in probed and not known_by_a_person(device, artifacts):
            yield index, at, device, capability, probed[device["id"]]


CAPABILITY_RULES = (
    Rule("IDENTIFY-CAPABILITY-WITHOUT-CLASS", without_class),
    Rule("IDENTIFY-EFFECT-UNDERSTATED", effect_understated),
    Rule("IDENTIFY-PASSTHROUGH", passthrough),
)
