"""PROBE on Linux: sysfs with the udev database, the texts beside it, paired devices, and the other side of WSL2."""

import os
import re
from collections.abc import Iterator
from typing import Any

from octoform.base.files import parse
from octoform.builtin.probe import device_units, kernel_text
from octoform.builtin.probe.commands import Command, Entry, dicts, first_text, output
from octoform.builtin.probe.paired import Paired
from octoform.builtin.probe.reader import Reader, Scan
from octoform.builtin.probe.sysfs import Sysfs
from octoform.builtin.probe.udev import UdevDatabase
from octoform.builtin.probe.unit_model import Node, Unit
from octoform.patterns import regex

# The Windows side of a WSL2 system: hardware of this computer that the Linux kernel does not have.
#
# A WSL2 kernel shows virtual devices. What is plugged in belongs to Windows until it is handed over, so it is listed as
# context with the interface ``windows``. Windows's own tools are asked through the interop of WSL where that is on.
# Written from the recorded form of their answers: no WSL2 system has run it yet, and the artifact states it.

_WINDOWS_FOLDERS = ("/mnt/c/Windows/System32/WindowsPowerShell/v1.0", "/mnt/c/Program Files/usbipd-win")
_PNP_LIST = (
    "[Console]::OutputEncoding = [Text.Encoding]::UTF8; Get-PnpDevice -PresentOnly | "
    "Select-Object Status, Class, FriendlyName, InstanceId, Manufacturer, Service | ConvertTo-Json -Compress"
)
PNP = Command(
    "powershell-pnp", ("powershell.exe", "-NoProfile", "-NonInteractive", "-Command", _PNP_LIST), _WINDOWS_FOLDERS
)
USBIPD = Command("usbipd-state", ("usbipd.exe", "state"), _WINDOWS_FOLDERS)
_WINDOWS_SECONDS = 2.0
_USB_IDS = regex(r"VID_([0-9A-F]{4})&PID_([0-9A-F]{4})(?:.*&MI_([0-9A-F]{2}))?", re.I)
_COM = regex(r"\s*\(COM\d+\)$")
_PCI_IDS = regex(r"VEN_([0-9A-F]{4})&DEV_([0-9A-F]{4})", re.I)
# Buses with hardware on them, whose devices carry the names that makers gave; everything else is Windows's own making
# or carries the names that people give.
_WINDOWS_HARDWARE = frozenset(
    ("USB", "USBSTOR", "PCI", "HID", "ACPI", "HDAUDIO", "INTELAUDIO", "SCSI", "SD", "DISPLAY", "USB4")
)
_NAMED_BY_PEOPLE = frozenset(("WPD", "PrintQueue", "Volume", "Bluetooth"))


def is_wsl(reader: Reader) -> bool:
    """Whether the kernel is that of WSL2."""
    return "microsoft" in reader.text("/proc/sys/kernel/osrelease").lower()


