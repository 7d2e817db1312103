"""Rules for what moves at the end of a raw line: anyone who drives it knows its limits and how it stops.

Behind a serial line, a HID report, a bus or a bare USB interface the kernel knows nothing of the device: no range, no
unit, no stop. A model may remember the registers of a servo, and no one can determine whether it does so rightly before
something has moved. So what acts there comes from a profile, or from the owner's answer about it; and what is
stated to read there speaks of nothing that moves and takes nothing that a device could do.
"""

import re
from collections.abc import Collection, Iterator

from octoform.base.escaping import display
from octoform.base.shape import pointer
from octoform.contracts.device_kinds import RAW, SAME_KIND
from octoform.contracts.model import Artifacts, JsonObject, Rule, described, effects_of
from octoform.contracts.movement_words import (
    carries,
    is_quantity,
    is_time,
    lacking,
    name_moves,
    says_stop,
    speaks_of_change,
    spoken,
)
from octoform.contracts.name_clues import changes, is_class_word, is_filler, is_passthrough, offers_a_pipe
from octoform.contracts.name_words import names_language, parts, word_set, words
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex

CODE, READ, OFFERED = "IDENTIFY-ACTUATE-WITHOUT-PROFILE", "IDENTIFY-READ-MOVES", "IDENTIFY-PROFILE-NOT-CHOSEN"
UNFOUNDED = "IDENTIFY-READ-UNFOUNDED"
TOOL, LIMITED, UNSAFE = "INTERFACE-READ-MOVES", "INTERFACE-READ-LIMITED", "INTERFACE-REASON-FALSE"
_USB_CLASS = regex(r"\bclass (?:01|06|07|08|0b|0e)/[0-9a-f]{2}/[0-9a-f]{2}")
# USB-IF, Defined Class Codes: audio, still image, printer, storage, smart card and video have commands of their own.
_NAMING = regex(
    r"^(?:name|product|model|label|description|[\w.\[\]]*\.(?:name|label|product|model)|interface \w+ string"
    r"|udev\.ID_MODEL\w*|of_name|compatible): (.*)$",
    re.MULTILINE,
)
"""Lines of PROBE in which a device reports what it is."""
_MAKER = regex(r"^(?:manufacturer|vendor|[\w.\[\]]*\.(?:manufacturer|vendor)|udev\.ID_VENDOR\w*): (.*)$", re.MULTILINE)
_PRESENCE = frozenset({"presence", "present", "attached", "connected"})
_LISTENS = frozenset({"listen", "listens", "listening"}) | _PRESENCE
_ASKED_AT = regex(r"(?i)\b(?:registers?|address(?:es)?|opcodes?)\s+(?:0x)?[0-9a-f]*\d[0-9a-f]*\b")


def actuate_without_profile(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A capability that acts through a raw line is one of a profile that holds, or the owner's answer gives limits."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    return [
        error(
            CODE,
            f"{display(capability['name'])} acts on {display(device['id'])} through a raw line, "
            "and no profile defines how",
            pointer=pointer("devices", index, "capabilities", at),
            hint=f"leave it out; {cure(device['id'], artifacts)}; it gives limits and how to stop",
        )
        for index, device in enumerate(value["devices"])
        if not known_by_a_person(device, artifacts) and RAW.issuperset(probed.get(device["id"], {}).get("classes", ()))
        for at, capability in enumerate(device["capabilities"])
        if capability["effect"] != "read"
    ] + _answer_incomplete(value, artifacts)


