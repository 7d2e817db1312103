"""The host's own scan beside another agent's PROBE: what the host shows, and which of that agent's words it lacks.

The output is an object with ``probe`` (this agent's artifact), ``unsaid``: for each text of the other's devices the
words that are nowhere in the system's facts of that device (its attributes, its folders, udev's record of it, the
id databases), and ``untrue``: the scans that are reported as worked, with a program that is not here. Only devices
with a folder in sysfs are held to their words; attributes are read for those alone of which a word was not found in
this agent's own descriptor. Who compares the two, and what follows from it, is not known here.
"""

import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from octoform.base.id_databases import IdDatabases
from octoform.builtin.probe import probe
from octoform.builtin.probe.commands import RECORDED
from octoform.builtin.probe.reader import Reader
from octoform.builtin.probe.udev import FOLDER, JOINED, SERIAL, UdevDatabase, key_of
from octoform.builtin.task import Task
from octoform.patterns import regex

MAX_FINDINGS = 500
MAX_FOLDERS, MAX_FILES = 400, 4000
_LINES = "raw_descriptor"
_TEXTS = ("name", "interface")
_WORD = regex(r"[^\W_]+")
_COUNTED = regex(r"\b([a-z]{2,})(?=\d+\b)")
_HEX = regex(r"(?:0x)?0*([0-9a-f]{1,8})h?")
_VERSION = regex(r"(?<![\w.])v?(\d+(?:\.\d+)+)(?![\w.])")
_CODE = regex(r"(?<![\w/])([0-9a-f]{1,2})/([0-9a-f]{1,2})/([0-9a-f]{1,2})(?![\w/])")
_PCI_CODE = regex(r"(?m)^class_code: 0x([0-9a-f]{2})([0-9a-f]{2})([0-9a-f]{2})$")
_AMOUNT = regex(r"([0-9]+)(?:x|v|w|ma|mw|hz|khz|mhz|ghz|kb|mb|gb|kib|mib|gib|m|g|mbps|gbps|bit|bits)")
# How the parts of a device are called whatever it is: no word of these shows what it does.
_STRUCTURE = frozenset(
    (
        *("address", "alias", "attribute", "bcd", "bcddevice", "bcdusb", "bconfigurationvalue"),
        *("bdeviceclass", "bdeviceprotocol", "bdevicesubclass", "binterfaceclass", "binterfaceprotocol"),
        *("binterfacesubclass", "bits", "bmaxpower", "bnuminterfaces", "bound", "bus", "channel", "channels"),
        *("chip", "class", "classes", "code", "compatible", "configuration", "count", "description"),
        *("descriptor", "device", "driver", "drivers", "endpoint", "firmware", "full", "hid", "high", "i2c"),
        *("id", "idproduct", "idvendor", "imanufacturer", "in", "input", "index", "interface", "interfaces"),
        *("iproduct", "is", "kernel", "key", "label", "linux", "low", "maker", "manufacturer", "max"),
        *("maxpower", "modalias", "model", "module", "more", "name", "no", "node", "none", "not", "number"),
        *("of", "out", "parent", "pci", "platform", "power", "product", "property", "protocol", "redacted"),
        *("revision", "self", "serial", "speed", "spi", "string", "strings", "subclass", "subdevice"),
        *("subsystem", "subvendor", "super", "sysfs", "the", "token", "type", "udev", "uevent", "usb"),
        *("value", "vendor", "version", "virtual", "yes"),
    )
)
# What an attribute shows now and not tomorrow: no word of a kind. Names as the kernel's ABI documents have them.
_READING = regex(
    r"(?:.*_)?(?:input|now|raw|average|avg|level|capacity|temp|charge|energy|status|state|count|jiffies|time|usage|stat"
    r"|online|alarm|lowest|highest|brightness|power|runtime_.*|wakeup.*|urbnum|carrier.*|statistics|duration|offset)$"
)
_BINARY = frozenset(("descriptors", "report_descriptor", "config", "rom", "eeprom", "edid", "vpd", "nvmem"))


