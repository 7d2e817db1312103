"""Rules for PROBE: everything that the operating system shows, nothing more, and no unit's marks in a kind.

PROBE may look and not touch. It runs before anybody knows what the devices are, so a terminal line that is opened
here may reset a board or move an arm.
"""

import re
from collections.abc import Iterator

from octoform.base.clock import parse_stamp
from octoform.base.escaping import display, listed
from octoform.base.shape import pointer
from octoform.contracts.host_identity import secrets_of
from octoform.contracts.model import Artifacts, HostScan, JsonObject, Rule
from octoform.contracts.name_words import without_escapes
from octoform.contracts.rules.text_rules import in_values
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex

_NEIGHBOURHOODS = frozenset(
    {"network", "neighbour", "neighbor", "arp", "ndp", "mdns", "dnssd", "bonjour", "ssdp", "upnp", "lan", "wlan"}
    | {"wifi", "wi-fi", "ssid", "ble", "bluetooth-scan", "dhcp"}
)
_MULTILINE = frozenset({"raw_descriptor", "detail"})
_KERNEL_PATH = regex(r"(?:/sys|/proc|/run/udev|/host/sys|/host/proc)/\S*")
_TERMINAL = regex(
    r"/dev/(?:tty|cu\.|serial)|\btty(?:S|USB|ACM|AMA|XR|O)\d*\b|\bCOM\d+\b|\bserial (?:port|line)s?\b", re.I
)
_TOUCHED = regex(
    r"\b(?:open(?:ed|ing|s)?|wrote|writ(?:e|es|ing|ten)|sent|send(?:s|ing)?|quer(?:y|ied|ying)|pinged|handshake"
    r"|read(?:ing|s)? from|replied|repl(?:y|ies)|answered|at \d+ baud|\d+ baud|stty|minicom|picocom|pyserial)\b",
    re.I,
)
_INSTALLED = regex(
    r"\b(?:apt(?:-get)?|dnf|yum|apk|brew|pip[0-9.]*|npm|snap|zypper|pacman)\b[^.;,\n]*\b(?:install|add|-S)\b"
    r"|\b(?:installed|installing|downloaded|compiled|built)\b[^.;,\n]*\b(?:first|for this|to (?:scan|list|read|look))\b"
    r"|\binstall(?:ed|ing)?\b[^.;,\n]*\b(?:apt|dnf|yum|apk|brew|pip|npm|snap|zypper|pacman)\b"
    r"|\b(?:modprobe|insmod|rmmod)\b|\bloaded (?:the )?(?:module|driver)\b"
    r"|(?:>|\btee)\s*/(?:sys|proc)/|\b(?:unbound|rescanned|re-?scan of|power-cycled)\b"
    r"|\budevadm (?:trigger|control)\b",
    re.I,
)
_PORT_SCAN = regex(
    r"\b(?:nmap|masscan|zmap|rustscan|arp-scan|netdiscover|fping|nbtscan)\b|\bport[- ]?scan|\b(?:ping|scan)\w* sweep"
    r"|\bscan\w* (?:the )?(?:open )?(?:ports|subnet|network)\b"
    r"|\bbluetoothctl (?:--timeout \d+ )?scan\b|\bhcitool (?:le)?scan\b|\biw(?:list)? (?:dev )?\S+ scan\b(?! dump)"
    r"|\b(?:ssh|telnet|snmp\w*|arping) (?:to|into|-\w|\d|the)|\bping(?:ed)? (?:-\w|\d|each|all|every|the)"
    r"|\blogged in(?:to)?\b|\bwifi rescan\b|--rescan yes|\bws-?discovery\b|\bm-search\b"
    r"|\bsent\b[^.;,\n]*\b(?:network|subnet|broadcast|multicast)\b",
    re.I,
)
_RIGHTS = regex(r"\b(?:sudo|doas|pkexec|setcap|su -|as root by)\b", re.I)
# Nodes that are opened to take something from them, and buses on which something is sent to find out who answers.
_OPENED = regex(
    r"\b(?:sent|wrote|queried|pinged)\b[^.;,\n]*\b(?:bus|servos?|motors?|boards?|ids?|device)\b|"
    r"\b(?:captured|grabbed|recorded|streamed|took|played|displayed|printed)\b[^.;,\n]*\b(?:frame|picture|image|photo"
    r"|sample|sound|audio|clip|video|page|tone)s?\b|\bi2cdetect\b(?=[^.;\n]*\s-(?!l\b|V\b|F\b)\w)|\bevtest\b"
    r"|\bi2c(?:get|set|dump|transfer)\b|\bdd if=/dev|\bopened\b[^.;,\n]*/dev/(?!tty|cu\.|serial)|\bspidev_test\b"
    r"|\bgpio(?:get|set|mon)\b|\bsmartctl (?:-t|--test)",
    re.I,
)
_DENIAL = regex(r"\b(?:no|not|never|none|without|nothing|neither|nor|cannot|refused|skipped)\b", re.I)
_REPLY_KEYS = frozenset({"reply", "response", "received", "answer", "banner", "handshake", "sent", "rx", "tx"})
# Where a unit is attached on USB or I2C, on PCI, or on SCSI. Other buses' names (a GUID, a bus number) may be kinds.
_ADDRESS = regex(r"(?<![0-9a-z])(?:(?:\d{1,3}-){3}\d{1,3}|(?:[0-9a-f]{2}-){5}[0-9a-f]{2})(?![0-9a-z])")
_PORT = regex(r"\d+-\d+(?:\.\d+)*|[0-9a-f]{4}:[0-9a-f]{2}:[0-9a-f]{2}\.[0-7]|\d+:\d+:\d+:\d+")


