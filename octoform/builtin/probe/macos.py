"""PROBE on macOS: what `ioreg` and `system_profiler` report, as the same units and facts as on Linux.

One scan for each report. What a person names (paired devices, network services, volumes, printers, a telephone used as
a camera) is reported by its kind; only the names that hardware gives itself are kept. Written from the recorded form of
the reports: no Mac has run it yet, and the artifact states that.
"""

import os
import plistlib
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any
from xml.parsers.expat import ExpatError

from octoform.base.files import parse
from octoform.builtin.probe import kernel_text
from octoform.builtin.probe.commands import Command, Entry, dicts, first_text, number, output
from octoform.builtin.probe.paired import Paired, described
from octoform.builtin.probe.reader import Reader, Scan
from octoform.builtin.probe.unit_model import Node, Unit
from octoform.patterns import regex
from octoform.records import dataclass

# The I/O Registry of macOS as `ioreg` archives it: USB devices with their interfaces, serial lines, disks.
#
# The registry is what macOS has in place of sysfs, so its content is written as the same facts: interface classes,
# strings, numbers. Nothing here has been run on a Mac yet; the form is that of recorded property lists.

USB = Command("ioreg-IOUSBHostDevice", ("ioreg", "-a", "-l", "-r", "-c", "IOUSBHostDevice"))
SERIAL = Command("ioreg-IOSerialBSDClient", ("ioreg", "-a", "-l", "-r", "-c", "IOSerialBSDClient"))
CHILDREN = "IORegistryEntryChildren"
MAX_DEPTH = 60


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
        if depth < MAX_DEPTH:
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
    node.add("manufacturer", first_text(entry, "USB Vendor Name", "kUSBVendorString"))
    node.add("product", first_text(entry, "USB Product Name", "kUSBProductString"))
    revision = number(entry, "bcdDevice")
    node.add("revision", f"{revision & 0xFFFF:04x}" if revision is not None else "")
    node.add("device_class", _triple(entry, "bDeviceClass", "bDeviceSubClass", "bDeviceProtocol"))
    node.serial = first_text(entry, "USB Serial Number", "kUSBSerialNumberString")
    return Unit(node)


def _part(entry: Entry, unit: Unit) -> Node | None:
    """An interface, a serial line or a disk of a USB device; None for what only is between them."""
    place = unit.head.path
    index = number(entry, "bInterfaceNumber")
    if index is not None and (triple := _triple(entry, "bInterfaceClass", "bInterfaceSubClass", "bInterfaceProtocol")):
        node = Node(f"{place}/{index & 0xFF:02x}", "usb", True)
        drivers = [first_text(child, "IOObjectClass") for child in dicts(entry.get(CHILDREN))]
        label = first_text(entry, "USB Interface Name", "kUSBString")
        parts = [f"class {triple}", *(f"driver={driver}" for driver in drivers[:1] if driver)]
        node.add(f"interface {index & 0xFF:02x}", " ".join([*parts, *([f"label={label}"] if label else [])]))
        return node
    if "IOCalloutDevice" in entry:
        return _serial_line(entry, place)
    if entry.get("Whole") is True and (disk := first_text(entry, "BSD Name")):
        node = Node(f"{place}/{disk}", "disk", True, devname=disk)
        node.add("name", first_text(entry, "IORegistryEntryName"))
        node.size = number(entry, "Size")
        return node
    return None


def _serial_line(entry: Entry, place: str) -> Node | None:
    """A serial line; its name carries a serial number or what somebody calls a telephone, so that it is an address."""
    callout = first_text(entry, "IOCalloutDevice").removeprefix("/dev/")
    if not callout or "/" in callout:
        return None
    node = Node(f"{place}/tty{number(entry, 'IORegistryEntryID') or 0:x}", "tty", True, address=callout)
    node.add("name", "cu")
    return node


def _triple(entry: Entry, *keys: str) -> str:
    numbers = [number(entry, key) for key in keys]
    return "/".join(f"{value & 0xFF:02x}" for value in numbers if value is not None) if None not in numbers else ""


# Reports of macOS's `system_profiler -json`: items in a tree under the report's name, almost every value a string.
#
# A report that has nothing to say is an empty list; one that this system does not know is missing or an empty object.

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
        if found := first_text(within, inner or outer) if isinstance(within, dict) else "":
            return found
    return ""


VERSION, MACHINE = Command("sw_vers", ("sw_vers",)), Command("uname-m", ("uname", "-m"))
_HEX = regex(r"^0x([0-9a-f]{1,8})\b", re.I)
_USB_CAMERA = regex(r"^0x([0-9a-f]{1,8})[0-9a-f]{8}$", re.I)
# Ways by which a sound device is attached that carry the device's own name; the others carry a person's.
_OWN_NAMES = frozenset(("builtin", "usb", "pci", "thunderbolt", "displayport", "hdmi", "firewire"))
_BLUETOOTH_KINDS = {
    **dict.fromkeys(("headphones", "headset", "speaker", "microphone", "handsfree"), "audio"),
    **dict.fromkeys(("keyboard", "mouse", "trackpad", "gamepad", "joystick", "remote", "stylus"), "input"),
    **dict.fromkeys(("phone", "smartphone", "cellular"), "phone"),
    **dict.fromkeys(("laptop", "desktop", "tablet"), "computer"),
}


