"""Rules that hold PROBE against the host: the embedded agent looked too, and what it saw is true.

Ids are those by which a tool finds a device later, so an id that the host's own scan does not have is found by no call.
Without a scan (the embedded agent did PROBE itself, or could not look) the rules find nothing.
"""

from collections.abc import Iterator

from octoform.contracts.model import Artifacts, HostScan, JsonObject, Rule
from octoform.contracts.text import pointer, shown
from octoform.diagnostics import Diagnostic, error

MOST_LISTED = 200
_NUMBERS = ("vid", "pid")
_COPY = (
    "copy what the system says, letter by letter; what the device is, the next stage says, and a reading that changes "
    "stands nowhere"
)
_PLATFORM = ("os", "os_id", "os_version", "arch", "kernel")


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
    """What is said of a device and of the platform is what the host shows."""
    if known.scan is None:
        return []
    true = _by_id(known.scan)
    said = [
        (*found, pointer("devices", index))
        for index, device in enumerate(value["devices"])
        if device["id"] in true
        for found in _differences(device, true[device["id"]])
    ]
    platform, own = value["platform"], known.scan.probe["platform"]
    for name in _PLATFORM:
        if own.get(name) not in (None, "", "unknown") and platform.get(name, own[name]) != own[name]:
            said.append((name, shown(platform[name]), shown(own[name]), "/platform"))
    return [
        error(
            "PROBE-CONTRADICTED",
            f"{member} is {given}, and the host shows {right}",
            pointer=f"{where}/{member.partition('.')[0]}",
            hint=f"write {right}; where the host shows nothing, leave the member out",
        )
        for member, given, right, where in said
    ]


