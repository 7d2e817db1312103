"""The Windows side of a WSL2 system: hardware of this computer that the Linux kernel does not have.

A WSL2 kernel shows virtual devices. What is plugged in belongs to Windows until it is handed over, so it is listed as
context with the interface ``windows``. Windows's own tools are asked through the interop of WSL where that is on.
Written from the recorded form of their answers: no WSL2 system has run it yet, and the artifact says so.
"""

import re
from collections.abc import Iterator
from typing import Any

from octoform.base.files import parse
from octoform.builtin.probe import kernel_text
from octoform.builtin.probe.commands import Command, Entry, dicts, output, said
from octoform.builtin.probe.reader import Reader, Scan
from octoform.builtin.probe.unit_model import Node, Unit

_FOLDERS = ("/mnt/c/Windows/System32/WindowsPowerShell/v1.0", "/mnt/c/Program Files/usbipd-win")
_LIST = (
    "[Console]::OutputEncoding = [Text.Encoding]::UTF8; Get-PnpDevice -PresentOnly | "
    "Select-Object Status, Class, FriendlyName, InstanceId, Manufacturer, Service | ConvertTo-Json -Compress"
)
PNP = Command("powershell-pnp", ("powershell.exe", "-NoProfile", "-NonInteractive", "-Command", _LIST), _FOLDERS)
USBIPD = Command("usbipd-state", ("usbipd.exe", "state"), _FOLDERS)
PATIENCE = 2.0
_USB_IDS = re.compile(r"VID_([0-9A-F]{4})&PID_([0-9A-F]{4})(?:.*&MI_([0-9A-F]{2}))?", re.I)
_COM = re.compile(r"\s*\(COM\d+\)$")
_PCI_IDS = re.compile(r"VEN_([0-9A-F]{4})&DEV_([0-9A-F]{4})", re.I)
# Buses with hardware on them, whose devices carry the names that makers gave; everything else is Windows's own making
# or carries the names that people give.
_HARDWARE = frozenset(
    ("USB", "USBSTOR", "PCI", "HID", "ACPI", "HDAUDIO", "INTELAUDIO", "SCSI", "SD", "DISPLAY", "USB4")
)
_NAMED_BY_PEOPLE = frozenset(("WPD", "PrintQueue", "Volume", "Bluetooth"))


def is_here(reader: Reader) -> bool:
    """Whether the kernel is that of WSL2."""
    return "microsoft" in reader.text("/proc/sys/kernel/osrelease").lower()


class Windows:
    """Devices of the Windows side by their instance path."""

    def __init__(self) -> None:
        """Empty until the scans have run."""
        self._devices: dict[str, Unit] = {}
        self._software: dict[str, int] = {}

    def scans(self) -> list[Scan]:
        """All present devices first, then what usbipd says of those on USB."""
        return [
            Scan("command:powershell.exe Get-PnpDevice", self._present, PATIENCE),
            Scan("command:usbipd.exe state", self._shared, PATIENCE),
        ]

    def units(self) -> list[Unit]:
        """One for each device, one for each class of what Windows makes itself."""
        found = [unit for _, unit in sorted(self._devices.items())]
        for name, count in sorted(self._software.items()):
            head = Node("/windows/software", "windows", False)
            group = f"windows-software-{kernel_text.slug(name) or 'other'}"
            found.append(Unit(head, group, context=True, extra={"count": count}))
        return found

    def _present(self, reader: Reader) -> None:
        listed = parse(output(PNP, reader))
        entries = list(_entries(listed))
        # The functions of a device come after it only by chance.
        for entry in sorted(entries, key=lambda entry: "&MI_" in said(entry, "InstanceId").upper()):
            self._note(entry)

    def _note(self, entry: Entry) -> None:
        path = said(entry, "InstanceId").upper()
        bus, kind = path.partition("\\")[0], said(entry, "Class") or "other"
        if not path or bus not in _HARDWARE:
            self._software[kind] = self._software.get(kind, 0) + 1
            return
        # Which number a serial port has is no fact about its kind.
        name = "" if kind in _NAMED_BY_PEOPLE else _COM.sub("", said(entry, "FriendlyName"))
        ids = _USB_IDS.search(path)
        whole = self._whole(ids) if ids and ids[3] else None
        if whole is not None and ids is not None:
            facts = [f"class {kind}", f"driver={said(entry, 'Service')}", f"label={name}"]
            shown = " ".join(fact for fact in facts if not fact.endswith("="))
            whole.head.add(f"function {ids[3].lower()}", shown)
            return
        unit = self._unit(path, bus, name or kind)
        unit.head.add("windows_class", kind)
        unit.head.add("name", name)
        unit.head.add("manufacturer", said(entry, "Manufacturer"))
        unit.head.driver = said(entry, "Service")

    def _whole(self, ids: re.Match[str]) -> Unit | None:
        """The one device that a function with these numbers can belong to."""
        numbers = (ids[1].lower(), ids[2].lower())
        found = [
            unit
            for path, unit in self._devices.items()
            if path.startswith("USB\\") and (unit.head.vid, unit.head.pid) == numbers
        ]
        return found[0] if len(found) == 1 else None

    def _unit(self, path: str, bus: str, title: str) -> Unit:
        node = Node(f"/windows/{bus.lower()}", "windows", False, title=title)
        ids = _USB_IDS.search(path) or _PCI_IDS.search(path)
        if ids:
            node.vid, node.pid = ids[1].lower(), ids[2].lower()
            node.add("vendor_id", node.vid)
            node.add("product_id", node.pid)
        node.kind = f"{bus}-{node.vid}-{node.pid}" if ids else f"{bus}-{title}"
        last = path.rpartition("\\")[2]
        # Windows makes up a place with ampersands where the device has no serial number.
        node.serial = last if ids and "&" not in last and bus in ("USB", "USBSTOR") else ""
        unit = Unit(node, context=True, extra={"address": kernel_text.value(path, 300)})
        self._devices[path] = unit
        return unit

    def _shared(self, reader: Reader) -> None:
        report = parse(output(USBIPD, reader))
        for entry in _entries(report.get("Devices") if isinstance(report, dict) else None):
            if not (place := said(entry, "BusId")):
                continue  # known from earlier, not plugged in
            path = said(entry, "InstanceId").upper()
            stub = said(entry, "StubInstanceId").upper()
            unit = self._devices.get(path) or self._devices.get(stub) or self._unit(path, "USB", "")
            if not unit.head.title:
                unit.head.title = _COM.sub("", said(entry, "Description")) or "USB device"
            taken = said(entry, "ClientIPAddress")
            unit.head.add("usbipd", "attached" if taken else "shared" if said(entry, "PersistedGuid") else "not shared")
            unit.extra["port"] = kernel_text.value(place, 200)


def _entries(listed: Any) -> Iterator[Entry]:
    """One object or a list of them: the tool writes a single one without a list. ValueError for anything else."""
    if not isinstance(listed, list | dict):
        raise ValueError("the tool gave no list of devices")
    yield from dicts(listed if isinstance(listed, list) else [listed])