def _answer_incomplete(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """An answer that names a device and gives neither limits nor how it stops is no source of what acts there."""
    incomplete = lines_answered_incompletely(value, artifacts)
    return [
        error(
            CODE,
            f"{display(capability['name'])} acts on {display(device['id'])} through a raw line, "
            f"and the owner's answer lacks {' and '.join(incomplete[device['id']])}",
            pointer=pointer("devices", index, "capabilities", at),
            hint=f"leave it out; {cure(device['id'], artifacts, incomplete)}",
        )
        for index, device in enumerate(value["devices"])
        for at, capability in enumerate(device["capabilities"] if device["id"] in incomplete else ())
        if capability["effect"] != "read"
    ]


def read_moves(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A read on an undocumented line must not mention moving or changing something.

    An answer that bounds nothing frees no read of that: what must not act would be declared as one that reads.
    """
    incomplete, out = lines_answered_incompletely(value, artifacts), []
    for index, at, device, capability in _reading(value, artifacts, incomplete):
        if device["id"] in artifacts.offered and not _only_listens(capability):
            continue  # one finding, and the graver one
        if _is_refused_elsewhere(capability):
            continue  # another rule's finding, wherever the device is
        if found := _capability_moves(capability):
            member, why = found
            summary = f"{display(capability['name'])} of {display(device['id'])} is declared read, and {why}"
            where = pointer("devices", index, "capabilities", at, member)
            hint = f"omit it, or describe what it reads; {cure(device['id'], artifacts, incomplete)}"
            out.append(error(READ, summary, pointer=where, hint=hint))
    return out


def read_unfounded(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A read on an undocumented line needs a word of the device as evidence; a bare board gives none."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    out = []
    for index, at, device, capability in _reading(value, artifacts):
        if device["id"] in artifacts.offered or _only_listens(capability) or _is_refused_elsewhere(capability):
            continue
        if _capability_moves(capability) or _names_its_quantity(device, capability, probed[device["id"]], artifacts):
            continue
        summary = f"no string of {display(device['id'])} shows what {display(capability['name'])} would read"
        where = pointer("devices", index, "capabilities", at)
        hint = "a board or an adapter is a part: write category unknown, confidence 0.0, no capabilities, and in "
        hint += (
            "`missing` the question what it is used for; where its strings have it in another language, `says` names it"
        )
        out.append(error(UNFOUNDED, summary, pointer=where, hint=hint))
    return out


def profile_not_chosen(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Where a profile is at hand that would match, nothing is asked through the line without it."""
    return [
        error(
            OFFERED,
            f"{display(capability['name'])} talks to {display(device['id'])}, "
            "and the profile that knows it is not chosen",
            pointer=pointer("devices", index, "capabilities", at),
            hint=f"leave it out; {cure(device['id'], artifacts)}",
        )
        for index, at, device, capability in _reading(value, artifacts)
        if device["id"] in artifacts.offered and not _only_listens(capability)
    ]


def tool_moves(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool that reads on such a line reports that in its description, and its parameters only select."""
    incomplete, out = lines_answered_incompletely(artifacts.identify, artifacts), []
    lines = unknown_lines(artifacts).union(incomplete)
    for index, tool in enumerate(value["tools"]):
        known = sorted(lines.intersection(tool["devices"]))
        if tool["effect"] != "read" or not known:
            continue
        found = _tool_moves(tool)
        if found is not None and not _is_refused_elsewhere(tool):
            where, why = found
            summary = f"{display(tool['name'])} is declared read on {display(known[0])}, and {why}"
            hint = "describe what it reads and let parameters only select it, or skip the capability as `unsafe`; "
            hint += cure(known[0], artifacts, incomplete)
            out.append(error(TOOL, summary, pointer=pointer("tools", index, *where), hint=hint))
    return out


def read_limited(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool that reads gives the device no quantity that could be too large: a limit of one belongs to what acts."""
    effects, open_lines = effects_of(artifacts), lines_without_knowledge(artifacts)
    profiled = set().union(*(facts.holds for facts in artifacts.profiles.values()))
    out = []
    for index, tool in enumerate(value["tools"]):
        reads = tool["effect"] == "read" == effects.get(tool["capability"], "read")
        for at, limit in enumerate(tool.get("limits", ()) if reads else ()):
            name = limit["parameter"]
            if profiled.isdisjoint(tool["devices"]) and is_quantity(name):
                summary = (
                    f"{display(tool['name'])} is declared read, and {display(name)}, which it limits, is for the device"
                )
                acts = "skip a capability that acts as `unsafe`"
                acts = (
                    acts
                    if open_lines.intersection(tool["devices"])
                    else "a tool that acts declares that in its `effect`"
                )
                hint = f"a tool that reads takes no such parameter; {acts}"
                where = pointer("tools", index, "limits", at)
                out.append(error(LIMITED, summary, pointer=where, hint=hint))
    return out


def unsafe_known(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Unsafe is only an undocumented line: elsewhere a profile or a person defines the actions and their bounds."""
    if artifacts.probe is None:
        return []
    commanded = {device: name for device, name, _ in described(artifacts.identify, artifacts)}
    held = {device: name for name, facts in sorted(artifacts.profiles.items()) for device in facts.holds} | commanded
    open_lines = lines_without_knowledge(artifacts).union(lines_answered_incompletely(artifacts.identify, artifacts))
    open_lines -= held.keys()
    out = []
    for index, item in enumerate(value["left_out"]):
        name = item["id"]
        if item["reason"] != "unsafe" or name in open_lines:
            continue
        if name in held:
            why = f"the profile {display(held[name])} defines how it is driven"
            hint = f"add {'a tool for each command of its protocol definition' if name in commanded else 'its tools'}"
            hint += "; its limits bind every call, and what no one is to call is denied in the `policy` of octopus.yaml"
        elif name in artifacts.answers:
            why = f"its owner answered what it is: {display(artifacts.answers[name])}"
            hint = "add its tools, with limits; what no one is to call is denied in the `policy` of octopus.yaml"
        else:
            why = "it is reached by an interface of the system and not by a raw line alone"
            hint = "add its tools, each with the effect that it has, or give the reason that is true of it"
        summary = f"{display(item.get('capability', name))} is skipped as unsafe"
        summary += f" on {display(name)}, and {why}" if "capability" in item else f", and {why}"
        out.append(error(UNSAFE, summary, pointer=pointer("left_out", index, "reason"), hint=hint))
    return out


RULES = (
    Rule(CODE, actuate_without_profile),
    Rule(READ, read_moves),
    Rule(UNFOUNDED, read_unfounded),
    Rule(OFFERED, profile_not_chosen),
)
INTERFACE_RULES = (Rule(TOOL, tool_moves), Rule(LIMITED, read_limited), Rule(UNSAFE, unsafe_known))


def known_by_a_person(device: JsonObject, artifacts: Artifacts) -> bool:
    """Whether a person or a profile states how it is driven; a profile that does not hold is another rule's finding."""
    return device["id"] in artifacts.answers or "profile" in device or device["method"] == "profile"


def unknown_lines(artifacts: Artifacts) -> frozenset[str]:
    """The devices that only a raw line leads to, that neither a matching profile nor an answer describes."""
    known = set(artifacts.answers).union(*(facts.holds for facts in artifacts.profiles.values()))
    return frozenset(
        device["id"]
        for device in (artifacts.probe or {}).get("devices", ())
        if device["id"] not in known and is_raw_line(device)
    )


def lines_answered(identify: JsonObject | None, artifacts: Artifacts) -> dict[str, str]:
    """The devices that only a raw line leads to and that an answer describes and no profile, each with its answer."""
    held = set().union(*(facts.holds for facts in artifacts.profiles.values()))
    claimed = (
        each for each in (identify or {}).get("devices", ()) if "profile" in each or each.get("method") == "profile"
    )
    known = held.union(each["id"] for each in claimed)
    return {
        device["id"]: artifacts.answers[device["id"]]
        for device in (artifacts.probe or {}).get("devices", ())
        if device["id"] in artifacts.answers and device["id"] not in known and is_raw_line(device)
    }


def lines_answered_incompletely(identify: JsonObject | None, artifacts: Artifacts) -> dict[str, list[str]]:
    """Those of them whose answer is no source of what acts, each with what the answer lacks.

    Words for stopping in a language that octoform does not know count where evidence quotes them from the answer and
    ``says`` names their language and that they mean to stop.
    """
    translated = {
        device["id"]
        for device in (identify or {}).get("devices", ())
        for each in device.get("evidence", ())
        if each["quote"] in artifacts.answers.get(device["id"], "")
        and names_language(each.get("says", ""))
        and says_stop(each.get("says", ""))
    }
    found = lines_answered(identify, artifacts).items()
    return {device: lacks for device, text in found if (lacks := lacking(text, device in translated))}


def lines_beside(artifacts: Artifacts) -> frozenset[str]:
    """The devices without such knowledge that have a raw line beside a class of the kernel with a meaning."""
    known = set(artifacts.answers).union(*(facts.holds for facts in artifacts.profiles.values()))
    probed = (artifacts.probe or {}).get("devices", ())
    found = {device["id"] for device in probed if not RAW.isdisjoint(device.get("classes", ()))}
    return frozenset(found - known - unknown_lines(artifacts))


def lines_without_knowledge(artifacts: Artifacts) -> frozenset[str]:
    """The devices whose raw line no one knows, whether or not a class with a meaning is beside it."""
    return unknown_lines(artifacts) | lines_beside(artifacts)


def is_raw_line(device: JsonObject) -> bool:
    """Whether all that PROBE shows of a device is a line that carries bytes and no meaning."""
    classes = device.get("classes", ())
    bare = RAW.issuperset(classes) and bool(classes or device.get("interface") == "usb")
    return bare and not _USB_CLASS.search(str(device.get("raw_descriptor", "")))


def cure(device: str, artifacts: Artifacts, incomplete: Collection[str] = ()) -> str:
    """The way to supply the missing knowledge, in a sentence; of an incomplete answer also what counts."""
    if device in incomplete:
        return (
            f'for its owner alone: `octoform answer {device} "..."` with limits (a range such as 0 to 4095, at most 30 '
            'degrees, a number of channels, "on and off") and how it stops (stop, release, power off; words of another '
            "language are quoted as evidence, and `says` names the language and that they mean stop), or "
            f"`octoform profile new {device}` drafts a profile"
        )
    if device in artifacts.offered:
        return (
            f"for its owner alone: `profiles: [{artifacts.offered[device]}]` in octopus.yaml, a profile that matches it"
        )
    drafts = f"`octoform profile new {device}` drafts a profile"
    return f"for its owner alone: {drafts}, `octoform answer {device}` records what it is"


def _reading(
    value: JsonObject, artifacts: Artifacts, more: Collection[str] = ()
) -> Iterator[tuple[int, int, JsonObject, JsonObject]]:
    """(device's index, capability's index, device, capability) of each read on a line that no one knows, or on more."""
    lines = unknown_lines(artifacts)
    for index, device in enumerate(value["devices"]):
        if device["id"] in more or (device["id"] in lines and not known_by_a_person(device, artifacts)):
            for at, capability in enumerate(device["capabilities"]):
                if capability["effect"] == "read":
                    yield index, at, device, capability


def _is_refused_elsewhere(value: JsonObject) -> bool:
    """Whether a capability or a tool is refused wherever its device is, as a raw pipe or for an effect understated."""
    name, description = value["name"], value["description"].partition("Through:")[0]
    return bool(is_passthrough(name) or offers_a_pipe(description) or changes(name, description))


def _names_its_quantity(device: JsonObject, capability: JsonObject, entry: JsonObject, artifacts: Artifacts) -> bool:
    """Whether a string of the device, or a database's entry for it, holds a word for what it measures or is."""
    raw = str(entry.get("raw_descriptor", ""))
    lines = [str(entry.get("name", "")), *_NAMING.findall(raw), (artifacts.registered or {}).get(device["id"], "")]
    said = word_set(lines) - word_set(_MAKER.findall(raw))
    own = {each for word in said | parts(said) if not is_filler(word) for each in (word, SAME_KIND.get(word, word))}
    if any(is_class_word(word) for word in own) or any(
        names_language(each.get("says", "")) for each in device["evidence"]
    ):
        return True
    kinds = words(device.get("class", "").replace("_", " ")) + spoken(capability["name"])[1:]
    return not own.isdisjoint(word_set(kinds))


def _only_listens(capability: JsonObject) -> bool:
    return bool(_LISTENS.intersection(spoken(capability["name"])))


def _capability_moves(capability: JsonObject) -> tuple[str, str] | None:
    """(member, why) of what speaks of a movement in a capability."""
    if word := name_moves(capability["name"]):
        return "name", f"{display(word)} is no reading"
    if words := speaks_of_change(capability["description"]):
        return "description", f"its description has {display(words)}"
    for name, fact in capability.get("parameters", {}).items():
        if words := speaks_of_change(name) or next(filter(None, map(speaks_of_change, _texts(fact))), None):
            return "parameters", f"its parameter {display(name)} has {display(words)}"
    return None


def _tool_moves(tool: JsonObject) -> tuple[tuple[str, ...], str] | None:
    if word := name_moves(tool["name"]):
        return ("name",), f"{display(word)} is no reading"
    if words := speaks_of_change(tool["description"]):
        return ("description",), f"its description has {display(words)}"
    if _PRESENCE.intersection(spoken(tool["capability"])) and (found := _asks_more(tool)):
        return found
    for name, member in tool["input_schema"].get("properties", {}).items():
        if isinstance(member, dict) and (why := carries(name, member, tool["devices"])):
            return ("input_schema", "properties", name), f"of its parameter {display(name)}, {why}"
    for name, member in tool.get("output_schema", {}).get("properties", {}).items():
        if words := speaks_of_change(name) or next(filter(None, map(speaks_of_change, _texts(member))), None):
            return ("output_schema", "properties", name), f"its result {display(name)} has {display(words)}"
    return None


def _asks_more(tool: JsonObject) -> tuple[tuple[str, ...], str] | None:
    """What of a tool that reads whether a device is there asks the device itself for something."""
    if said := _ASKED_AT.search(tool["description"]):
        return ("description",), f"its description has {display(said[0])}; to see that it is there asks it nothing"
    names = [name for name in tool["input_schema"].get("properties", {}) if name != "device" and not is_time(name)]
    if names:
        why = f"its parameter {display(names[0])} chooses what it is asked; to see that it is there asks it nothing"
        return ("input_schema", "properties", names[0]), why
    return None


def _texts(value: object) -> Iterator[str]:
    """The texts in a value, at any depth."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, member in value.items():
            yield str(name)
            yield from _texts(member)
    elif isinstance(value, list):
        for member in value:
            yield from _texts(member)


# Rules for what ends a movement: IDENTIFY marks the capability, INTERFACE repeats it, and neither marks too much.
#
# A call of such a tool passes those that wait for the device, so the mark belongs to tools that do nothing but stop.
# Where a profile has a protocol definition, that alone marks the stop command, and its own rules report deviations.


def identify_stops(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A capability that stops actuates, and does so on every device that has it."""
    commanded = {device: commands for device, _, commands in described(value, artifacts)}
    first: dict[str, bool] = {}
    out = []
    for index, device in enumerate(value["devices"]):
        for at, capability in enumerate(device["capabilities"]):
            stops, name = capability.get("stops", False), capability["name"]
            if name in commanded.get(device["id"], {}):
                continue
            if stops and capability["effect"] != "actuate":
                summary, hint = f"{display(name)} stops and is {capability['effect']}", "what ends a movement actuates"
            elif first.setdefault(name, stops) is not stops:
                summary = f"{display(name)} stops on one device and not on another"
                hint = "give capabilities that do different things different names"
            else:
                continue
            where = pointer("devices", index, "capabilities", at)
            out.append(error("IDENTIFY-STOPS", summary, pointer=where, hint=hint))
    return out


def interface_stops(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool stops where its capability does, and takes no parameter but the device."""
    stopping = {
        capability["name"]: capability.get("stops", False)
        for device in (artifacts.identify or {"devices": []})["devices"]
        for capability in device["capabilities"]
    }
    for _, _, commands in described(artifacts.identify, artifacts):
        for name in commands:
            stopping.pop(name, None)
    out = []
    for index, tool in enumerate(value["tools"]):
        stops = tool.get("stops", False)
        wanted = stopping.get(tool["capability"], stops)
        properties = tool["input_schema"].get("properties")
        others = sorted(set(properties if isinstance(properties, dict) else ()) - {"device"})
        if stops is not wanted:
            word = "true" if wanted else "false"
            summary = f"{display(tool['name'])} and its capability differ in `stops`"
            where, hint = pointer("tools", index), f'write "stops": {word}'
        elif stops and others:
            summary = f"{display(tool['name'])} stops, and takes the parameter {display(others[0])}"
            where = pointer("tools", index, "input_schema", "properties", others[0])
            hint = "a tool that stops takes no parameter but `device`"
        else:
            continue
        out.append(error("INTERFACE-STOPS", summary, pointer=where, hint=hint))
    return out


IDENTIFY_STOPS = (Rule("IDENTIFY-STOPS", identify_stops),)
INTERFACE_STOPS = (Rule("INTERFACE-STOPS", interface_stops),)