# A line whose key is one of these shows a reading, and what it shows is no number of a kind; a bound is one.
_BOUND = regex(r"max|min|crit|design|rated|lowest_allowed|bound|limit|emergency|range|step|resolution")
_READING_WORDS = frozenset(("temp", "temperature", "capacity", "charge", "energy", "level", "brightness", "online"))
_READING_WORDS |= {"value", "reading", "rpm", "speed", "voltage", "current", "humidity", "now", "percent", "status"}
# What shows one copy, and no kind: its pieces are no words of the device, but where it stands whole it is hidden later.
_OWN_ATTRIBUTES = frozenset(
    ("serial", "serial_number", "uniq", "address", "wwid", "uuid", "eui", "nguid", "cid", "unique_id")
)
_OWN_KEY = regex(r"(?:.*_)?(?:serial(?:_.*)?|uniq|address|uuid|wwid)")
# Programs that list hardware; an agent that reports one as worked has run it.
_PROGRAMS = frozenset(
    (
        *("lsusb", "lspci", "lshw", "dmidecode", "hwinfo", "inxi", "i2cdetect", "v4l2-ctl", "arecord", "aplay"),
        *("udevadm", "upower", "nmcli", "bluetoothctl", "avahi-browse", "lsblk", "lscpu", "usb-devices", "lsscsi"),
        *("gpiodetect", "gpioinfo", "smartctl", "evtest", "fwupdmgr", "boltctl", "iw", "hciconfig"),
        *("system_profiler", "ioreg", "xinput", "edid-decode", "hdparm", "cyme", "lsdev", "lsiio", "iio_info"),
    )
)
_PROGRAM = regex(r"[a-z0-9][a-z0-9_-]+")
_FOLDERS = (
    *("/usr/local/sbin", "/usr/local/bin", "/usr/sbin", "/usr/bin", "/sbin", "/bin", "/snap/bin"),
    *("/run/current-system/sw/bin", "/nix/var/nix/profiles/default/bin", "/opt/homebrew/bin"),
)


def run(task: Task) -> str:
    """Scan the task's host, look for the words of the input, and write both; the summary line."""
    found = beside(task.read_input(), task.sysroot)
    task.write({"format": 1, **found})
    return f"{len(found['probe']['devices'])} devices, {len(found['unsaid'])} words that are not of the host"


def beside(given: Mapping[str, Any], root: Path) -> dict[str, Any]:
    """``probe``, ``unsaid`` and ``untrue`` for another agent's PROBE of the host below ``root``."""
    reader = Reader(str(root))
    own: Any = probe(reader)
    unsaid = list(_unsaid(given, own, _Host(reader, IdDatabases(root))))[:MAX_FINDINGS]
    return {"probe": own, "unsaid": unsaid, "untrue": list(_untrue(given, reader))}


