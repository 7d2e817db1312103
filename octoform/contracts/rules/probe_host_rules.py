"""Rules that hold PROBE against the host: the embedded agent looked too, and what it saw is true.

Ids are those by which a tool finds a device later, so an id that the host's own scan does not have is found by no call.
Without a scan (the embedded agent did PROBE itself, or could not look) the rules find nothing.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import display
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, HostScan, JsonObject, Rule
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex

LISTED_AT_ONCE, SHOWN_AT_ONCE = 12, 3
"""How many ids of missing devices one finding names, and how many of them with their names and folders."""
FEW = 3
"""So many devices may be omitted from a small host; of a large one a quarter."""
_NUMBERS = ("vid", "pid")
_PLATFORM = ("os", "os_id", "os_version", "arch", "kernel")
# How package systems call what the kernel calls otherwise.
_ALIASES = {"amd64": "x86_64", "x64": "x86_64", "x86-64": "x86_64", "arm64": "aarch64", "armhf": "armv7l"}
_ALIASES |= {"macosx": "macos", "darwin": "macos", "i386": "i686"}
_WHOLE_TREE = regex(r"/sys/(?:bus|devices)(?:/\*|/?(?=[\s,;:)]|$))|\ball (?:buses|folders|of sysfs)\b")
_FILTER = regex(
    r"(?i)\b(?:not? (?:of )?(?:interest\w*|relevan\w*|useful|needed|controllable|important|use)|irrelevant|dull|boring"
    r"|uninteresting|useless|unimportant|nothing to control|out of scope"
    r"|(?:only|just) (?:infrastructure|an? (?:\w+ )?(?:hub|bridge|bus|controller))"
    r"|no(?:body|t)? (?:one )?(?:would )?(?:asks?|needs?|wants?))\b"
)
# A reason that the host's own scan, which has the same rights, has contradicted.
_DENIED = regex(
    r"(?i)\b(?:permission|access|rights?)\b.*\b(?:denied|refused|lacking|missing)\b|\b(?:needs?|wants) root\b"
)
_LINE = regex(r"(?m)^\s*([A-Za-z][\w.\[\] -]*?)\s*[:=]\s*\"?(.*?)\"?\s*,?$")
_NONE = frozenset({"none", "n/a", "null", "-", "unknown"})


def unknown_device(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """Every device is one that the host shows, under the id by which a tool will find it."""
    if known.scan is None:
        return []
    true = _by_id(known.scan)
    listed = {device["id"] for device in value["devices"]}
    out = []
    for index, device in enumerate(value["devices"]):
        if device["id"] in true or device.get("context") is True:
            continue
        alike = [each for each in true.values() if _alike(device, each)]
        free = [each["id"] for each in alike if each["id"] not in listed]
        summary, hint = _unknown(device, free, [each["id"] for each in alike])
        out.append(error("PROBE-DEVICE-UNKNOWN", summary, pointer=pointer("devices", index, "id"), hint=hint))
    return out


def contradicted(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """The facts of a device and of the platform must be those that the host shows."""
    if known.scan is None:
        return []
    true = _by_id(known.scan)
    taken = {place: each["id"] for each in true.values() for place in _places(each)}
    lines = [
        (*found, pointer("devices", index))
        for index, device in enumerate(value["devices"])
        if device["id"] in true
        for found in (*_differences(device, true[device["id"]], taken), *_misplaced(device, true[device["id"]]))
    ]
    platform, own = value["platform"], known.scan.probe["platform"]
    for name in _PLATFORM:
        if own.get(name) not in (None, "", "unknown") and not _agrees(str(platform.get(name, own[name])), own[name]):
            lines.append((name, display(platform[name]), display(own[name]), "/platform"))
    host, named = str(known.scan.probe.get("hostname", "")), str(value["hostname"])
    if host and named and host.partition(".")[0].casefold() != named.partition(".")[0].casefold():
        lines.append(("hostname", display(named), display(host), ""))
    return [
        error(
            "PROBE-CONTRADICTED",
            f"{member} is {given}, and the host shows {right}",
            pointer=f"{where}/{member.partition('.')[0]}",
            hint=f"write {right}; where the host shows nothing, leave the member out",
        )
        for member, given, right, where in lines
    ]


def missing_device(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """Every device of the host is listed, or omitted with a reason."""
    if known.scan is None:
        return []
    there = {device["id"] for device in value["devices"]} | {each["id"] for each in value.get("left_out", ())}
    missing = [each for each in _by_id(known.scan).values() if _is_single(each) and each["id"] not in there]
    if not missing:
        return []
    count = f"{len(missing)} devices" if len(missing) > 1 else "1 device"
    hint = "list each with what the system shows of it; put what cannot be listed into left_out, with a reason"
    out = []
    # A prompt cuts a long finding, so that each names as many as it can show.
    for first in range(0, len(missing), LISTED_AT_ONCE):
        part = missing[first : first + LISTED_AT_ONCE]
        also = "" if first == 0 else "further "
        summary = (
            f"the host shows {count} that PROBE does not list; {also}ids: {', '.join(each['id'] for each in part)}"
        )
        lines = [f"{each['id']}: {display(each['name'])}, {each['instance']['sysfs']}" for each in part[:SHOWN_AT_ONCE]]
        detail = "\n".join(lines)
        out.append(error("PROBE-DEVICE-MISSING", summary, pointer="/devices", detail=detail, hint=hint))
    return out


def left_out(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """An omitted device must not be listed too; few may be omitted, and looking unimportant is no reason.

    It need not be there any more: a device that went away while the agent looked is reported as gone.
    """
    listed = {device["id"] for device in value["devices"]}
    true = _by_id(known.scan) if known.scan else None
    out = []
    for index, item in enumerate(value.get("left_out", ())):
        name, where = display(item["id"]), pointer("left_out", index, "id")
        if item["id"] in listed:
            found = f"{name} is skipped and listed as well", "take it out of one of the two"
        elif true is not None and item["id"] in true and _DENIED.search(item["reason"]):
            found = f"{name} is skipped because {display(item['reason'])}, and this user may read it", "list it"
        elif _FILTER.search(item["reason"]):
            found = f"{name} is skipped because {display(item['reason'])}: PROBE does not choose", "list it"
        else:
            continue
        out.append(error("PROBE-LEFT-OUT", found[0], pointer=where, hint=found[1]))
    count = sum(item["id"] in (true or {}) for item in value.get("left_out", ()))
    units = sum(map(_is_single, (true or {}).values()))
    if true is not None and count > max(FEW, units // 4):
        summary = f"{count} of the {units} devices of the host are skipped"
        hint = "list them; what cannot be listed for a reason of its own is one device, or two"
        out.append(error("PROBE-LEFT-OUT", summary, pointer="/left_out", hint=hint))
    return out


def scan_untold(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """For every bus and class of which devices are listed, a scan that worked states how they were found."""
    if known.scan is None:
        return []
    worked = [scan for scan in value["scan_methods"] if scan["status"] == "ok"]
    text = " ".join(f"{scan['name']} {scan.get('detail', '')}" for scan in worked).casefold()
    if _WHOLE_TREE.search(text):
        return []
    shared = {device["interface"] for device in known.scan.probe["devices"] if _is_single(device)}
    listed = {device["interface"] for device in value["devices"] if device.get("context") is not True}
    return [
        error(
            "PROBE-SCAN-UNTOLD",
            f"devices on {display(name)} are listed, and no scan that worked shows how they were found",
            pointer="/scan_methods",
            hint="list every way of looking with its status, with the bus or class in its name, "
            f"such as {display(name)}",
        )
        for name in sorted(listed & shared)
        if name != "virtual" and _bare(name) not in _bare(text)
    ]


def scan_false(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """A scan that worked used a program that is here."""
    out = []
    for found in known.scan.untrue if known.scan else ():
        name, why = (
            display(found["program"]),
            "nothing of it was recorded on this host" if found["recorded"] else "it is not here",
        )
        summary = f"the scan {display(value['scan_methods'][found['scan']]['name'])} worked with {name}, and {why}"
        hint = "write not_found, or unsupported on a recorded host; name what really found the devices"
        out.append(error("PROBE-SCAN-FALSE", summary, pointer=pointer("scan_methods", found["scan"]), hint=hint))
    return out


RULES = (
    Rule("PROBE-DEVICE-UNKNOWN", unknown_device),
    Rule("PROBE-CONTRADICTED", contradicted),
    Rule("PROBE-DEVICE-MISSING", missing_device),
    Rule("PROBE-SCAN-UNTOLD", scan_untold),
    Rule("PROBE-SCAN-FALSE", scan_false),
    Rule("PROBE-LEFT-OUT", left_out),
)


def completed(value: JsonObject, scan: HostScan) -> JsonObject:
    """The artifact with the host's own facts on each unit, by which a tool distinguishes it from its twin.

    They are also what is hidden before anything reaches git: a serial number that the agent named nowhere, too. Numbers
    and drivers that it omitted, and the system's own spelling of the bus and the platform, join them. The host's name
    and the time are those of the scan.
    """
    true = _by_id(scan)
    devices = [_filled(device, true[device["id"]]) if device["id"] in true else device for device in value["devices"]]
    own = {name: scan.probe[name] for name in ("hostname", "timestamp") if scan.probe.get(name)}
    known = {name: word for name, word in scan.probe["platform"].items() if name in _PLATFORM and word != "unknown"}
    platform = {**value["platform"], **known}
    return {**value, "platform": platform, **own, "devices": devices}


def _filled(device: JsonObject, true: JsonObject) -> JsonObject:
    """A device with what the host shows of it beside what was stated."""
    facts = {name: true[name] for name in (*_NUMBERS, "drivers") if name in true and name not in device}
    instance = {**device.get("instance", {}), **true["instance"]}
    return {**device, **facts, "interface": true["interface"], "instance": instance}


def _agrees(text: str, own: str) -> bool:
    """Whether a fact of the platform is the same in another spelling: ``Linux``, ``12 (bookworm)``, ``amd64``."""
    spoken = {_ALIASES.get(word, word) for word in re.split(r"[\s(),;]+", text.casefold()) if word}
    return set(re.split(r"\s+", own.casefold())) <= spoken | {text.casefold()}


def _bare(text: str) -> str:
    return re.sub(r"[^0-9a-z/*]", "", text.casefold())


def _by_id(scan: HostScan) -> dict[str, JsonObject]:
    return {device["id"]: device for device in scan.probe["devices"]}


def _is_single(device: JsonObject) -> bool:
    """A unit of the kernel in a place of its own: no neighbour, and no entry that stands for many of a kind."""
    return device.get("context") is not True and {"sysfs", "port"} <= device["instance"].keys()


def _alike(device: JsonObject, true: JsonObject) -> bool:
    """Whether a device of the host is probably the one that is meant: by folder, numbers, driver, or classes."""
    folder = device.get("instance", {}).get("sysfs")
    if folder or (device.get("vid") and device.get("pid")):
        numbers = [device.get(name) for name in _NUMBERS]
        return folder == true["instance"].get("sysfs") or (all(numbers) and numbers == [true.get(n) for n in _NUMBERS])
    if device["interface"] != true["interface"]:
        return False
    # What hangs on no unit has no driver; only its classes identify it.
    same = bool(true.get("classes")) and {*device.get("classes", ())} == {*true["classes"]}
    return bool({*device.get("drivers", ())} & {*true.get("drivers", ())}) or (true["interface"] == "virtual" and same)


def _unknown(device: JsonObject, free: list[str], alike: list[str]) -> tuple[str, str]:
    name = display(device["id"])
    if free:
        hint = f"write {' or '.join(map(display, free[:3]))}, as the system's kinds are called"
        return f"no tool will find {name}: the host calls it {' or '.join(map(display, free[:3]))}", hint
    if alike:
        kinds = ", ".join(map(display, alike[:3]))
        return f"{name} is one too many: all that the host shows of its kind is listed ({kinds})", "take the entry out"
    hint = "take the entry out; what is merely near (a neighbour in the network, a radio in range) has context: true"
    return f"the host shows no device {name}", hint


def _places(device: JsonObject) -> list[tuple[str, str]]:
    """(member, value) of the places at which one device is and no other: its port on its bus, its nodes."""
    instance = device.get("instance", {})
    port = instance.get("port")
    nodes = [("nodes", node["node"]) for node in instance.get("nodes", ()) if "node" in node]
    return [*nodes, *([(f"port {device['interface']}", port)] if port else [])]


def _differences(
    device: JsonObject, true: JsonObject, taken: Mapping[tuple[str, str], str]
) -> Iterator[tuple[str, str, str]]:
    """(member, what is stated, what is true) where a device's entry and the host differ; ``taken`` are all places."""
    for name in _NUMBERS:
        if device.get(name, true.get(name)) != true.get(name):
            yield name, display(device[name]), display(true[name]) if name in true else "none"
    if true["interface"].casefold() not in re.split(r"[^0-9a-z_-]+", device["interface"].casefold()):
        yield "interface", display(device["interface"]), display(true["interface"])
    for name, more in (("classes", True), ("drivers", False)):
        given, shows = {*device.get(name, ())}, {*true.get(name, ())}
        if not given <= shows or (more and given != shows):
            yield name, _listed(device.get(name)), _listed(true.get(name))
    if (device.get("context") is True) != (true.get("context") is True):
        yield "context", str(device.get("context") is True).lower(), str(true.get("context") is True).lower()
    found, own = device.get("instance", {}), true["instance"]
    single = ("sysfs", "serial", "size_bytes", "port") if _is_port(found, own) else ("sysfs", "serial", "size_bytes")
    for name in single:
        if found.get(name) and own.get(name) and found[name] != own[name]:
            yield f"instance.{name}", display(found[name]), display(own[name])
    free = {place for place in _places({**device, "interface": true["interface"]}) if place not in _places(true)}
    free = {place for place in free if "port" not in single or not place[0].startswith("port")}
    for name, place in sorted(each for each in free if taken.get(each, true["id"]) != true["id"]):
        right = [own_place for kind, own_place in _places(true) if kind == name]
        yield f"instance.{name.partition(' ')[0]}", display(place), _listed(right)


