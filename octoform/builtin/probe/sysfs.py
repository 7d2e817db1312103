"""Walks the buses and classes of sysfs and fills one node for each device found there.

Every bus and every class is a scan of its own, in two passes: first all its devices are noted (link reads only), then
each is described. A driver that hangs in the second pass can therefore hide facts, never devices.
"""

from octoform.builtin.probe import buses, classes
from octoform.builtin.probe import kernel_text as text
from octoform.builtin.probe.reader import Reader, Scan
from octoform.builtin.probe.udev import OF_CLASS, SERIAL, STRING_PROPERTIES, UdevDatabase, key_of, split_joined
from octoform.builtin.probe.unit_model import Node

DEVICES = "/sys/devices/"
VIRTUAL = "/sys/devices/virtual/"
# Reported even where the host has none of them: what a person would ask for first.
EXPECTED_BUSES = ("usb", "pci", "i2c", "spi", "platform", "hid", "scsi", "mmc", "acpi")
EXPECTED_CLASSES = (
    *("video4linux", "sound", "input", "hwmon", "thermal", "power_supply", "backlight", "leds"),
    *("block", "drm", "gpio", "net", "rtc", "tty", "bluetooth"),
)
# Virtual devices that stand for something physical; those of every other class are software, one unit a class.
PHYSICAL_VIRTUAL = frozenset(
    (
        *(
            "backlight",
            "bluetooth",
            "dmi",
            "extcon",
            "hwmon",
            "iio",
            "input",
            "ipmi",
            "leds",
            "power_supply",
            "powercap",
        ),
        *("rtc", "thermal", "tpm", "typec", "video4linux", "watchdog"),
    )
)
_UDEV_CLASSES = frozenset(("block", "input", "net", "tty", "video4linux", "usbmisc", "bluetooth", "drm"))
_DESCRIBED = frozenset(("sound", "hidraw", "nvme", "usb", *classes.ATTRIBUTES, *classes.SPECIAL, *_UDEV_CLASSES))
# The artifact holds at most 200 scans: what is beyond these many buses or classes shares one.
MAX_FOLDERS = 90
SCAN_NAME_CHARS = 120