def missing_device(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """Every device of the host is listed, or left out with a reason."""
    if known.scan is None:
        return []
    there = {device["id"] for device in value["devices"]} | {each["id"] for each in value.get("left_out", ())}
    missing = [each for each in _by_id(known.scan).values() if _stands_alone(each) and each["id"] not in there]
    if not missing:
        return []
    lines = [f"{each['id']}: {shown(each['name'])}, {each['instance']['sysfs']}" for each in missing[:MOST_LISTED]]
    if len(missing) > MOST_LISTED:
        lines.append(f"and {len(missing) - MOST_LISTED} more")
    count = f"{len(missing)} devices" if len(missing) > 1 else "1 device"
    hint = "list each with what the system says of it; what you mean to leave out stands in left_out, with a reason"
    summary = f"the host shows {count} that PROBE does not list"
    return [error("PROBE-DEVICE-MISSING", summary, pointer="/devices", detail="\n".join(lines), hint=hint)]


def listed_and_left_out(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """What is left out is not listed all the same."""
    listed = {device["id"] for device in value["devices"]}
    return [
        error(
            "PROBE-LEFT-OUT",
            f"{shown(item['id'])} is left out and listed as well",
            pointer=pointer("left_out", index, "id"),
            hint="take it out of one of the two",
        )
        for index, item in enumerate(value.get("left_out", ()))
        if item["id"] in listed
    ]


def scan_untold(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """For every bus and class of which devices are listed, a scan that worked says how they were found."""
    if known.scan is None:
        return []
    worked = [scan for scan in value["scan_methods"] if scan["status"] == "ok"]
    told = " ".join(f"{scan['name']} {scan.get('detail', '')}" for scan in worked).casefold()
    shared = {device["interface"] for device in known.scan.probe["devices"] if _stands_alone(device)}
    listed = {device["interface"] for device in value["devices"] if device.get("context") is not True}
    return [
        error(
            "PROBE-SCAN-UNTOLD",
            f"devices on {shown(name)} are listed, and no scan that worked says how they were found",
            pointer="/scan_methods",
            hint=f"list every way of looking with its status, with the bus or class in its name, such as {shown(name)}",
        )
        for name in sorted(listed & shared)
        if name != "virtual" and name.casefold() not in told
    ]


def text_not_of_host(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """The words of a device's texts are those of the system: no interpretation, no reading, nothing from memory."""
    if known.scan is None:
        return []
    places = {device["id"]: (index, device) for index, device in enumerate(value["devices"])}
    out = []
    for found in known.scan.unsaid:
        index, device = places[found["id"]]
        text = str(device.get(found["member"], "")).splitlines() or [""]
        line = text[min(found["line"], len(text)) - 1]
        place = f"line {found['line']} of {found['member']}" if len(text) > 1 else found["member"]
        words = ", ".join(shown(word) for word in found["words"][:8])
        summary = f"{place} of {shown(device['id'])} is {shown(line)}; the system says nowhere of it: {words}"
        where = pointer("devices", index, found["member"])
        out.append(error("PROBE-TEXT-NOT-OF-HOST", summary, pointer=where, hint=_COPY))
    return out


RULES = (
    Rule("PROBE-DEVICE-UNKNOWN", unknown_device),
    Rule("PROBE-CONTRADICTED", contradicted),
    Rule("PROBE-DEVICE-MISSING", missing_device),
    Rule("PROBE-SCAN-UNTOLD", scan_untold),
    Rule("PROBE-LEFT-OUT", listed_and_left_out),
    Rule("PROBE-TEXT-NOT-OF-HOST", text_not_of_host),
)


def completed(value: JsonObject, scan: HostScan) -> JsonObject:
    """The artifact with the host's own facts on each specimen, by which a tool tells it from its twin.

    They are also what is hidden before anything reaches git: a serial number that the agent named nowhere, too.
    """
    true = _by_id(scan)
    devices = [
        {**device, "instance": {**device.get("instance", {}), **true[device["id"]]["instance"]}}
        if device["id"] in true
        else device
        for device in value["devices"]
    ]
    own = scan.probe.get("hostname")
    return {**value, **({"hostname": own} if own else {}), "devices": devices}


def _by_id(scan: HostScan) -> dict[str, JsonObject]:
    return {device["id"]: device for device in scan.probe["devices"]}


def _stands_alone(device: JsonObject) -> bool:
    """A unit of the kernel in a place of its own: no neighbour, and no entry that stands for many of a kind."""
    return device.get("context") is not True and {"sysfs", "port"} <= device["instance"].keys()


def _alike(device: JsonObject, true: JsonObject) -> bool:
    """Whether a device of the host is probably the one that is meant: by its folder, its numbers, or its driver."""
    folder = device.get("instance", {}).get("sysfs")
    if folder or (device.get("vid") and device.get("pid")):
        numbers = [device.get(name) for name in _NUMBERS]
        return folder == true["instance"].get("sysfs") or (all(numbers) and numbers == [true.get(n) for n in _NUMBERS])
    return bool({*device.get("drivers", ())} & {*true.get("drivers", ())}) and device["interface"] == true["interface"]


def _unknown(device: JsonObject, free: list[str], alike: list[str]) -> tuple[str, str]:
    name = shown(device["id"])
    if free:
        hint = f"write {' or '.join(map(shown, free[:3]))}, as the system's kinds are called"
        return f"no tool will find {name}: the host calls it {' or '.join(map(shown, free[:3]))}", hint
    if alike:
        kinds = ", ".join(map(shown, alike[:3]))
        return f"{name} is one too many: all that the host shows of its kind is listed ({kinds})", "take the entry out"
    hint = "take the entry out; what is merely near (a neighbour in the network, a radio in range) has context: true"
    return f"the host shows no device {name}", hint


def _differences(device: JsonObject, true: JsonObject) -> Iterator[tuple[str, str, str]]:
    """(member, what is said, what is true) where a device's entry and the host differ."""
    for name in _NUMBERS:
        if device.get(name, true.get(name)) != true.get(name):
            yield name, shown(device[name]), shown(true[name]) if name in true else "none"
    if {*device.get("classes", ())} != {*true.get("classes", ())}:
        yield "classes", _listed(device.get("classes")), _listed(true.get("classes"))
    if not {*device.get("drivers", ())} <= {*true.get("drivers", ())}:
        yield "drivers", _listed(device.get("drivers")), _listed(true.get("drivers"))
    if (device.get("context") is True) != (true.get("context") is True):
        yield "context", str(device.get("context") is True).lower(), str(true.get("context") is True).lower()
    said, own = device.get("instance", {}), true["instance"]
    for name in ("sysfs", "serial"):
        if said.get(name) and own.get(name) and said[name] != own[name]:
            yield f"instance.{name}", shown(said[name]), shown(own[name])


def _listed(names: list[str] | None) -> str:
    return ", ".join(map(shown, sorted(names))) if names else "none"
