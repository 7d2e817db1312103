"""Reports of macOS's `system_profiler -json`: items in a tree under the report's name, almost every value a text.

A report that has nothing to say is an empty list; one that this system does not know is missing or an empty object.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from octoform.base.files import parse
from octoform.builtin.probe.commands import Command, output
from octoform.builtin.probe.reader import Reader
from octoform.builtin.probe.report import Entry, said
from octoform.builtin.probe.scans import Scan

PATIENCE = 2.0
Note = Callable[[Entry], None]


@dataclass(frozen=True, slots=True)
class Section:
    """How the items of a report become units: facts and the keys that say them, first found first.

    ``Ethernet.MAC Address`` is the key of an object in the item. ``needs``: an item without any of these is a heading
    of the report and no device.
    """

    bus: str
    facts: Mapping[str, tuple[str, ...]]
    title: tuple[str, ...] = ()
    serial: tuple[str, ...] = ()
    address: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()


_DISK = Section(
    "disk",
    {"model": ("device_model",), "revision": ("device_revision",)},
    ("device_model",),
    ("device_serial",),
    needs=("device_model", "device_serial"),
)
_BATTERY, _CHARGER = "sppower_battery_model_info.sppower_battery_", "sppower_ac_charger_"
SECTIONS: Mapping[str, Section] = {
    "SPHardwareDataType": Section(
        "board",
        {"model_name": ("machine_name",), "model": ("machine_model",), "processor": ("chip_type", "cpu_type")},
        ("machine_name",),
        ("serial_number",),
        ("platform_UUID",),
    ),
    "SPNVMeDataType": _DISK,
    "SPSerialATADataType": _DISK,
    "SPNetworkDataType": Section(
        "net", {"kind": ("hardware", "type")}, address=("Ethernet.MAC Address",), needs=("interface",)
    ),
    "SPPowerDataType": Section(
        "power",
        {
            "manufacturer": (f"{_BATTERY}manufacturer", f"{_CHARGER}manufacturer"),
            "model": (f"{_BATTERY}device_name", f"{_CHARGER}name"),
        },
        (f"{_BATTERY}device_name", f"{_CHARGER}name"),
        (f"{_BATTERY}serial_number", f"{_CHARGER}serial_number"),
        needs=("sppower_battery_model_info", f"{_CHARGER}name", f"{_CHARGER}manufacturer"),
    ),
    "SPThunderboltDataType": Section(
        "thunderbolt",
        {"vendor_name": ("vendor_name_key",), "device_name": ("device_name_key",)},
        ("device_name_key",),
        address=("switch_uid_key",),
    ),
}


def scan(name: str, note: Note) -> Scan:
    """The scan that gives each item of a report, wherever in the tree, to ``note``."""
    command = Command(f"system_profiler-{name}", ("system_profiler", "-json", name))

    def look(reader: Reader) -> None:
        report = parse(output(command, reader))
        for item in items(report.get(name) if isinstance(report, dict) else report):
            note(item)

    return Scan(f"command:system_profiler {name}", look, PATIENCE)


def items(value: Any) -> Iterator[Entry]:
    """The objects of a list and of the lists of items in them; ValueError for what is no such list."""
    if not isinstance(value, list | None):
        raise ValueError("the report holds no list")
    for item in value or ():
        if isinstance(item, dict):
            yield item
            below = item.get("_items")
            yield from items(below if isinstance(below, list) else [])


def first(item: Entry, keys: tuple[str, ...]) -> str:
    """The first text under one of the keys, in the item or in an object of it."""
    for key in keys:
        outer, dot, inner = key.partition(".")
        within = item.get(outer) if dot else item
        if found := said(within, inner or outer) if isinstance(within, dict) else "":
            return found
    return ""
