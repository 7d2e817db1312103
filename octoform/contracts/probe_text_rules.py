"""Rules that hold the words of PROBE against the host: nothing more, nothing less, and no marks of one copy.

The next stage quotes from these texts and sees nothing else. A word from memory would come back as evidence, a string
that is missing is lost for good, and a node or a port makes two equal hosts differ. Without a scan the rules find
nothing.
"""

import re
from collections.abc import Iterator

from octoform.contracts.model import Artifacts, HostScan, JsonObject, Rule
from octoform.contracts.text import pointer, shown
from octoform.diagnostics import Diagnostic, error

_COPY = (
    "copy what the system says, letter by letter; what the device is, the next stage says, and a reading that changes "
    "stands nowhere"
)
_ALONE = "it stands in `instance` alone, so that two hosts of the same kind say the same; take it out of the text"
_WORD = re.compile(r"[^\W_]+")
_ESCAPE = re.compile(r"\\x[0-9a-f]{2}|\\u[0-9a-f]{4}|\\U[0-9a-f]{8}|<\w+>")
_NUMBERED = re.compile(r"[A-Za-z][A-Za-z0-9]*?\d+(?:[a-z]\d+)*")
_ON_THE_BUS = re.compile(r"(?i)\bbus \d{3} device \d{3}\b")
_PCI_PLACE = re.compile(r"[0-9a-f]{4}:[0-9a-f]{2}:[0-9a-f]{2}\.[0-7]")
_PLACE_KEY = re.compile(r"(?i)^\W*(?:\w+[._ ])*(?:port|slot|bus ?num|dev ?num|dev ?path|place|location|path)\b\W*:")
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
        words = ", ".join(shown(word) for word in found["words"][:8])
        summary = f"{place} of {shown(device['id'])} is {shown(line)}; the system says nowhere of it: {words}"
        where = pointer("devices", index, found["member"])
        out.append(error("PROBE-TEXT-NOT-OF-HOST", summary, pointer=where, hint=_COPY))
    return out


def text_missing(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """What the system calls a device stands in what is said of it: nobody after PROBE can look it up."""
    out = []
    for index, device, true in _pairs(value, known.scan):
        said = {word for text in _strings(device) for word in _words(text)}
        lost = [word for word in _words(true["name"]) if word not in said and len(word) > 1]
        if lost and not set(_words(true["interface"])) >= set(lost) and set(lost) != {"device"}:
            summary = f"what is said of {shown(device['id'])} has nothing of {', '.join(map(shown, lost[:6]))}"
            hint = f"copy the system's own strings: it is called {shown(true['name'])} there"
            where = pointer("devices", index, "raw_descriptor")
            out.append(error("PROBE-TEXT-MISSING", summary, pointer=where, hint=hint))
    return out


def instance_in_text(value: JsonObject, known: Artifacts) -> list[Diagnostic]:
    """A node, a path or a port stands in no text of a device."""
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
                    summary = f"{shown(line)} says where this copy of {shown(device['id'])} is: {shown(mark)}"
                    where = pointer("devices", index, member)
                    out.append(error("PROBE-INSTANCE-IN-TEXT", summary, pointer=where, hint=_ALONE))
    return out


RULES = (
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
    """The words of a text in small letters, escapes and what was hidden left out; ``0x1F00`` is 1f00."""
    return [word.removeprefix("0x") for word in _WORD.findall(_ESCAPE.sub(" ", text).casefold())]


def _marks(instance: JsonObject) -> list[str]:
    """What of a device's place is spelt so that it can be nothing else: paths, nodes, a place on PCI."""
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
