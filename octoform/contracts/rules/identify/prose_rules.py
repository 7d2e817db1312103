"""Rules for the free text of IDENTIFY: it describes kinds, orders no one anything, and names no place of one host.

Names and descriptions are read by the agents of the stages behind, by people, and by the models that call the tools.
A sentence that gives orders acts on them, and a node or an address is another one after the next re-plug. What a
device reports of itself may be quoted as it stands, however it sounds: a string that PROBE holds is never a finding
here.
"""

from collections.abc import Iterator
from typing import Any

from octoform.base.escaping import display
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.name_clues import tokens
from octoform.contracts.rules.identify import answer_rules
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex

_ORDERS = regex(
    r"(?i)\b(?:ignore|disregard|override|bypass|forget)\b[^.;\n]{0,40}"
    r"\b(?:instruct\w*|rules?|polic\w+|limits?|budget|contracts?|specs?|guards?|safety|previous|prior|above|prompts?)\b"
    r"|\byou (?:must|should|have to|are (?:now|allowed|to|the|a|an)|need to|may not|will)\b"
    r"|\b(?:disable|turn off|remove|lift|skip|bypass|suspend)\b[^.;\n]{0,30}"
    r"\b(?:safety|confirmations?|consent|guards?|safeguards?|polic\w+|limits)\b"
    r"|\b(?:always|never|important|first|please|then|afterwards)\b[^.;\n]{0,20}\b(?:call|invoke) \w+"
    r"|\b(?:next|later|following|other) stages?\b"
    r"|\b(?:system|developer) prompt\b|\bprevious instructions\b"
    r"|\b(?:do not|don't|never|without) (?:ask|confirm|consent|tell|warn|approv|permission|authori[sz]|a? ?human)\w*"
    r"|\bwithout (?:the |any |your |its )?(?:user|owner|caller|person|human|operator)s?'?"
    r" ?(?:consent|confirmation|approval)\b"
    r"|\b(?:assistant|agent|model|claude|gpt)\s*[:,]\s*(?:please\b|call\b|set\b|run\b|write\b)"
    r"|\bsudo \w+|\b(?:run|execute|type|paste|enter) (?:the command\b|[`$#])"
    r"|\b(?:ignoriere|ignorez|ignora) (?:alle|alles|toutes|todas|tutte)\b"
    r"|\u5ffd\u7565|\u0438\u0433\u043d\u043e\u0440\u0438\u0440\u0443"
)
_CALLS = regex(r"(?i)\b(?:call|invoke|run|use) [a-z]+(?:_[a-z0-9]+)+\b")
_PLACES = regex(
    r"/dev/(?:\w+/)*by-(?:id|path|uuid|label)/\S+|\busb\d+/\d+-\d+\S*|\b(?:plug)?hw:\d+(?:,\d+)*\b|/dev/(?:[\w.-]+/)*[a-z_-]*\d[\w:.-]*(?![\w*{<])|/dev/sd[a-z]\b"
    r"|/sys/devices/\S+|/sys/class/\w+/[\w.:-]*\d\b(?![*{<])"
    r"|\btty(?:USB|ACM|S|AMA|XRUSB|O)\d+\b|\bCOM\d+\b|\b(?:video|hwmon|hidraw|gpiochip|nvme\dn|event|i2c-)\d+\b"
    r"|\b[0-9a-f]{4}:[0-9a-f]{2}:[0-9a-f]{2}\.[0-7]\b|\b(?:[0-9A-Fa-f]{2}:){5}[0-9A-Fa-f]{2}\b"
    r"|(?<![\w.])(?<!version )(?<!firmware )(?:25[0-5]|2[0-4]\d|1?\d?\d)(?:\.(?:25[0-5]|2[0-4]\d|1?\d?\d)){3}(?![\w.])"
    r"|\b(?:usb )?(?:port|bus) \d+-\d+(?:\.\d+)*\b"
)
_INPUT = regex(r"\binput\d+\b")
_ADDRESSED = frozenset({"address", "addr", "mac"})
_CURES = {
    "identified_as": "name it as a person would, by what it is",
    "says": "write what follows from the quote",
    "description": "describe what the capability does",
    "missing": "ask the owner one question",
}
_PLACE_HINT = "take it out: a device is found by its id at every call, through `runtime`; name the class in its stead"


