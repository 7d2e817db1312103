"""Rules for INTERFACE: one typed tool for each capability, no more, no fewer, and nothing served that was not seen.

The list of tools is what a person reads to know what an agent may do here, so effects and annotations must state the
truth about each, and every device that no tool serves is named with a reason.
"""

import json
import re
from collections import defaultdict

from octoform.base.escaping import display, escaped, listed
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule, effects_of, is_graver
from octoform.contracts.name_clues import is_class_word, is_filler, same_action, tokens
from octoform.contracts.rules import raw_line_rules
from octoform.contracts.rules.interface import bound_rules, description_rules, member_units, parameter_rules
from octoform.contracts.rules.text_rules import in_values
from octoform.diagnostics import Diagnostic, did_you_mean, error, warning
from octoform.patterns import regex

_BUDGET, _SIZE, _UNSAFE = "tool_budget", "server_size", "unsafe"
SPARED = frozenset({_BUDGET, _SIZE, _UNSAFE})
"""Reasons for which one capability of a device has no tool, although others of it may have one."""
_LONG_SERVER = 12
"""Fewer tools always fit into a server: they would have forty lines each."""


def capability_without_tool(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Each capability has its tool, unless all of its devices are omitted for the budget, or as unsafe."""
    served = {tool["capability"] for tool in value["tools"]}
    open_lines = raw_line_rules.lines_without_knowledge(artifacts).union(
        raw_line_rules.lines_answered_incompletely(artifacts.identify, artifacts)
    )
    unsafe = "what is not safe to serve is skipped with the reason unsafe, its `capability` named and why in `detail`; "
    return [
        error(
            "INTERFACE-CAPABILITY-WITHOUT-TOOL",
            f"no tool has the capability {display(name)} of {listed(sorted(owners))}",
            pointer="/tools",
            hint=f"add its tool; {unsafe if owners <= open_lines else ''}where the tool budget forbids it, leave its "
            "devices out with the reason tool_budget",
        )
        for name, owners in _owners(artifacts).items()
        if name not in served and not owners <= _spared(value, name)
    ]


def identify_blamed(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A problem that only IDENTIFY can fix is sent to IDENTIFY; no interface is accepted with it."""
    known, out = _known(artifacts), []
    for index, item in enumerate(value.get("identify_errors", ())):
        about = " and ".join(display(item[name]) for name in ("capability", "device") if name in item)
        where = pointer("identify_errors", index)
        if item["device"] not in known:
            summary = f"{display(item['device'])} is no device of IDENTIFY, so nothing is wrong with it there"
            out.append(error("INTERFACE-UNKNOWN-DEVICE", summary, pointer=where, hint="name a device of IDENTIFY"))
            continue
        summary = f"INTERFACE finds IDENTIFY wrong about {about}: {escaped(item['problem'])}"
        hint = "IDENTIFY runs again with this, once if this run made it; else: octoform apply -replace identify"
        out.append(error("INTERFACE-IDENTIFY-WRONG", summary, pointer=where, hint=hint))
    return out


def tool_without_capability(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Each tool has a capability of IDENTIFY, spelt exactly so."""
    names = _owners(artifacts)
    out = []
    for index, tool in enumerate(value["tools"]):
        if tool["capability"] not in names:
            guess = did_you_mean(tool["capability"], list(names))
            hint = f"did you mean {guess}?" if guess else "write tools only for capabilities that IDENTIFY lists"
            summary = f"the capability {display(tool['capability'])} is not one of IDENTIFY"
            where = pointer("tools", index, "capability")
            out.append(error("INTERFACE-TOOL-WITHOUT-CAPABILITY", summary, pointer=where, hint=hint))
    return out


def duplicate_capability(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """One tool for one capability; several devices are one parameter of it."""
    first: dict[str, int] = {}
    out = []
    for index, tool in enumerate(value["tools"]):
        before = first.setdefault(tool["capability"], index)
        if before != index:
            summary = f"{display(tool['capability'])} has a second tool; tools[{before}] serves it already"
            hint = "write one tool with a parameter that names the device"
            where = pointer("tools", index, "capability")
            out.append(error("INTERFACE-DUPLICATE-CAPABILITY", summary, pointer=where, hint=hint))
    return out


def devices_differ(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool serves exactly the devices that have its capability."""
    names = _owners(artifacts)
    out = []
    for index, tool in enumerate(value["tools"]):
        owners = names.get(tool["capability"])
        if owners is None:
            continue
        spared = _spared(value, tool["capability"])
        listed_here = set(tool["devices"])
        absent, foreign = sorted(owners - listed_here - spared), sorted(listed_here - owners)
        words = [f"{listed(absent)} also has the capability"] if absent else []
        words += [f"{listed(foreign)} does not have the capability"] if foreign else []
        if words:
            summary = f"the devices of {display(tool['name'])} are not those of IDENTIFY: {'; '.join(words)}"
            where = pointer("tools", index, "devices")
            hint = "list exactly the devices that have the capability"
            out.append(error("INTERFACE-DEVICES-DIFFER", summary, pointer=where, hint=hint))
    return out


_PRODUCT = regex(r"(?mi)^(product|manufacturer|vendor|model|maker): (.+)$")
_MAKERS = ("manufacturer", "vendor", "maker")


def product_in_name(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A name has no word of a product that its capability does not have: other products get the same tool."""
    strings = {item["id"]: str(item.get("raw_descriptor", "")) for item in (artifacts.probe or {}).get("devices", ())}
    out = []
    for index, tool in enumerate(value["tools"]):
        lines = [each for name in tool["devices"] for each in _PRODUCT.findall(strings.get(name, ""))]
        words, makers = _words_of(lines), _words_of([each for each in lines if each[0].casefold() in _MAKERS])
        known = {*tokens(tool["capability"])}
        strange = sorted(word for word in ({*tokens(tool["name"])} - known) & words if _is_own(word))
        if strange:
            summary = f"the tool name {display(tool['name'])} has {listed(strange)} of a product in it"
            hint = f"call it {display(tool['capability'])}; the product belongs in the description"
            out.append(error("INTERFACE-NAME-PRODUCT", summary, pointer=pointer("tools", index, "name"), hint=hint))
        for name, member in (tool["input_schema"].get("properties") or {}).items():
            text = f"{tool['description'].partition('Through:')[0]} {member.get('description', '')}"
            spoken = set(re.findall(r"\b[a-z0-9]+\b", text)) | known
            strange = sorted(word for word in words & {*tokens(name)} - spoken if not is_filler(word))
            own = [word for word in strange if _is_own(word) and len(word) > 3]
            coined = makers.union(_coined(lines)).intersection(own)
            if own and (len(strange) > 1 or coined) and len(tokens(name)) > len(own):
                summary = f"the parameter {display(name)} of {display(tool['name'])} has {listed(strange)} of a product"
                hint = "call it by what it means to any product; the product belongs in the description"
                where = pointer("tools", index, "input_schema", "properties", name)
                out.append(error("INTERFACE-NAME-PRODUCT", summary, pointer=where, hint=hint))
    return out


def _words_of(lines: list[tuple[str, str]]) -> set[str]:
    """The words of lines of a device's text and the first two as one, without what stands for a number."""
    rows = [re.findall(r"[a-z0-9]+(?!>)\b", line.casefold()) for _, line in lines]
    return {word for row in rows for word in (*row, "".join(row[:2]))}


def _coined(lines: list[tuple[str, str]]) -> set[str]:
    """The words of product strings that were made for it: with a digit or a capital inside, or all in capitals."""
    found: set[str] = set()
    for _, line in lines:
        given = re.findall(r"[A-Za-z0-9]+(?!>)\b", line)
        loud = {word for word in given if len(word) > 3 and word.isupper() and word.isalpha()}
        found |= {word for word in given if _INSIDE.search(word)} | (loud if len(loud) < len(given) else set())
    return {word.casefold() for word in found}


_INSIDE = regex(r"[a-z][A-Z]|[A-Za-z]\d|\d[A-Za-z]")


def _is_own(word: str) -> bool:
    """Whether a word is a product's or a maker's own, and none for a kind of thing."""
    return not is_class_word(word) and not is_filler(word)


def name_clash(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Names differ by more than case and punctuation, which some clients drop."""
    first: dict[str, str] = {}
    out = []
    for index, tool in enumerate(value["tools"]):
        plain = tool["name"].casefold().replace("-", "_").replace(".", "_")
        where = pointer("tools", index, "name")
        before = first.setdefault(plain, where)
        if before != where:
            summary = f"the tool name {display(tool['name'])} is not distinct from the one at {before}"
            hint = "choose names that differ by more than case, points and dashes"
            out.append(error("INTERFACE-NAME-CLASH", summary, pointer=where, hint=hint))
    return out


_HINTS = {
    "read": {"readOnlyHint": True, "destructiveHint": False},
    "actuate": {"readOnlyHint": False},
    "irreversible": {"readOnlyHint": False, "destructiveHint": True},
}


def effect_differs(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool has the effect that IDENTIFY gave its capability, or a graver one where somebody knows its limits."""
    effects, incomplete = (
        effects_of(artifacts),
        raw_line_rules.lines_answered_incompletely(artifacts.identify, artifacts),
    )
    lines = raw_line_rules.unknown_lines(artifacts).union(incomplete)
    out = []
    for index, tool in enumerate(value["tools"]):
        wanted = effects.get(tool["capability"], tool["effect"])
        if is_graver(tool["effect"], wanted):
            for device in sorted(lines.intersection(tool["devices"]))[:1]:
                unknown = f"nothing declares how {display(device)} stops"
                summary = f"{display(tool['name'])} is declared {tool['effect']}, and {unknown}"
                hint = f"write {wanted}, as IDENTIFY has {tool['capability']}, and describe what that does; where it "
                cure = raw_line_rules.cure(device, artifacts, incomplete)
                hint += f"would act, skip it with the reason unsafe; {cure}"
                where = pointer("tools", index, "effect")
                out.append(error("INTERFACE-EFFECT-DIFFERS", summary, pointer=where, hint=hint))
        elif tool["effect"] != wanted:
            summary = f"{display(tool['name'])} is declared {tool['effect']}; its capability is {wanted}"
            hints = [f"{hint} {json.dumps(must)}" for hint, must in _HINTS[wanted].items()]
            where, hint = (
                pointer("tools", index, "effect"),
                f"write {wanted}, and in `annotations` {', '.join(hints)}",
            )
            out.append(error("INTERFACE-EFFECT-DIFFERS", summary, pointer=where, hint=hint))
    return out


def annotations_contradict(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The hints that a client sees agree with the effect; where that is wrong, it is the cause."""
    effects = effects_of(artifacts)
    attached = description_rules.attached_devices(artifacts)
    out = []
    for index, tool in enumerate(value["tools"]):
        effect = tool["effect"]
        if is_graver(effects.get(tool["capability"], effect), effect):
            continue
        for hint, must in _HINTS[effect].items():
            if tool["annotations"][hint] is not must:
                summary = f"{display(tool['name'])} has the effect {effect}, so {hint} must be {json.dumps(must)}"
                where = pointer("tools", index, "annotations", hint)
                out.append(error("INTERFACE-ANNOTATIONS", summary, pointer=where, hint=f"write {json.dumps(must)}"))
        if effect == "actuate" and tool["annotations"]["destructiveHint"] is True:
            summary = f"{display(tool['name'])} has the effect actuate, and declares that it destroys something"
            where = pointer("tools", index, "annotations", "destructiveHint")
            hint = "write false; what nothing brings back has the effect irreversible, in IDENTIFY first"
            out.append(warning("INTERFACE-ANNOTATIONS", summary, pointer=where, hint=hint))
        if tool["annotations"]["openWorldHint"] is True and attached.issuperset(tool["devices"]):
            summary = (
                f"{display(tool['name'])} declares that it reaches beyond this host, and its device is attached to it"
            )
            where = pointer("tools", index, "annotations", "openWorldHint")
            out.append(error("INTERFACE-ANNOTATIONS", summary, pointer=where, hint="write false"))
    return out


def tool_budget(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """No more tools than the manifest allows."""
    count = len(value["tools"])
    if count <= artifacts.tools_budget:
        return []
    summary = f"{count} tools are more than the budget of {artifacts.tools_budget}"
    hint = "keep the most useful, leave the rest out with the reason tool_budget, or raise budget.tools"
    return [error("INTERFACE-TOOL-BUDGET", summary, pointer="/tools", hint=hint)]


def budget_unused(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The tool budget is a reason only where it is used up, and the server's size only for one of many tools."""
    free = artifacts.tools_budget - len(value["tools"])
    return [
        error(
            "INTERFACE-BUDGET-UNUSED",
            f"{display(item['id'])} is skipped for the tool budget, and {free} of {artifacts.tools_budget} are free",
            pointer=pointer("left_out", index, "reason"),
            hint="add the tools of its capabilities, or give the reason that is true of it",
        )
        for index, item in enumerate(value["left_out"])
        if item["reason"] == _BUDGET and free > 0
    ] + [
        error(
            "INTERFACE-BUDGET-UNUSED",
            f"{display(item['id'])} is skipped for the server's size, and {len(value['tools'])} tools make a short one",
            pointer=pointer("left_out", index, "reason"),
            hint="add the tools of its capabilities, or give the reason that is true of it",
        )
        for index, item in enumerate(value["left_out"])
        if item["reason"] == _SIZE and len(value["tools"]) < _LONG_SERVER
    ]


def unknown_device(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Tools and left_out name devices that were seen."""
    known = _known(artifacts)
    places = [
        (pointer("tools", index, "devices", at), name)
        for index, tool in enumerate(value["tools"])
        for at, name in enumerate(tool["devices"])
    ]
    places += [(pointer("left_out", index, "id"), item["id"]) for index, item in enumerate(value["left_out"])]
    out = []
    for where, name in places:
        if name not in known:
            guess = did_you_mean(name, list(known)[:2000])
            hint = f"did you mean {guess}?" if guess else "name only devices that the IDENTIFY artifact names"
            summary = f"{display(name)} is not a device of IDENTIFY"
            out.append(error("INTERFACE-UNKNOWN-DEVICE", summary, pointer=where, hint=hint))
    return out


def device_unaccounted(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Every device is served by a tool or omitted with a reason."""
    names = _served(value) | {item["id"] for item in value["left_out"]}
    silent = [name for name in _known(artifacts) if name not in names]
    if not silent:
        return []
    summary = f"{len(silent)} devices are neither served by a tool nor skipped: {listed(silent)}"
    hint = "add each of them to left_out with its reason"
    return [error("INTERFACE-DEVICE-UNACCOUNTED", summary, pointer="/left_out", hint=hint)]


def left_out_twice(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A device is omitted once, and not served as well, save for what the tool budget cut."""
    served = _served(value)
    seen: set[tuple[str, str]] = set()
    out = []
    for index, item in enumerate(value["left_out"]):
        where, entry = pointer("left_out", index, "id"), (item["id"], item.get("capability", ""))
        whole = item["reason"] == _UNSAFE and "capability" not in item
        if entry in seen or (item["id"], "") in seen or (not entry[1] and item["id"] in {name for name, _ in seen}):
            summary, hint = f"{display(item['id'])} is skipped twice", "keep one of the two"
        elif item["id"] in served and (item["reason"] not in SPARED or whole):
            summary, hint = f"{display(item['id'])} is skipped and served by a tool", "choose one of the two"
            hint += "; where one capability of it is unsafe, name that in `capability`" if whole else ""
        else:
            seen.add(entry)
            continue
        out.append(error("INTERFACE-LEFT-OUT-TWICE", summary, pointer=where, hint=hint))
    return out


def reason_differs(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """What IDENTIFY skipped has its reason here too, and what it did not know is of unknown meaning."""
    given = {item["id"]: item["reason"] for item in _identify(artifacts)["left_out"]}
    unknown = {item["id"] for item in _identify(artifacts)["devices"] if item["category"] == "unknown"}
    given |= dict.fromkeys(unknown, "unknown_meaning")
    return [
        error(
            "INTERFACE-REASON-DIFFERS",
            f"{display(item['id'])} is skipped as {item['reason']}, and by IDENTIFY it is {given[item['id']]}",
            pointer=pointer("left_out", index, "reason"),
            hint=f"write {given[item['id']]}; where that is false, report it in `identify_errors`",
        )
        for index, item in enumerate(value["left_out"])
        if item["reason"] not in (given.get(item["id"], item["reason"]), *SPARED)  # these have rules of their own
    ]


def duplicate_path(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """One way to one reading: no two tools do the same on one device under two names."""
    first: dict[tuple[str, frozenset[str]], str] = {}
    out = []
    for index, tool in enumerate(value["tools"]):
        for name in tool["devices"]:
            before = first.setdefault((name, same_action(tool["name"])), tool["name"])
            if before != tool["name"]:
                summary = f"{display(tool['name'])} and {display(before)} do the same on {display(name)}"
                hint = "keep one of the two capabilities"
                where = pointer("tools", index, "name")
                out.append(error("INTERFACE-DUPLICATE-PATH", summary, pointer=where, hint=hint))
                break
    return out


RULES = (
    Rule("INTERFACE-UNKNOWN-DEVICE", unknown_device),
    Rule("INTERFACE-IDENTIFY-WRONG", identify_blamed),
    Rule("INTERFACE-TOOL-WITHOUT-CAPABILITY", tool_without_capability),
    Rule("INTERFACE-CAPABILITY-WITHOUT-TOOL", capability_without_tool),
    Rule("INTERFACE-DUPLICATE-CAPABILITY", duplicate_capability),
    Rule("INTERFACE-DEVICES-DIFFER", devices_differ),
    Rule("INTERFACE-NAME-CLASH", name_clash),
    Rule("INTERFACE-NAME-PRODUCT", product_in_name),
    Rule("INTERFACE-EFFECT-DIFFERS", effect_differs),
    Rule("INTERFACE-ANNOTATIONS", annotations_contradict),
    Rule("INTERFACE-TOOL-BUDGET", tool_budget),
    Rule("INTERFACE-DEVICE-UNACCOUNTED", device_unaccounted),
    Rule("INTERFACE-LEFT-OUT-TWICE", left_out_twice),
    Rule("INTERFACE-REASON-DIFFERS", reason_differs),
    Rule("INTERFACE-DUPLICATE-PATH", duplicate_path),
    Rule("INTERFACE-BUDGET-UNUSED", budget_unused),
    *bound_rules.RULES,
    *description_rules.RULES,
    *member_units.RULES,
    *parameter_rules.RULES,
    *raw_line_rules.INTERFACE_RULES,
    *raw_line_rules.INTERFACE_STOPS,
    Rule("INTERFACE-UNESCAPED-TEXT", in_values("INTERFACE-UNESCAPED-TEXT")),
)


def _identify(artifacts: Artifacts) -> JsonObject:
    return artifacts.identify or {"devices": [], "left_out": []}


def _known(artifacts: Artifacts) -> dict[str, None]:
    identify = _identify(artifacts)
    return dict.fromkeys(item["id"] for member in ("devices", "left_out") for item in identify[member])


def _owners(artifacts: Artifacts) -> dict[str, set[str]]:
    """Capability name to the ids of the devices that have it."""
    out: dict[str, set[str]] = defaultdict(set)
    for device in _identify(artifacts)["devices"]:
        for capability in device["capabilities"]:
            out[capability["name"]].add(device["id"])
    return dict(out)


def _served(value: JsonObject) -> set[str]:
    return {name for tool in value["tools"] for name in tool["devices"]}


def _spared(value: JsonObject, capability: str) -> set[str]:
    """The devices of which this capability may have no tool: cut for the budget, or not safe to serve."""
    return {
        item["id"]
        for item in value["left_out"]
        if item["reason"] in SPARED and item.get("capability", capability) == capability
    }