def _misplaced(device: JsonObject, true: JsonObject) -> Iterator[tuple[str, str, str]]:
    """(member, line, true line) of each value that the system has under another key, or contradicts."""
    own: dict[str, set[str]] = {}
    for key, text in _LINE.findall(str(true["raw_descriptor"])):
        own.setdefault(key.casefold(), set()).add(_spoken(text))
    for key, text in _LINE.findall(str(device["raw_descriptor"])):
        right, given = own.get(key.casefold(), set()), _spoken(text)
        others = {each for name, texts in own.items() if name != key.casefold() for each in texts}
        wrong = (given in others and any(map(str.isalpha, given))) or given in _NONE
        # A count of a class device (lines, steps, the highest level) does not change.
        wrong = wrong or ("]." in key and given.isdecimal() and any(map(str.isdecimal, right)))
        if right and given not in right and wrong and not right & _NONE:
            yield "raw_descriptor", display(f"{key}: {text}"), display(f"{key}: {min(right)}")


def _spoken(text: str) -> str:
    return " ".join(text.casefold().split())


def _is_port(entry: Mapping[str, Any], own: Mapping[str, Any]) -> bool:
    """Whether a port is spelt as the host spells ports of USB, and so can be another one."""
    return all(re.fullmatch(r"\d+-\d+(?:\.\d+)*", str(each.get("port", ""))) for each in (entry, own))


def _listed(names: list[str] | None) -> str:
    return ", ".join(map(display, sorted(names))) if names else "none"