class Macos:
    """All units of a Mac; filled by the scans, read when they are over."""

    def __init__(self) -> None:
        """Empty until the scans have run."""
        self.platform: dict[str, str] = {"os": "macos", "arch": "unknown", "verified": "recorded-only"}
        self.hostname = ""
        self._registry, self._paired = Registry(), Paired()
        self._found: list[Unit] = []
        self._sounds: dict[tuple[str, str], Node] = {}

    def scans(self) -> list[Scan]:
        """The registry first: the reports add to the USB devices that it shows."""
        notes: Mapping[str, Note] = {
            **{"SPUSBHostDataType": self._usb, "SPUSBDataType": self._usb, "SPCameraDataType": self._camera},
            **{
                "SPAudioDataType": self._audio,
                "SPDisplaysDataType": self._display,
                "SPPrintersDataType": self._printer,
            },
            **{"SPBluetoothDataType": self._bluetooth, **{name: self._plain(SECTIONS[name]) for name in SECTIONS}},
            "SPStorageDataType": self._storage,
        }
        reports = [scan(name, note) for name, note in notes.items()]
        system = [Scan("command:uname", self._machine), Scan("command:sw_vers", self._version)]
        return [*system, *self._registry.scans(), *reports]

    def units(self) -> list[Unit]:
        """USB devices, what the reports add, and paired devices as context."""
        return [*self._registry.usb.values(), *self._registry.lines, *self._found, *self._paired.units()]

    def _machine(self, reader: Reader) -> None:
        if not reader.root:
            name = os.uname()
            self.platform["kernel"], self.hostname = (
                kernel_text.value(name.release, 128),
                kernel_text.value(name.nodename, 255),
            )
        self.platform["arch"] = kernel_text.value(output(MACHINE, reader), 64) or "unknown"

    def _version(self, reader: Reader) -> None:
        if version := re.search(r"^ProductVersion:\s*(\S+)$", output(VERSION, reader), re.M):
            self.platform["os_version"] = kernel_text.value(version[1], 64)

    def _add(self, node: Node, context: bool = False) -> Unit:
        """A unit of its own; without place and serial number it cannot be distinguished from its twin."""
        extra: dict[str, str | int | bool] = {} if node.serial else {"strength": "weak"}
        if node.address:
            extra["address"] = kernel_text.value(node.address, 300)
        unit = Unit(node, context=context, extra=extra)
        self._found.append(unit)
        return unit

    def _plain(self, section: Section) -> Note:
        def note(item: Entry) -> None:
            if section.needs and not any(item.get(key) for key in section.needs):
                return
            node = _node(section.bus, first(item, section.title))
            for fact, keys in section.facts.items():
                node.add(fact, first(item, keys))
            node.kind = node.title or next((value for _, value in node.lines), "device")
            node.serial, node.address = first(item, section.serial), first(item, section.address)
            self._add(node)

        return note

    def _usb(self, item: Entry) -> None:
        """A device that the registry did not show, or a controller."""
        vendor, product = (_hex(item, *keys) for keys in _USB_IDS)
        location = _hex(item, "location_id", "USBKeyLocationID")
        if vendor is None and product is None:
            if item.get("_items") or item.get("host_controller") or item.get("Driver"):
                self._add(_node("usb-controller", first_text(item, "host_controller", "Driver", "_name")))
            return
        known = self._registry.usb
        place = location if location is not None else -1 - len(known)
        if place in known:
            return
        node = Node(f"/macos/usb/{place:#010x}" if place >= 0 else "/macos/usb", "usb", False)
        node.vid, node.pid = (f"{value & 0xFFFF:04x}" if value is not None else "" for value in (vendor, product))
        node.add("vendor_id", node.vid)
        node.add("product_id", node.pid)
        node.add("manufacturer", first_text(item, "manufacturer", "USBDeviceKeyVendorName"))
        node.add("product", first_text(item, "_name"))
        node.kind = f"{node.vid}-{node.pid}" if node.vid and node.pid else first_text(item, "_name") or "device"
        node.serial = first_text(item, "serial_num", "USBDeviceKeySerialNumber")
        known[place] = Unit(node)

    def _camera(self, item: Entry) -> None:
        name, model = first_text(item, "_name"), first_text(item, "spcamera_model-id")
        identity = first_text(item, "spcamera_unique-id")
        place = _USB_CAMERA.match(identity)
        usb = self._registry.usb.get(int(place[1], 16)) if place else None
        # A camera that a telephone provides is near, no part of this machine, and called as its owner calls it.
        own = name if name == model or place or model.startswith("UVC Camera") else ""
        if usb is not None:
            _member(usb, "camera", {"name": own, "model": model})
            return
        node = _node("camera", own or model, name=own, model="" if model == own else model)
        node.address = identity
        self._add(node, context=not own)

    def _audio(self, item: Entry) -> None:
        way = (
            first_text(item, "coreaudio_device_transport")
            .removeprefix("coreaudio_device_type_")
            .removeprefix("spaudio_")
        )
        if not way and not item.get("coreaudio_device_input") and not item.get("coreaudio_device_output"):
            return
        name = first_text(item, "_name") if way in _OWN_NAMES else ""
        node = self._sounds.get((name, way))
        if node is None:
            usb = self._usb_called(name) if way == "usb" else None
            node = _member(usb, "audio", {"name": name}) if usb else _node("audio", name or f"{way} audio", name=name)
            node.add("transport", way)
            node.add("manufacturer", first_text(item, "coreaudio_device_manufacturer") if name else "")
            self._sounds[name, way] = node
            if usb is None:
                self._add(node)
        for fact, key in (("input_channels", "coreaudio_device_input"), ("output_channels", "coreaudio_device_output")):
            node.add(fact, "" if fact in dict(node.lines) else first_text(item, key))

    def _display(self, item: Entry) -> None:
        node = _node("gpu", first_text(item, "sppci_model", "_name"), model=first_text(item, "sppci_model"))
        node.add("vendor", first_text(item, "spdisplays_vendor").removeprefix("sppci_vendor_"))
        unit = self._add(node)
        for screen in items(item.get("spdisplays_ndrvs")):
            # A screen that is reached by radio is called as its owner calls it.
            numbered = first_text(screen, "_spdisplays_display-vendor-id") and "airplay" not in str(screen).lower()
            part = _member(unit, "monitor", {"name": first_text(screen, "_name") if numbered else ""})
            part.add("connection", first_text(screen, "spdisplays_connection_type").removeprefix("spdisplays_"))

    def _storage(self, item: Entry) -> None:
        """The drive below a volume; the volume itself is what a person made of it."""
        drive = item.get("physical_drive")
        if not isinstance(drive, dict) or not (model := first_text(drive, "device_name")):
            return
        protocol = first_text(drive, "protocol")
        usb = self._usb_called(model) if protocol == "USB" else None
        known = [unit.head for unit in self._found if unit.head.subsystem == "macos-disk"]
        if usb is None and not any(disk.title == model for disk in known):
            self._add(_node("disk", model, model=model, protocol=protocol, medium=first_text(drive, "medium_type")))

    def _printer(self, item: Entry) -> None:
        scheme = first_text(item, "uri").partition(":")[0]
        if not scheme:
            return
        node = _node("printer", first_text(item, "ppd"), model=first_text(item, "ppd"), connection=scheme)
        node.address = first_text(item, "uri")
        self._add(node, context=scheme not in ("usb", "file"))

    def _bluetooth(self, item: Entry) -> None:
        radio = item.get("controller_properties")
        if isinstance(radio, dict):
            node = _node("bluetooth", "Bluetooth adapter", chipset=first_text(radio, "controller_chipset"))
            node.add("transport", first_text(radio, "controller_transport"))
            node.address = first_text(radio, "controller_address")
            self._add(node)
        for key in ("device_connected", "device_not_connected"):
            for named in items(item.get(key)):
                for facts in named.values():
                    device = (
                        self._paired.known(first_text(facts, "device_address")) if isinstance(facts, dict) else None
                    )
                    if device:
                        word = first_text(facts, "device_minorType").lower()
                        device.kind, device.connected = _BLUETOOTH_KINDS.get(word, ""), key == "device_connected"
                        ids = (_hex(facts, "device_vendorID"), _hex(facts, "device_productID"))
                        maker, product = ("" if value is None else f"{value & 0xFFFF:04x}" for value in ids)
                        described(device, "", (), ("", maker, product))

    def _usb_called(self, name: str) -> Unit | None:
        """The one USB device whose product string is that name."""
        found = [unit for unit in self._registry.usb.values() if name and ("product", name) in unit.head.lines]
        return found[0] if len(found) == 1 else None


_USB_IDS = (("vendor_id", "USBDeviceKeyVendorID"), ("product_id", "USBDeviceKeyProductID"))


def _node(bus: str, title: str, **facts: str) -> Node:
    node = Node(f"/macos/{bus}", f"macos-{bus}", False, kind=title or "device", title=title)
    for key, value in facts.items():
        node.add(key, value)
    return node


def _member(unit: Unit, kernel_class: str, facts: Mapping[str, str]) -> Node:
    number = sum(node.subsystem == kernel_class for node in unit.members)
    node = Node(f"{unit.head.path}/{kernel_class}{number}", kernel_class, True)
    for key, value in facts.items():
        node.add(key, value)
    unit.members.append(node)
    return node


def _hex(item: Entry, *keys: str) -> int | None:
    """A number such as ``0x8514`` or ``0x14100000 / 3``; None where there is none."""
    found = next((match for key in keys if (match := _HEX.match(first_text(item, key)))), None)
    return int(found[1], 16) if found else None