class _Host:
    """The words of the system's facts of a device; attributes are read once a word is not found without them."""

    def __init__(self, reader: Reader, databases: IdDatabases) -> None:
        self._reader, self._databases = reader, databases
        self._udev = UdevDatabase()
        if reader.names_or_none(FOLDER):
            self._udev.scan(reader)

    def missing(self, words: set[str], device: Mapping[str, Any], others: set[str]) -> set[str]:
        """Those of ``words`` that the system does not say of a device; ``others`` are the folders of all others."""
        own = _of_values({name: item for name, item in device.items() if name != "instance"})
        nodes = " ".join(node["name"] for node in device["instance"].get("nodes", ()))
        # `loop` is what loop0 to loop7 are, and `pcm` what pcm0 is.
        left = _without(words, f"{own} {' '.join(_COUNTED.findall(f'{own} {nodes}'.casefold()))}")
        if left:
            bus = str(device["interface"])
            left = _without(left, " ".join(self._databases.lookup(bus, device.get("vid", ""), device.get("pid", ""))))
        return _without(left, " ".join(self._attributes(device["instance"]["sysfs"], others))) if left else left

    def _attributes(self, folder: str, others: set[str]) -> Iterator[str]:
        """Names and content of the attributes of a device and of its parts, and udev's records of them, of a kind."""
        open_folders, files = [folder], 0
        for _ in range(MAX_FOLDERS):
            if not open_folders or files > MAX_FILES:
                return
            here = open_folders.pop()
            yield from self._record(here)
            for name in self._reader.names_or_none(here):
                path = f"{here}/{name}"
                yield name
                if link := self._reader.link(path):
                    yield link.rpartition("/")[2]
                elif Path(self._reader.root + path).is_dir():
                    open_folders += [path] if path not in others else []
                elif name not in _BINARY | _OWN_ATTRIBUTES and not _READING.match(name):
                    files += 1
                    yield _kind_lines(self._reader.text(path))

    def _record(self, folder: str) -> Iterable[str]:
        """The facts of the kind in udev's record of a folder's device."""
        subsystem = self._reader.link(f"{folder}/subsystem").rpartition("/")[2]
        if not subsystem or not self._udev.names:
            return ()
        event = self._reader.text(f"{folder}/uevent").splitlines()
        keys = key_of(subsystem, folder.rpartition("/")[2], dict(line.split("=", 1) for line in event if "=" in line))
        found = self._udev.properties(self._reader, *keys)
        return [f"{key} {value}" for key, value in found.items() if key not in (SERIAL, JOINED)]

    def count(self, device: Mapping[str, Any]) -> int:
        """How many there are at most of what an entry for many of a kind stands for."""
        folders = [device["instance"]["sysfs"].rpartition("/")[0]]
        folders += [
            f"/sys/{where}" for name in device.get("classes", ()) for where in (f"class/{name}", f"bus/{name}/devices")
        ]
        return max(len(self._reader.names_or_none(folder)) for folder in folders)


def _kind_lines(text: str) -> str:
    """A string without the lines of an event that show a reading or one copy (``POWER_SUPPLY_VOLTAGE_NOW=11000``)."""
    keyed = ((line, line.partition("=")[0].casefold()) for line in text.splitlines())
    return " ".join(line for line, key in keyed if not _READING.match(key) and not _OWN_KEY.fullmatch(key))


def _unsaid(given: Mapping[str, Any], own: Mapping[str, Any], host: _Host) -> Iterator[dict[str, object]]:
    """For each text with words that are not of its device: where it stands, and the words."""
    shown = {device["id"]: device for device in own["devices"]}
    folders = {device["instance"].get("sysfs", "") for device in own["devices"]}
    for device in given.get("devices", ()):
        known = shown.get(device["id"])
        if known is None or "sysfs" not in known["instance"]:
            continue
        texts = [(member, line, _masked(text, known["instance"])) for member, line, text in _texts(device)]
        asked = {word for member, _, text in texts for word in _asked(member, text)}
        others = folders - {known["instance"]["sysfs"]}
        missing = host.missing(asked, known, others)
        kinds = set(_WORD.findall(re.sub(r"(?m)^[^:\n]*: ", " ", known["raw_descriptor"]).casefold()))
        most = 0 if "port" in known["instance"] else host.count(known)
        counts = {word for word in asked if word.isdecimal() and 0 < int(word) <= most}
        missing, kinds = missing - counts, kinds | counts
        own_codes = _PCI_CODE.findall(known["raw_descriptor"]) + _codes(known["raw_descriptor"])
        for member, line, text in texts:
            words = [word for word in dict.fromkeys(_asked(member, text)) if word in missing]
            words += [number for number in _readings(text) if number not in kinds and number not in words]
            words += ["/".join(code) for code in _codes(text) if own_codes and code not in own_codes]
            if words:
                yield {"id": device["id"], "member": member, "line": line, "words": words}


def _asked(member: str, text: str) -> list[str]:
    """The words of a string that the system has to say; in lines, versions as well."""
    return [*_words(text), *(_VERSION.findall(text.casefold()) if member == _LINES else ())]


def _codes(text: str) -> list[tuple[str, ...]]:
    """The codes of USB for kinds of functions in a string (``0e/01/00``), each part with two digits."""
    return [tuple(part.zfill(2) for part in found) for found in _CODE.findall(text.casefold())]