class Sysfs:
    """All nodes by path; filled by the scans, read when they are over."""

    def __init__(self, udev: UdevDatabase) -> None:
        """``udev`` is asked for each device that is described."""
        self.nodes: dict[str, Node] = {}
        self._udev = udev

    def scans(self, reader: Reader) -> list[Scan]:
        """One scan for each bus and class that the host has, and for those that a person expects."""
        buses_there = _union(EXPECTED_BUSES, reader.names_or_none("/sys/bus"))
        classes_there = reader.names_or_none("/sys/class")
        classes_asked = _union(EXPECTED_CLASSES, classes_there)
        found = [self._bus_scan(name, [name]) for name in buses_there[:MAX_FOLDERS]]
        found += [self._class_scan(name, [name]) for name in classes_asked[:MAX_FOLDERS]]
        if rest := buses_there[MAX_FOLDERS:]:
            found.append(self._bus_scan("bus/other", rest))
        if rest := classes_asked[MAX_FOLDERS:]:
            found.append(self._class_scan("other", rest))
        if "block" not in classes_there:
            found.append(Scan("sysfs:block", self._disks))
        return found

    def _disks(self, reader: Reader) -> None:
        self._look(reader, "block", _listed(reader, "/sys/block", ["block"]), False)

    def _bus_scan(self, title: str, names: list[str]) -> Scan:
        def look(reader: Reader) -> None:
            for name in names:
                folder = f"/sys/bus/{name}/devices"
                self._look(reader, name, _listed(reader, folder, names), True)

        return Scan(text.value(f"sysfs:{title}", SCAN_NAME_CHARS), look)

    def _class_scan(self, title: str, names: list[str]) -> Scan:
        def look(reader: Reader) -> None:
            for name in names:
                folder = f"/sys/class/{name}"
                self._look(reader, name, _listed(reader, folder, names), False)

        return Scan(text.value(f"sysfs:class/{title}", SCAN_NAME_CHARS), look)

    def _look(self, reader: Reader, subsystem: str, links: list[str], is_bus: bool) -> None:
        fresh: list[Node] = []
        for link in links:
            path = device_path(link)
            if path and path not in self.nodes:
                member = not is_bus or buses.is_member(subsystem, path.rpartition("/")[2], path)
                node = self.nodes[path] = Node(path, subsystem, member)
                fresh.append(node)
        for node in fresh:
            if not group_of(node):
                self._describe(node, reader, is_bus)

    def _describe(self, node: Node, reader: Reader, is_bus: bool) -> None:
        if not is_bus and node.subsystem not in _DESCRIBED:
            return
        uevent = read_uevent(reader, node)
        node.devname = uevent.get("DEVNAME", "")
        node.modalias = uevent.get("MODALIAS", "")
        if is_bus:
            node.driver = uevent.get("DRIVER") or reader.link(f"{node.path}/driver").rpartition("/")[2]
            node.modalias = node.modalias or reader.text(f"{node.path}/modalias")
        try:
            if is_bus and node.subsystem not in classes.SPECIAL:
                buses.describe(node, reader, uevent)
            elif not self._is_partition(node):
                classes.describe(node, reader, uevent)
        except (ValueError, KeyError, IndexError):
            reader.failures["malformed"] += 1
        if node.subsystem in _UDEV_CLASSES or (is_bus and not (node.subsystem == "usb" and node.member)):
            self._add_udev(node, reader, uevent)

    def _is_partition(self, node: Node) -> bool:
        above = self.nodes.get(node.path.rpartition("/")[0])
        return node.subsystem == "block" and above is not None and above.subsystem == "block"

    def _add_udev(self, node: Node, reader: Reader, uevent: dict[str, str]) -> None:
        if not self._udev.names or self._is_partition(node):
            return
        if "MAJOR" not in uevent and (not node.member or node.subsystem in _UDEV_CLASSES):
            major, _, minor = reader.text(f"{node.path}/dev").partition(":")
            uevent = uevent | ({"MAJOR": major, "MINOR": minor} if minor else {})
        if node.subsystem == "net" and "IFINDEX" not in uevent:
            uevent = uevent | {"IFINDEX": reader.text(f"{node.path}/ifindex")}
        properties = self._udev.properties(reader, *key_of(node.subsystem, node.name, uevent))
        split_joined(properties)
        serial = properties.pop(SERIAL, "").removeprefix("0x")  # as the runtime compares it
        node.serial = node.serial or serial
        target = self._input_device(node)
        names = {_plain(text) for _, text in target.lines}
        wanted = OF_CLASS.get(node.subsystem, "")
        for key, value in sorted(properties.items()):
            repeated = key in STRING_PROPERTIES and (_plain(value) in names or value.startswith("Linux_"))
            if key.startswith(wanted) and not repeated:
                target.add(f"udev.{key}", value)

    def _input_device(self, node: Node) -> Node:
        """An event node's properties are those of its input device."""
        above = self.nodes.get(node.path.rpartition("/")[0])
        return above if node.subsystem == "input" and above is not None and above.subsystem == "input" else node


def _plain(text: str) -> str:
    """Text as udev writes it into a property: anything unusual is an underscore."""
    return "".join(char if char.isalnum() else "_" for char in text.lower())


def _listed(reader: Reader, folder: str, asked: list[str]) -> list[str]:
    """The links in a folder; one that cannot be listed fails its own scan, or is counted where others share it."""
    names = reader.names(folder) if len(asked) == 1 else reader.names_or_none(folder)
    return [reader.link(f"{folder}/{name}") for name in names]


def read_uevent(reader: Reader, node: Node) -> dict[str, str]:
    """The ``KEY=value`` lines of a device's uevent file; empty when there is none."""
    text = reader.text(f"{node.path}/uevent")
    return dict(line.split("=", 1) for line in text.splitlines() if "=" in line)


def device_path(link: str) -> str:
    """``/sys/devices/...`` for a link of a bus or class folder; empty for one that leads anywhere else."""
    rest = link
    while rest.startswith("../"):
        rest = rest[3:]
    rest = rest.removeprefix("/sys/")
    return "/sys/" + rest if rest.startswith("devices/") and "/../" not in rest + "/" else ""


def group_of(node: Node) -> str:
    """The one unit that stands for this and all devices like it; empty for hardware."""
    if node.path.startswith(VIRTUAL):
        if node.subsystem in PHYSICAL_VIRTUAL:
            return ""
        if node.path.startswith(f"{VIRTUAL}{node.subsystem}/"):
            return f"virtual-{node.subsystem}"
    return buses.group_of(node.subsystem, node.name)


def _union(expected: tuple[str, ...], there: list[str]) -> list[str]:
    return [*sorted(expected), *sorted({*there} - {*expected})]
