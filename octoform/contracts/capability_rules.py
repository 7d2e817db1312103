"""Rules for what a device is said to be able to do: a way that PROBE shows, an effect that the words do not belie.

A capability becomes a tool that somebody calls. So the kernel's classes have to show a way to what it promises (no
picture comes out of a temperature sensor), a verb that destroys is no `read`, and a pipe for bytes is none, whatever
it is called. A person who answered, or a profile that holds, may know of a way that no class shows.
"""

from collections.abc import Iterator

from octoform.contracts.kinds import MEASURED, RAW, WAYS, measures, speaks_bytes
from octoform.contracts.kinds import shown as ways_of
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.naming import changes, is_passthrough, is_reading, offers_a_pipe, raw_facts, tokens
from octoform.contracts.raw_line_rules import known_by_a_person
from octoform.contracts.text import listed, pointer, shown
from octoform.diagnostics import Diagnostic, error

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
        name = shown(capability["name"])
        has = f"it has {listed(sorted(shows))}" if shows else "it has none"
        summary = f"no class that PROBE shows of {shown(device['id'])} leads to {name}; {has}"
        hint = (
            f"{listed(list(dict.fromkeys(way for ways in wanted for way in ways)))} would; leave it out"
            if wanted
            else f"leave it out; `octoform profile new {device['id']}` drafts what a person knows of it"
        )
        where = pointer("devices", index, "capabilities", at)
        out.append(error("IDENTIFY-CAPABILITY-WITHOUT-CLASS", summary, pointer=where, hint=hint))
    return out


def effect_understated(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """What changes or destroys something is no read, and the name of a read begins with what it reads by."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    return [
        error(
            "IDENTIFY-EFFECT-UNDERSTATED",
            f"{shown(capability['name'])} is declared read, and {shown(verb)} is no reading",
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
            summary = f"the {member} of the capability {shown(capability['name'])} offers a raw pipe to the device"
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
    """Whether a profile that holds says what a capability is: its effect stands there."""
    facts = artifacts.profiles.get(device.get("profile", ""))
    return facts is not None and any(command["tool"] == capability["name"] for command in facts.commands)


def _reached(capability: JsonObject) -> frozenset[str]:
    """The classes by which a capability says that its device is reached."""
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


RULES = (
    Rule("IDENTIFY-CAPABILITY-WITHOUT-CLASS", without_class),
    Rule("IDENTIFY-EFFECT-UNDERSTATED", effect_understated),
    Rule("IDENTIFY-PASSTHROUGH", passthrough),
)
