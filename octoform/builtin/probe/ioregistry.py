"""The I/O Registry of macOS as `ioreg` archives it: USB devices with their interfaces, serial lines, disks.

The registry is what macOS has in place of sysfs, so what it says is written as the same facts: interface classes,
strings, numbers. Nothing here has been run on a Mac yet; the form is that of recorded property lists.
"""

import plistlib
from collections.abc import Iterator
from xml.parsers.expat import ExpatError

from octoform.builtin.probe.commands import Command, Entry, dicts, number, output, said
from octoform.builtin.probe.reader import Reader, Scan
from octoform.builtin.probe.unit_model import Node, Unit

USB = Command("ioreg-IOUSBHostDevice", ("ioreg", "-a", "-l", "-r", "-c", "IOUSBHostDevice"))
SERIAL = Command("ioreg-IOSerialBSDClient", ("ioreg", "-a", "-l", "-r", "-c", "IOSerialBSDClient"))
CHILDREN = "IORegistryEntryChildren"
DEEPEST = 60


class Registry:
    """USB units by location, and serial lines that belong to none of them."""

    def __init__(self) -> None:
        """Empty until the scans have run."""
        self.usb: dict[int, Unit] = {}
        self.lines: list[Unit] = []
        self._callouts: set[str] = set()

    def scans(self) -> list[Scan]:
        """USB first: a serial line below a USB device is a part of it."""
        return [Scan("command:ioreg IOUSBHostDevice", self._usb), Scan("command:ioreg IOSerialBSDClient", self._serial)]

    def _usb(self, reader: Reader) -> None:
        for entry in _entries(output(USB, reader)):
            self._walk(entry, None, 0)

    def _walk(self, entry: Entry, unit: Unit | None, depth: int) -> None:
        """Note the device or the part that an entry is, and all that is below it; ``unit``: the device above."""
        location = number(entry, "locationID")
        if location and number(entry, "idVendor") is not None and "bInterfaceNumber" not in entry:
            unit = self.usb.get(location) or _usb_unit(entry, location)
            self.usb[location] = unit
        elif (
            unit is not None
            and (part := _part(entry, unit))
            and not any(part.lines == one.lines for one in unit.members)
        ):
            unit.members.append(part)
            if part.subsystem == "tty":
                self._callouts.add(part.address)
                unit.extra["address"] = f"/dev/{part.address}"
        if depth < DEEPEST:
            for child in dicts(entry.get(CHILDREN)):
                self._walk(child, unit, depth + 1)

    def _serial(self, reader: Reader) -> None:
        for entry in _entries(output(SERIAL, reader)):
            line = _serial_line(entry, "/macos/tty")
            if line is not None and line.address not in self._callouts:
                self._callouts.add(line.address)
                line.kind, line.title = "line", "serial line"
                self.lines.append(Unit(line, extra={"strength": "weak", "address": f"/dev/{line.address}"}))


def _entries(text: str) -> Iterator[Entry]:
    try:
        root = plistlib.loads(text.encode(), fmt=plistlib.FMT_XML) if text.strip() else []
    except (ExpatError, AttributeError, TypeError, OverflowError) as problem:
        # plistlib lets some errors of malformed lists through as they come.
        raise ValueError(str(problem)) from problem
    yield from dicts(root if isinstance(root, list) else [root])


def _usb_unit(entry: Entry, location: int) -> Unit:
    node = Node(f"/macos/usb/{location:#010x}", "usb", False)
    node.vid, node.pid = (f"{(number(entry, key) or 0) & 0xFFFF:04x}" for key in ("idVendor", "idProduct"))
    node.kind = f"{node.vid}-{node.pid}"
    node.add("vendor_id", node.vid)
    node.add("product_id", node.pid)
    node.add("manufacturer", said(entry, "USB Vendor Name", "kUSBVendorString"))
    node.add("product", said(entry, "USB Product Name", "kUSBProductString"))
    revision = number(entry, "bcdDevice")
    node.add("revision", f"{revision & 0xFFFF:04x}" if revision is not None else "")
    node.add("device_class", _triple(entry, "bDeviceClass", "bDeviceSubClass", "bDeviceProtocol"))
    node.serial = said(entry, "USB Serial Number", "kUSBSerialNumberString")
    return Unit(node)


def _part(entry: Entry, unit: Unit) -> Node | None:
    """An interface, a serial line or a disk of a USB device; None for what only stands between them."""
    place = unit.head.path
    index = number(entry, "bInterfaceNumber")
    if index is not None and (triple := _triple(entry, "bInterfaceClass", "bInterfaceSubClass", "bInterfaceProtocol")):
        node = Node(f"{place}/{index & 0xFF:02x}", "usb", True)
        drivers = [said(child, "IOObjectClass") for child in dicts(entry.get(CHILDREN))]
        label = said(entry, "USB Interface Name", "kUSBString")
        parts = [f"class {triple}", *(f"driver={driver}" for driver in drivers[:1] if driver)]
        node.add(f"interface {index & 0xFF:02x}", " ".join([*parts, *([f"label={label}"] if label else [])]))
        return node
    if "IOCalloutDevice" in entry:
        return _serial_line(entry, place)
    if entry.get("Whole") is True and (disk := said(entry, "BSD Name")):
        node = Node(f"{place}/{disk}", "disk", True, devname=disk)
        node.add("name", said(entry, "IORegistryEntryName"))
        node.size = number(entry, "Size")
        return node
    return None


def _serial_line(entry: Entry, place: str) -> Node | None:
    """A serial line; its name carries a serial number or what somebody calls a telephone, so that it is an address."""
    callout = said(entry, "IOCalloutDevice").removeprefix("/dev/")
    if not callout or "/" in callout:
        return None
    node = Node(f"{place}/tty{number(entry, 'IORegistryEntryID') or 0:x}", "tty", True, address=callout)
    node.add("name", "cu")
    return node


def _triple(entry: Entry, *keys: str) -> str:
    numbers = [number(entry, key) for key in keys]
    return "/".join(f"{value & 0xFF:02x}" for value in numbers if value is not None) if None not in numbers else ""