def orders(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """No text gives orders to anyone who reads it."""
    out = []
    for device, member, where, text in _texts(value):
        found = _ORDERS.search(text) or (_CALLS.search(text) if member == "identified_as" else None)
        if found and not _is_quoted(found[0], device, artifacts):
            cure = _CURES.get(member, "describe it")
            hint = f"{cure}; the stages' rules and the owner's policy define what others may do"
            summary = f"{display(text)} gives orders: {display(found[0])}"
            out.append(error("IDENTIFY-ORDERS-IN-TEXT", summary, pointer=pointer(*where), hint=hint))
    return out


def places(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """No text names a node, a port or an address of this host."""
    out = []
    for device, _, where, text in _texts(value):
        for found in _PLACES.finditer(text):
            if not _is_quoted(found[0], device, artifacts):
                summary = f"{display(text)} names a place of this host: {display(found[0])}"
                out.append(error("IDENTIFY-PLACE-IN-TEXT", summary, pointer=pointer(*where), hint=_PLACE_HINT))
                break
    return [*out, *_nodes(value, artifacts), *_addresses(value, artifacts)]


def _nodes(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """No text has the kernel's name of one of the device's inputs, which is another one after the next start."""
    named = {
        device["id"]: {str(node.get("name")) for node in (device.get("instance") or {}).get("nodes", ())}
        for device in (artifacts.probe or {}).get("devices", ())
    }
    return [
        error(
            "IDENTIFY-PLACE-IN-TEXT",
            f"{display(text)} names a place of this host: {display(found)}",
            pointer=pointer(*where),
            hint=_PLACE_HINT,
        )
        for device, _, where, text in _texts(value)
        for found in sorted(set(_INPUT.findall(text)) & named.get(device, set()))
        if not _is_quoted(found, device, artifacts)
    ]


def _addresses(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """No parameter of a capability is the address at which one copy of a device answers."""
    return [
        error(
            "IDENTIFY-PLACE-IN-TEXT",
            f"the parameter {display(name)} of {display(capability['name'])} is an address: {display(item)}",
            pointer=pointer("devices", index, "capabilities", at, "parameters"),
            hint=_PLACE_HINT,
        )
        for index, device in enumerate(value["devices"])
        if "profile" not in device
        for at, capability in enumerate(device["capabilities"])
        for name, item in _members(capability.get("parameters", {}))
        if _ADDRESSED.intersection(tokens(name)) and any(map(str.isdigit, str(item)))
        if not _is_quoted(str(item), device["id"], artifacts)
    ]


def is_foreign(text: str, device: str, artifacts: Artifacts) -> bool:
    """Whether a name is a finding of these rules, so that its words are not looked up."""
    found = [item[0] for item in (_ORDERS.search(text), _CALLS.search(text), _PLACES.search(text)) if item]
    return any(not _is_quoted(each, device, artifacts) for each in found)


RULES = (
    Rule("IDENTIFY-ORDERS-IN-TEXT", orders),
    Rule("IDENTIFY-PLACE-IN-TEXT", places),
)

Where = tuple[str | int, ...]


def _texts(value: JsonObject) -> Iterator[tuple[str, str, Where, str]]:
    """(device, member, where, text) of all that is written freely; quotes are copies and are omitted."""
    for index, device in enumerate(value["devices"]):
        here: Where = ("devices", index)
        yield device["id"], "identified_as", (*here, "identified_as"), device["identified_as"]
        if "missing" in device:
            yield device["id"], "missing", (*here, "missing"), device["missing"]
        for at, evidence in enumerate(device["evidence"]):
            yield device["id"], "says", (*here, "evidence", at, "says"), evidence.get("says", "")
        for at, capability in enumerate(device["capabilities"] if "profile" not in device else ()):
            place: Where = (*here, "capabilities", at)
            for member in ("description", "via"):
                yield device["id"], member, (*place, member), capability[member]
            for text in _leaves(capability.get("parameters", {})):
                yield device["id"], "parameters", (*place, "parameters"), text
    for index, item in enumerate(value["left_out"]):
        yield item["id"], "detail", ("left_out", index, "detail"), item.get("detail", "")


def _leaves(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, item in value.items():
            yield str(name)
            yield from _leaves(item)
    elif isinstance(value, list):
        for item in value:
            yield from _leaves(item)


def _members(value: Any) -> Iterator[tuple[str, str | int]]:
    """(name, value) of each plain member, at any depth."""
    items = value.items() if isinstance(value, dict) else ()
    for name, item in items:
        if isinstance(item, str | int) and not isinstance(item, bool):
            yield str(name), item
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    for item in inner:
        yield from _members(item)


def _is_quoted(text: str, device: str, artifacts: Artifacts) -> bool:
    """Whether a piece of text is in what PROBE reports of the device, or in its owner's answer."""
    probed = next((each for each in (artifacts.probe or {}).get("devices", ()) if each["id"] == device), None)
    own = [probed["name"], probed["raw_descriptor"]] if probed else []
    known = " ".join(" ".join((*own, *answer_rules.texts(device, artifacts))).split())
    return " ".join(text.split()) in known
