"""The host's own scan beside another agent's PROBE: what the host shows, and which of that agent's words it never says.

The output is an object with ``probe`` (this agent's artifact) and ``unsaid``: for each text of the other's devices the
words that stand nowhere in what the system tells of that device (its attributes, its folders, udev's record of it, the
id databases). Only devices with a folder in sysfs are held to their words; attributes are read for those alone of which
a word was not found in this agent's own descriptor. Who compares the two, and what follows from it, is not known here.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from octoform.base.id_databases import IdDatabases
from octoform.builtin.probe.reader import Reader
from octoform.builtin.probe.stage import probe
from octoform.builtin.task import Task

MOST_UNSAID = 500
MOST_FOLDERS, MOST_FILES = 400, 4000
_LINES = "raw_descriptor"
_TEXTS = ("name", "interface")
_WORD = re.compile(r"[^\W_]+")
_HEX = re.compile(r"(?:0x)?0*([0-9a-f]{1,8})h?")
_AMOUNT = re.compile(r"([0-9]+)(?:x|v|w|ma|mw|hz|khz|mhz|ghz|kb|mb|gb|kib|mib|gib|m|g|mbps|gbps|bit|bits)")
# How the parts of a device are called whatever it is: no word of these tells what it does.
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
_READING = re.compile(
    r"(?:.*_)?(?:input|now|raw|average|avg|level|capacity|temp|charge|energy|status|state|count|jiffies|time|usage|stat"
    r"|online|alarm|lowest|highest|brightness|power|runtime_.*|wakeup.*|urbnum|carrier.*|statistics|duration|offset)$"
)
_BINARY = frozenset(("descriptors", "report_descriptor", "config", "rom", "eeprom", "edid", "vpd", "nvmem"))


def run(task: Task) -> str:
    """Scan the task's host, look for the words of the input, and write both; the summary line."""
    given = task.read_input()
    reader = Reader(str(task.sysroot))
    own = probe(reader)
    unsaid = list(_unsaid(given, own, _Host(reader, IdDatabases(task.sysroot))))
    task.write({"format": 1, "probe": own, "unsaid": unsaid[:MOST_UNSAID]})
    return f"{len(own['devices'])} devices, {len(unsaid)} texts that are not of the host"  # type: ignore[arg-type]


class _Host:
    """What the system says of a device, as words; attributes are read once a word is not found without them."""

    def __init__(self, reader: Reader, databases: IdDatabases) -> None:
        self._reader, self._databases = reader, databases

    def missing(self, words: set[str], device: Mapping[str, Any], others: set[str]) -> set[str]:
        """Those of ``words`` that the system does not say of a device; ``others`` are the folders of all others."""
        left = _without(words, _of_values(device))
        if left:
            bus = str(device["interface"])
            left = _without(left, " ".join(self._databases.lookup(bus, device.get("vid", ""), device.get("pid", ""))))
        return _without(left, " ".join(self._attributes(device["instance"]["sysfs"], others))) if left else left

    def _attributes(self, folder: str, others: set[str]) -> Iterator[str]:
        """Names and content of the attributes of a device and of its parts, as far as they tell of a kind."""
        open_folders, files = [folder], 0
        for _ in range(MOST_FOLDERS):
            if not open_folders or files > MOST_FILES:
                return
            here = open_folders.pop()
            for name in self._reader.names_or_none(here):
                path = f"{here}/{name}"
                yield name
                if link := self._reader.link(path):
                    yield link.rpartition("/")[2]
                elif Path(self._reader.root + path).is_dir():
                    open_folders += [path] if path not in others else []
                elif name not in _BINARY and not _READING.match(name):
                    files += 1
                    yield _kind_lines(self._reader.text(path))


def _kind_lines(text: str) -> str:
    """A text without the lines of an event that show a reading (``POWER_SUPPLY_VOLTAGE_NOW=11000``)."""
    return " ".join(line for line in text.splitlines() if not _READING.match(line.partition("=")[0].casefold()))


def _unsaid(given: Mapping[str, Any], own: Mapping[str, Any], host: _Host) -> Iterator[dict[str, object]]:
    """For each text with words that are not of its device: where it stands, and the words."""
    shown = {device["id"]: device for device in own["devices"]}
    folders = {device["instance"].get("sysfs", "") for device in own["devices"]}
    for device in given.get("devices", ()):
        known = shown.get(device["id"])
        if known is None or "sysfs" not in known["instance"]:
            continue
        texts = list(_texts(device))
        asked = {word for _, _, text in texts for word in _words(text)}
        others = folders - {known["instance"]["sysfs"]}
        missing = host.missing(asked, known, others)
        for member, line, text in texts:
            if found := [word for word in dict.fromkeys(_words(text)) if word in missing]:
                yield {"id": device["id"], "member": member, "line": line, "words": found}


def _texts(device: Mapping[str, Any]) -> Iterator[tuple[str, int, str]]:
    """(member, line from 1, text) of everything that a device entry says in words."""
    for member in _TEXTS:
        yield member, 1, str(device.get(member, ""))
    for number, line in enumerate(str(device.get(_LINES, "")).splitlines(), 1):
        yield _LINES, number, line


def _words(text: str) -> list[str]:
    """The words of a text that can say something of a kind: no single letter, no short number, nothing structural."""
    found = _WORD.findall(text.casefold())
    return [word for word in found if (len(word) > 2 and word not in _STRUCTURE) or (len(word) == 2 and word.isalpha())]


def _without(words: Iterable[str], text: str) -> set[str]:
    """The words that stand neither in a text nor, for a number, in another spelling of it."""
    said = set(_WORD.findall(text.casefold())) | _STRUCTURE
    numbers = {number for word in said for number in _numbers(word)}
    return {word for word in words if word not in said and not numbers & _numbers(word)}


def _numbers(word: str) -> set[int]:
    """What a word may mean as a number: hexadecimal, decimal, or an amount with its unit."""
    found = set()
    if spelt := _HEX.fullmatch(word):
        found.add(int(spelt[1], 16))
    if amount := _AMOUNT.fullmatch(word):
        found.add(int(amount[1]))
    return found | ({int(word)} if word.isdecimal() and len(word) < 10 else set())


def _of_values(value: Any) -> str:
    """All text of a device entry, its members' names left out."""
    if isinstance(value, Mapping):
        return " ".join(_of_values(item) for item in value.values())
    if isinstance(value, list):
        return " ".join(_of_values(item) for item in value)
    return str(value)