class Windows:
    """Devices of the Windows side by their instance path."""

    def __init__(self) -> None:
        """Empty until the scans have run."""
        self._devices: dict[str, Unit] = {}
        self._software: dict[str, int] = {}

    def scans(self) -> list[Scan]:
        """All present devices first, then what usbipd reports of those on USB."""
        return [
            Scan("command:powershell.exe Get-PnpDevice", self._present, _WINDOWS_SECONDS),
            Scan("command:usbipd.exe state", self._shared, _WINDOWS_SECONDS),
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
        for entry in sorted(entries, key=lambda entry: "&MI_" in first_text(entry, "InstanceId").upper()):
            self._note(entry)

    def _note(self, entry: Entry) -> None:
        path = first_text(entry, "InstanceId").upper()
        bus, kind = path.partition("\\")[0], first_text(entry, "Class") or "other"
        if not path or bus not in _WINDOWS_HARDWARE:
            self._software[kind] = self._software.get(kind, 0) + 1
            return
        # Which number a serial port has is no fact about its kind.
        name = "" if kind in _NAMED_BY_PEOPLE else _COM.sub("", first_text(entry, "FriendlyName"))
        ids = _USB_IDS.search(path)
        whole = self._whole(ids) if ids and ids[3] else None
        if whole is not None and ids is not None:
            facts = [f"class {kind}", f"driver={first_text(entry, 'Service')}", f"label={name}"]
            shown = " ".join(fact for fact in facts if not fact.endswith("="))
            whole.head.add(f"function {ids[3].lower()}", shown)
            return
        unit = self._unit(path, bus, name or kind)
        unit.head.add("windows_class", kind)
        unit.head.add("name", name)
        unit.head.add("manufacturer", first_text(entry, "Manufacturer"))
        unit.head.driver = first_text(entry, "Service")

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
            if not (place := first_text(entry, "BusId")):
                continue  # known from earlier, not plugged in
            path = first_text(entry, "InstanceId").upper()
            stub = first_text(entry, "StubInstanceId").upper()
            unit = self._devices.get(path) or self._devices.get(stub) or self._unit(path, "USB", "")
            if not unit.head.title:
                unit.head.title = _COM.sub("", first_text(entry, "Description")) or "USB device"
            taken = first_text(entry, "ClientIPAddress")
            unit.head.add(
                "usbipd", "attached" if taken else "shared" if first_text(entry, "PersistedGuid") else "not shared"
            )
            unit.extra["port"] = kernel_text.value(place, 200)


def _entries(listed: Any) -> Iterator[Entry]:
    """One object or a list of them: the tool writes a single one without a list. ValueError for anything else."""
    if not isinstance(listed, list | dict):
        raise ValueError("the tool gave no list of devices")
    yield from dicts(listed if isinstance(listed, list) else [listed])


# Sources beside sysfs: sound cards in words, input devices, device names, the board, the platform, neighbours.
#
# These scans enrich nodes that sysfs gave, or replace them where a host shows the text and not the folder.

TEXT_BYTES = 65536
_CARD = regex(r"^\s*(\d+)\s+\[(.{1,16}?)\s*\]:\s*(\S+)\s+-\s+(.*)$")
_PCM = regex(r"^(\d+)-(\d+):\s*([^:]*?)\s*:[^:]*(?::(.*))?$")
_POSITION = regex(r"\s+at\s+\S.*$")
_DEV_FOLDERS = ("snd", "input", "dri", "iio", "v4l", "usb", "serial", "i2c", "spi")
_OS_FIELD = regex(r'^([A-Z_]+)="?([^"\n]*)"?$', re.M)
_ARP_FIELDS = 4
# Entries that the resolver holds already; the names are not resolved, since that would ask the network.
_MDNS = Command("avahi-browse", ("avahi-browse", "--all", "--cache", "--terminate", "--parsable", "--no-db-lookup"))
_MDNS_NAME = 3


class Context:
    """Collects facts from /proc, /dev (names only) and the firmware's description of the board."""

    def __init__(self, nodes: dict[str, Node]) -> None:
        """``nodes`` are those of sysfs, by path; sound and input nodes are completed here."""
        self._nodes = nodes
        self.platform: dict[str, str] = {"os": "linux", "arch": "unknown"}
        self.hostname = ""
        self._neighbours: list[str] | None = None
        self._announced: int | None = None
        self._extra: list[Unit] = []

    def scans(self) -> list[Scan]:
        """In the order in which they are run, after those of sysfs."""
        return [
            Scan("proc:asound", self._asound),
            Scan("proc:bus/input/devices", self._inputs),
            Scan("dev:listing", self._device_names),
            Scan("device-tree", self._device_tree),
            Scan("proc:net/arp", self._arp),
            Scan("command:avahi-browse", self._mdns),
            Scan("platform", self._platform),
        ]

    def units(self) -> list[Unit]:
        """Units that sysfs did not give: the board of a device tree, neighbours as context.

        All neighbours are one unit, there whenever they can be read: how many there are and who they are changes by
        the minute and is no fact about this host's kinds.
        """
        found = list(self._extra)
        if self._neighbours is not None or self._announced is not None:
            head = Node("/proc/net/arp", "network", False, kind="neighbours", title="network neighbours")
            extra: dict[str, str | int | bool] = {
                "count": len(self._neighbours or ()),
                "address": kernel_text.value(", ".join(self._neighbours or ()), 300),
            }
            if self._announced is not None:
                extra["mdns_names"] = self._announced
            found.append(Unit(head, context=True, extra=extra))
        return found

    def _asound(self, reader: Reader) -> None:
        cards = {node.name: node for node in self._nodes.values() if node.subsystem == "sound"}
        lines = reader.text("/proc/asound/cards", TEXT_BYTES).splitlines()
        for line in lines:
            found = _CARD.match(line)
            if not found:
                continue
            number, identity, driver, name = found.groups()
            node = cards.get(f"card{number}")
            if node is None:
                node = Node(f"/proc/asound/card{number}", "sound", True, kind=identity)
                node.add("id", identity)
                self._extra.append(Unit(node))
                cards[f"card{number}"] = node
            node.add("name", _POSITION.sub("", name))
            node.add("card_driver", driver)
        self._streams(reader, cards)
        reader.names("/proc/asound")

    def _streams(self, reader: Reader, cards: dict[str, Node]) -> None:
        """PCM streams from the text; from the names of the class devices where there is no text."""
        seen = set()
        for line in reader.text("/proc/asound/pcm", TEXT_BYTES).splitlines():
            found = _PCM.match(line)
            if not found:
                continue
            card, device, label, rest = int(found[1]), int(found[2]), found[3], found[4] or ""
            ways = [way for way in ("playback", "capture") if way in rest]
            node = cards.get(f"card{card}")
            if node is not None and ways:
                seen.add(card)
                node.add(f"pcm{device}", ",".join(ways) + (f" label={label}" if label else ""))
        ways_of: dict[tuple[int, int], set[str]] = {}
        for name in cards:
            stream = re.match(r"^pcmC(\d+)D(\d+)([pc])$", name)
            if stream and int(stream[1]) not in seen:
                ways_of.setdefault((int(stream[1]), int(stream[2])), set()).add(stream[3])
        for (card, device), letters in sorted(ways_of.items()):
            if (node := cards.get(f"card{card}")) is not None:
                ways = [way for letter, way in (("p", "playback"), ("c", "capture")) if letter in letters]
                node.add(f"pcm{device}", ",".join(ways))

    def _inputs(self, reader: Reader) -> None:
        if not reader.data("/proc/bus/input/devices", 1):
            raise FileNotFoundError(2, "no such file")
        block: dict[str, str] = {}
        for line in [*reader.text("/proc/bus/input/devices", 8 * TEXT_BYTES).splitlines(), ""]:
            if line.strip():
                kind, _, rest = line.partition(": ")
                key, _, found = rest.partition("=")
                block[f"{kind}.{key}"] = found.strip().strip('"')
            elif block:
                self._input(block)
                block = {}

    def _input(self, block: dict[str, str]) -> None:
        path = "/sys" + block.get("S.Sysfs", "")
        if path in self._nodes or not block.get("N.Name"):
            return
        node = Node(path, "input", True, kind=block["N.Name"])
        node.add("name", block["N.Name"])
        node.add("handlers", re.sub(r"\d+", "", block.get("H.Handlers", "")).strip())
        if path.startswith("/sys/devices/"):
            self._nodes[path] = node
        else:
            node.path = f"/proc/bus/input/devices/{kernel_text.slug(node.kind)}"
            self._extra.append(Unit(node))

    def _device_names(self, reader: Reader) -> None:
        names = set(reader.names("/dev"))
        for folder in _DEV_FOLDERS:
            if folder in names:
                names |= {f"{folder}/{name}" for name in reader.names_or_none(f"/dev/{folder}")}
        for node in list(self._nodes.values()):
            if node.devname or not node.member:
                continue
            plain = node.name.replace("!", "/")
            for candidate in (plain, f"snd/{plain}", f"input/{plain}", f"dri/{plain}"):
                if candidate in names:
                    node.devname = candidate
                    break

    def _device_tree(self, reader: Reader) -> None:
        for folder in ("/proc/device-tree", "/sys/firmware/devicetree/base"):
            model = reader.text(f"{folder}/model").rstrip("\0")
            if not model:
                continue
            node = Node(folder, "devicetree", False, kind="board", title=model)
            node.add("model", model)
            node.add("compatible", reader.text(f"{folder}/compatible").strip("\0").replace("\0", ", "))
            self._extra.append(Unit(node))
            return
        raise FileNotFoundError(2, "no such file")

    def _arp(self, reader: Reader) -> None:
        if not reader.data("/proc/net/arp", 1):
            raise FileNotFoundError(2, "no such file")
        rows = [line.split() for line in reader.text("/proc/net/arp", TEXT_BYTES).splitlines()[1:]]
        known = [f"{row[0]} {row[3]}" for row in rows if len(row) >= _ARP_FIELDS and row[3].strip("0:")]
        self._neighbours = sorted(known, key=kernel_text.natural)

    def _mdns(self, reader: Reader) -> None:
        """Only how many names: who they are is no fact about this host, and what people call them is theirs."""
        rows = [line.split(";") for line in output(_MDNS, reader).splitlines() if line.startswith(("+", "="))]
        self._announced = len({row[_MDNS_NAME] for row in rows if len(row) > _MDNS_NAME})

    def _platform(self, reader: Reader) -> None:
        live = not reader.root
        uname = os.uname()
        release = reader.text("/proc/sys/kernel/osrelease") or (uname.release if live else "")
        if release:
            self.platform["kernel"] = kernel_text.value(release, 128)
        self.platform["arch"] = (
            uname.machine if live else kernel_text.value(reader.text("/proc/sys/kernel/arch") or "unknown", 64)
        )
        fields = dict(_OS_FIELD.findall(_os_release(reader)))
        for key, field in (("os_id", "ID"), ("os_version", "VERSION_ID")):
            if fields.get(field):
                self.platform[key] = kernel_text.value(fields[field], 64)
        name = (
            reader.text("/proc/sys/kernel/hostname") or reader.text("/etc/hostname") or (uname.nodename if live else "")
        )
        self.hostname = kernel_text.value(name, 255)


def _os_release(reader: Reader) -> str:
    """``/etc/os-release`` is most often a link, which a reader does not follow; its usual target is read directly."""
    return reader.text("/etc/os-release") or reader.text("/usr/lib/os-release")


class Linux:
    """All units of a Linux host; filled by the scans, read when they are over."""

    def __init__(self, reader: Reader) -> None:
        """``reader`` shows which buses and classes there are, and whether this is WSL2."""
        self._reader = reader
        self._udev = UdevDatabase()
        self._sysfs = Sysfs(self._udev)
        self._context, self._paired = Context(self._sysfs.nodes), Paired()
        self._windows = Windows() if is_wsl(reader) else None

    @property
    def platform(self) -> dict[str, str]:
        """System, version, architecture, kernel; on WSL2 marked, since no such system has run this yet."""
        known = self._context.platform
        return {**known, "verified": "recorded-only"} if self._windows else known

    @property
    def hostname(self) -> str:
        """The host's own name."""
        return self._context.hostname

    def scans(self) -> list[Scan]:
        """The udev database first, since devices are looked up in it; tools last."""
        sysfs = [Scan("udev:db", self._udev.scan), *self._sysfs.scans(self._reader.fresh())]
        beside = [*self._context.scans(), *self._paired.scans()]
        return [*sysfs, *beside, *(self._windows.scans() if self._windows else ())]

    def units(self) -> list[Unit]:
        """The devices of the kernel, and those that are merely near."""
        kernel = device_units.collect(dict(self._sysfs.nodes))
        near = [*self._context.units(), *self._paired.units()]
        return [*kernel, *near, *(self._windows.units() if self._windows else ())]