def _masked(text: str, instance: Mapping[str, Any]) -> str:
    """A string without the serial number and the address that are in it whole: these are hidden, not refused."""
    for member in ("serial", "address"):
        if len(str(instance.get(member, ""))) > 3:
            text = re.sub(re.escape(str(instance[member])), " ", text, flags=re.IGNORECASE)
    return text


def _readings(text: str) -> list[str]:
    """The numbers of a line whose key is that of a reading: ``capacity: 81``, ``fan1 speed: 1180 rpm``."""
    key, colon, value = text.partition(":")
    words = [word for word in re.split(r"[^a-z]+", key.casefold()) if word]
    name = re.split(r"[^a-z0-9_]+", key.casefold().strip())[-1]
    bound = _BOUND.search(key.casefold()) or "usb" in words
    if not colon or bound or not (_READING.match(name) or _READING_WORDS.intersection(words)):
        return []
    return [word for word in _WORD.findall(value.casefold()) if word.isdecimal()]


def _untrue(given: Mapping[str, Any], reader: Reader) -> Iterator[dict[str, object]]:
    """The scans that are stated to have worked with a program that this host does not have."""
    recorded = reader.names_or_none(RECORDED) if reader.root else None
    for index, scan in enumerate(given.get("scan_methods", ())):
        spoken = " ".join(word for word in scan["name"].casefold().split() if "/" not in word)  # a path is no program
        named = [word for word in _PROGRAM.findall(spoken) if word in _PROGRAMS]
        if scan["status"] == "ok" and named and not _is_here(named[0], recorded):
            yield {"scan": index, "program": named[0], "recorded": recorded is not None}


def _is_here(program: str, recorded: Iterable[str] | None) -> bool:
    """Whether a program is installed, or on a recorded host its output was recorded."""
    if recorded is not None:
        return any(program in name for name in recorded)
    return shutil.which(program, path=os.pathsep.join((*_FOLDERS, os.environ.get("PATH", "")))) is not None


def _texts(device: Mapping[str, Any]) -> Iterator[tuple[str, int, str]]:
    """(member, line from 1, text) of everything that a device entry states in words."""
    for member in _TEXTS:
        yield member, 1, str(device.get(member, ""))
    for number, line in enumerate(str(device.get(_LINES, "")).splitlines(), 1):
        yield _LINES, number, line


def _words(text: str) -> list[str]:
    """The words of a string that can say something of a kind: no single letter, no short number, nothing structural."""
    found = _WORD.findall(text.casefold())
    return [word for word in found if (len(word) > 2 and word not in _STRUCTURE) or (len(word) == 2 and word.isalpha())]


def _without(words: Iterable[str], text: str) -> set[str]:
    """The words that stand neither in a string nor, for a number, in another spelling of it."""
    names = {*_WORD.findall(text.casefold()), *_VERSION.findall(text.casefold())} | _STRUCTURE
    numbers = {number for word in names for number in _numbers(word)}
    names |= {word.removesuffix("s") for word in names} | {f"{word}s" for word in _STRUCTURE}
    return {word for word in words if word not in names and not numbers & _numbers(word)}


def _numbers(word: str) -> set[int]:
    """The values that a word may have as a number: hexadecimal, decimal, or an amount with its unit."""
    found = set()
    if spelt := _HEX.fullmatch(word):
        found.add(int(spelt[1], 16))
    if _VERSION.fullmatch(word):  # 1.02 is 0102 in binary-coded decimals
        found.add(int(word.replace(".", "")[:8], 16))
    if amount := _AMOUNT.fullmatch(word):
        found.add(int(amount[1]))
    return found | ({int(word)} if word.isdecimal() and len(word) < 10 else set())


def _of_values(value: Any) -> str:
    """All text of a device entry, its members' names omitted."""
    if isinstance(value, Mapping):
        return " ".join(_of_values(item) for item in value.values())
    if isinstance(value, list):
        return " ".join(_of_values(item) for item in value)
    return str(value)