def duplicate_id(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Each device id stands once."""
    return _repeated(value["devices"], "id", "devices", "PROBE-DUPLICATE-ID", "give each unit its own ordinal")


def duplicate_scan(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Each scan is listed once, with its one status."""
    hint = "list a scan once, with the status that it ended with"
    return _repeated(value["scan_methods"], "name", "scan_methods", "PROBE-DUPLICATE-SCAN", hint)


def no_working_scan(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Devices come from a scan that worked."""
    if not value["devices"] or any(scan["status"] == "ok" for scan in value["scan_methods"]):
        return []
    summary = f"{len(value['devices'])} devices are listed, but no scan has the status ok"
    hint = "list every scan that was run; at least one of them found these devices"
    return [error("PROBE-NO-WORKING-SCAN", summary, pointer="/scan_methods", hint=hint)]


def neighbour_not_context(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """A device that is merely near (network, radio) carries ``context: true``, and nothing that is attached does."""
    out = []
    true = {device["id"] for device in known.scan.probe["devices"]} if known.scan else None
    for index, device in enumerate(value["devices"]):
        words = set(re.split(r"[\s_/:.]+", device["interface"].casefold()))
        attached = [*device.get("classes", ()), *device.get("drivers", ())]
        if words & _NEIGHBOURHOODS and device.get("context") is not True:
            summary = (
                f"{display(device['id'])} was seen over {display(device['interface'])} and is not marked as context"
            )
            hint = "set context to true: a neighbour is surroundings, not a device of this host"
        elif device.get("context") is True and attached and true is not None and device["id"] not in true:
            summary = f"{display(device['id'])} is marked as context, and has {listed(attached)} of this host"
            hint = "leave context out for what is attached; a neighbour has neither drivers nor classes here"
        else:
            continue
        where = pointer("devices", index)
        out.append(error("PROBE-NEIGHBOUR-NOT-CONTEXT", summary, pointer=where, hint=hint))
    return out


def tty_opened(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """No scan shows opening, reading or writing a terminal line."""
    out = []
    for index, scan in enumerate(value["scan_methods"]):
        for member in ("name", "detail"):
            if _claims_to_touch(scan.get(member, "")):
                out.append(_touched(scan[member], pointer("scan_methods", index, member)))
    for index, device in enumerate(value["devices"]):
        if "tty" not in device.get("classes", ()):
            continue
        for line in device["raw_descriptor"].splitlines():
            if line.partition(":")[0].strip().casefold() in _REPLY_KEYS:
                out.append(_touched(line, pointer("devices", index, "raw_descriptor")))
    return out


def installed(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """No scan shows installing, loading or changing something: PROBE uses what is there."""
    hint = "use what is here and change nothing; a way that would have to be installed first is not_found"
    return _claims(value, _INSTALLED, "PROBE-INSTALLED", "PROBE may install, load and change nothing", hint)


def port_scan(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """No scan goes through a network: neighbours are what the system already knows of."""
    hint = "take neighbours from what the system already knows (its tables), and mark them as context"
    return _claims(value, _PORT_SCAN, "PROBE-NETWORK-SCAN", "PROBE may not search a network", hint)


def rights(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """No scan shows rights that were asked for."""
    hint = "look with the rights that you have; what wants others has the status denied"
    return _claims(value, _RIGHTS, "PROBE-RIGHTS", "PROBE may ask for no rights", hint)


def device_opened(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """No scan shows using a device or of asking a bus who answers."""
    hint = "read what the kernel already shows; open no device, and send nothing on a bus to find out who answers"
    return _claims(value, _OPENED, "PROBE-DEVICE-OPENED", "PROBE may open no device", hint)


def timestamp(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """The time is one, with its offset from UTC."""
    moment = parse_stamp(value["timestamp"], zone=None)
    if moment is not None and moment.tzinfo is not None:
        return []
    why = "is no time" if moment is None else "has no offset"
    summary = f"the timestamp {display(value['timestamp'])} {why}"
    hint = "write the time at which you looked, in UTC and in the form 2026-01-31T12:34:56Z"
    return [error("PROBE-TIMESTAMP", summary, pointer="/timestamp", hint=hint)]


def serial_in_id(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """An id is a kind with an ordinal, never made of a serial number or an address."""
    out = []
    for index, device in enumerate(value["devices"]):
        if device.get("context") is True and _ADDRESS.search(device["id"]):
            summary = f"the id {display(device['id'])} is made of an address"
            hint = "build the id from the kind, such as bus and service, and add an ordinal"
            out.append(error("PROBE-SERIAL-IN-ID", summary, pointer=pointer("devices", index, "id"), hint=hint))
        bare = _bare(device["id"])
        for member, secret in secrets_of(device.get("instance", {})):
            mark = _bare(secret)
            if len(mark) >= 6 and any(item.isdigit() for item in mark) and len(set(mark)) > 2 and mark in bare:
                summary = f"the id {display(device['id'])} contains the device's own {member}"
                hint = "build the id from the kind, such as bus, vendor and product, and add an ordinal"
                out.append(error("PROBE-SERIAL-IN-ID", summary, pointer=pointer("devices", index, "id"), hint=hint))
    return out


def port_in_id(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """An id does not say where the device is plugged in."""
    out = []
    for index, device in enumerate(value["devices"]):
        port = str(device.get("instance", {}).get("port", "")).casefold()
        if len(port) < 5 or not _PORT.fullmatch(port):
            continue
        if f"-{_dashed(port)}-" in f"-{_dashed(device['id'])}-":
            summary = f"the id {display(device['id'])} contains the port {display(port)}"
            hint = "build the id from the kind; a device that is plugged in elsewhere keeps its id"
            out.append(error("PROBE-PORT-IN-ID", summary, pointer=pointer("devices", index, "id"), hint=hint))
    return out


RULES = (
    Rule("PROBE-DUPLICATE-ID", duplicate_id),
    Rule("PROBE-DUPLICATE-SCAN", duplicate_scan),
    Rule("PROBE-NO-WORKING-SCAN", no_working_scan),
    Rule("PROBE-NEIGHBOUR-NOT-CONTEXT", neighbour_not_context),
    Rule("PROBE-TTY-OPENED", tty_opened),
    Rule("PROBE-INSTALLED", installed),
    Rule("PROBE-NETWORK-SCAN", port_scan),
    Rule("PROBE-RIGHTS", rights),
    Rule("PROBE-DEVICE-OPENED", device_opened),
    Rule("PROBE-TIMESTAMP", timestamp),
    Rule("PROBE-UNESCAPED-TEXT", in_values("PROBE-UNESCAPED-TEXT", _MULTILINE)),
    Rule("PROBE-SERIAL-IN-ID", serial_in_id),
    Rule("PROBE-PORT-IN-ID", port_in_id),
)


def _repeated(items: list[JsonObject], member: str, name: str, code: str, hint: str) -> list[Diagnostic]:
    first: dict[str, int] = {}
    out = []
    for index, item in enumerate(items):
        before = first.setdefault(item[member], index)
        if before != index:
            summary = f"{name}[{index}] has the {member} {display(item[member])}, as {name}[{before}] has"
            out.append(error(code, summary, pointer=pointer(name, index, member), hint=hint))
    return out


def _claims_to_touch(text: str) -> bool:
    for clause in re.split(r"[.;\n,](?:\s|$)", _KERNEL_PATH.sub(" ", text)):
        if _TERMINAL.search(clause) and _TOUCHED.search(clause) and not _DENIAL.search(clause):
            return True
    return False


def _claims(value: JsonObject, words: re.Pattern[str], code: str, rule: str, hint: str) -> list[Diagnostic]:
    """An error for each scan whose name or detail mentions touching a device, unless it denies it."""
    out = []
    for index, scan in enumerate(value["scan_methods"]):
        for member in ("name", "detail"):
            clauses = re.split(r"[.;\n,](?:\s|$)", scan.get(member, ""))
            if scan["status"] != "not_found" and any(
                words.search(each) and not _DENIAL.search(each) for each in clauses
            ):
                where = pointer("scan_methods", index, member)
                out.append(error(code, f"{rule}: {display(scan[member])}", pointer=where, hint=hint))
    return out


def _touched(text: str, where: str) -> Diagnostic:
    summary = f"PROBE may not open a terminal line: {display(text)}"
    hint = "read what the kernel already shows about the line and leave the line itself closed"
    return error("PROBE-TTY-OPENED", summary, pointer=where, hint=hint)


def _bare(text: str) -> str:
    return re.sub(r"[^0-9a-z]", "", text.casefold())


def _dashed(text: str) -> str:
    return re.sub(r"[^0-9a-z]+", "-", text.casefold())


# Rules that hold the words of PROBE against the host: nothing more, nothing less, and no marks of one copy.
#
# The next stage quotes from these texts and sees nothing else. A word from memory would come back as evidence, a string
# that is missing is lost for good, and a node or a port makes two equal hosts differ. Without a scan the rules find
# nothing.

_COPY = (
    "copy what the system shows, letter by letter; the next stage decides what the device is; "
    "write a reading that changes nowhere"
)
_ALONE = "it belongs in `instance` alone, so that two hosts of the same kind have the same text; take it out"
_WORD = regex(r"[^\W_]+")
_REDACTED = regex(r"<\w+>")
_NUMBERED = regex(r"[A-Za-z][A-Za-z0-9]*?\d+(?:[a-z]\d+)*")
_ON_THE_BUS = regex(r"(?i)\bbus \d{3} device \d{3}\b")
_PCI_PLACE = regex(r"[0-9a-f]{4}:[0-9a-f]{2}:[0-9a-f]{2}\.[0-7]")
_PLACE_KEY = regex(r"(?i)^\W*(?:\w+[._ ])*(?:port|slot|bus ?num|dev ?num|dev ?path|place|location|path)\b\W*:")
# Folders of these classes are numbered as they come up; other names in a node's list may be a kind's own.
_COUNTED = frozenset(
    {"hwmon", "input", "video4linux", "tty", "block", "nvme", "sound", "hidraw", "iio", "rtc", "media"}
)


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
        words = ", ".join(display(word) for word in found["words"][:8])
        summary = f"{place} of {display(device['id'])} is {display(line)}; the system does not show of it: {words}"
        where = pointer("devices", index, found["member"])
        out.append(error("PROBE-TEXT-NOT-OF-HOST", summary, pointer=where, hint=_COPY))
    return out


def text_missing(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """The system's name for a device must be among its facts: no later stage can look it up."""
    out = []
    for index, device, true in _pairs(value, known.scan):
        names = {word for text in _strings(device) for word in _words(text)}
        lost = [word for word in _words(true["name"]) if word not in names and len(word) > 1]
        if lost and not set(_words(true["interface"])) >= set(lost) and set(lost) != {"device"}:
            summary = f"the text of {display(device['id'])} has nothing of {', '.join(map(display, lost[:6]))}"
            hint = f"copy the system's own strings: it is called {display(true['name'])} there"
            where = pointer("devices", index, "raw_descriptor")
            out.append(error("PROBE-TEXT-MISSING", summary, pointer=where, hint=hint))
    return out


def instance_in_text(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """A node, a path or a port is in no text of a device."""
    out = []
    for index, device, true in _pairs(value, known.scan):
        own = f"{true['name']}\n{true['raw_descriptor']}"
        marks = [mark for mark in _marks(true["instance"]) if not re.search(_whole(mark), own)]
        port = str(true["instance"].get("port", ""))
        for member in ("name", "raw_descriptor"):
            for line in str(device[member]).splitlines():
                mark = next((mark for mark in marks if re.search(_whole(mark), line)), None)
                if mark is None and (found := _ON_THE_BUS.search(line)):
                    mark = found[0]
                if mark is None and len(port) > 2 and _PLACE_KEY.match(line) and re.search(_whole(port), line):
                    mark = port
                if mark is not None:
                    summary = f"{display(line)} shows where this copy of {display(device['id'])} is: {display(mark)}"
                    where = pointer("devices", index, member)
                    out.append(error("PROBE-INSTANCE-IN-TEXT", summary, pointer=where, hint=_ALONE))
    return out


TEXT_RULES = (
    Rule("PROBE-INSTANCE-IN-TEXT", instance_in_text),
    Rule("PROBE-TEXT-NOT-OF-HOST", text_not_of_host),
    Rule("PROBE-TEXT-MISSING", text_missing),
)


def _pairs(value: JsonObject, scan: HostScan | None) -> Iterator[tuple[int, JsonObject, JsonObject]]:
    """(index, device, what the host shows of it) of the devices that the host has in a place of their own."""
    true = {each["id"]: each for each in scan.probe["devices"]} if scan else {}
    for index, device in enumerate(value["devices"]):
        own = true.get(device["id"])
        if own is not None and {"sysfs", "port"} <= own["instance"].keys() and own.get("context") is not True:
            yield index, device, own


def _strings(device: JsonObject) -> Iterator[str]:
    for name in ("id", "name", "interface", "raw_descriptor", "vid", "pid"):
        yield str(device.get(name, ""))
    yield from device.get("drivers", ())
    yield from device.get("classes", ())


def _words(text: str) -> list[str]:
    """The words of a string in small letters, escapes and what was hidden omitted; ``0x1F00`` is 1f00."""
    return [word.removeprefix("0x") for word in _WORD.findall(_REDACTED.sub(" ", without_escapes(text)).casefold())]


def _marks(instance: JsonObject) -> list[str]:
    """The parts of a device's place with an unmistakable form: paths, nodes, a place on PCI."""
    marks = [str(instance["sysfs"]), *instance.get("paths", ())]
    for node in instance.get("nodes", ()):
        marks += [node["node"]] if "node" in node else []
        counted = "node" in node or node["class"] in _COUNTED
        marks += [node["name"]] if counted and _NUMBERED.fullmatch(node["name"]) else []
    port = str(instance.get("port", ""))
    return [*marks, *([port] if _PCI_PLACE.fullmatch(port) else [])]


def _whole(mark: str) -> str:
    """A pattern for a mark as a word of its own, at whose end a longer path may go on."""
    return rf"(?<![0-9A-Za-z]){re.escape(mark)}(?![0-9A-Za-z])"
