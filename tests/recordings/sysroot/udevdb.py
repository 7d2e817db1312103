"""`udevadm info --export-db` and umockdev-record texts: blocks of lines ``P:`` path, ``N:`` node, ``E:`` property ...

An export holds the udev properties and no attributes: what of them was in sysfs is worked out (`properties`). A
umockdev recording also holds attributes (``A:``, ``H:`` in hexadecimal) and links (``L:``).
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from recordings.sysroot.properties import derive_attributes
from recordings.sysroot.tree import Tree, above, is_bus, last

# The properties that the kernel itself puts into the uevent file.
_KERNEL_KEY = re.compile(
    r"^(DRIVER|DEVTYPE|MAJOR|MINOR|DEVNAME|DEVMODE|PRODUCT|TYPE|INTERFACE|MODALIAS|BUSNUM|"
    r"DEVNUM|IFINDEX|HID_[A-Z]+|PCI_[A-Z_]+|OF_\w+|POWER_SUPPLY_\w+|KEY|REL|EV|PROP|ABS|SW|LED|"
    r"MSC|SND|FF|NAME|PHYS|UNIQ|SERIO_\w+|DISKSEQ|PARTN|PARTNAME|NPARTS|RFKILL_\w+|SDIO_\w+|"
    r"MMC_\w+|SLOT|WLAN\w*|HWMON\w*|WDOG\w*|TYPEC_\w+|USB_\w+|NVME_\w+|I2C_\w+)$"
)
# Properties that stand elsewhere in a record of the udev database.
_OTHER_KEYS = frozenset(("DEVPATH", "SUBSYSTEM", "DEVLINKS", "TAGS", "CURRENT_TAGS", "USEC_INITIALIZED", "UDEV_LOG"))
_ESCAPES = {"n": "\n", "\\": "\\", "t": "\t", "r": "\r", '"': '"'}


@dataclass(eq=False)
class Record:
    """One device of the database."""

    path: str
    properties: dict[str, str] = field(default_factory=dict)
    attributes: dict[str, str] = field(default_factory=dict)
    binaries: dict[str, str] = field(default_factory=dict)
    links: dict[str, str] = field(default_factory=dict)
    node: str | None = None
    node_hex: str | None = None
    node_links: list[str] = field(default_factory=list)
    priority: str | None = None

    @property
    def subsystem(self) -> str | None:
        """The bus or class."""
        return self.properties.get("SUBSYSTEM")

    @property
    def name(self) -> str:
        """The kernel's name of the device."""
        return last(self.path)

    @property
    def folder(self) -> str:
        """Where the device lies in the tree."""
        return "sys" + self.path

    @property
    def numbers(self) -> tuple[str, str] | None:
        """Major and minor number of its node."""
        major, minor = self.properties.get("MAJOR"), self.properties.get("MINOR")
        return (major, minor) if major and minor else None

    @property
    def kind(self) -> str:
        """The kind of its node."""
        return "block" if self.subsystem == "block" else "char"


def load(tree: Tree, text: str) -> int:
    """Read the text of a database; how many devices it has."""
    records = parse(text)
    load_records(tree, records)
    return len(records)


def load_records(tree: Tree, records: Iterable[Record]) -> None:
    """Write the devices."""
    known = {record.path: record for record in records}
    with_attributes = any(r.attributes or r.binaries or r.links for r in records)
    for record in records:
        if not record.path.startswith("/"):
            continue
        tree.folder(record.folder)
        _attributes(tree, record)
        if not with_attributes or record.subsystem:
            derive_attributes(tree, record, known)
        uevent = [f"{key}={value}" for key, value in record.properties.items() if _KERNEL_KEY.match(key)]
        lines = [line.replace("DEVNAME=/dev/", "DEVNAME=") + "\n" for line in uevent]
        tree.write(f"{record.folder}/uevent", "".join(lines), derived=True)
        _links(tree, record, known)
        _node(tree, record)
        _database(tree, record)


def parse(text: str) -> list[Record]:
    """The records of a text; lines that are none of theirs are passed over."""
    records: list[Record] = []
    for line in text.splitlines():
        if line.startswith("P: "):
            records.append(Record(line[3:].strip()))
        elif records and line[1:3] == ": ":
            _take(records[-1], line[0], line[3:])
    return records


def _take(record: Record, letter: str, value: str) -> None:
    key, _, rest = value.partition("=")
    pairs = {"E": record.properties, "A": record.attributes, "H": record.binaries}
    if letter in pairs:
        pairs[letter][key] = rest
    elif letter == "N":
        record.node, record.node_hex = key, rest or None
    elif letter == "S":
        record.node_links.append(value)
    elif letter == "L" and re.fullmatch(r"-?\d+", value):
        record.priority = value
    elif letter == "L":
        record.links[key] = rest


def _attributes(tree: Tree, record: Record) -> None:
    for name, value in record.attributes.items():
        end = "" if value.endswith("\\n") else "\n"
        text = re.sub(r'\\([nrt"\\])', lambda found: _ESCAPES[found[1]], value)
        tree.write(f"{record.folder}/{name}", text + end)
    for name, value in record.binaries.items():
        if (data := _bytes(value)) is not None:
            tree.write(f"{record.folder}/{name}", data)


def _links(tree: Tree, record: Record, known: dict[str, Record]) -> None:
    subsystem, recorded = record.subsystem, record.links.get("subsystem")
    tree.register(
        record.path,
        subsystem,
        record.properties.get("DRIVER"),
        disk=record.properties.get("DEVTYPE") == "disk",
        bus="/bus/" in recorded if recorded else None,
    )
    for name, target in record.links.items():
        if name not in ("subsystem", "driver"):
            tree.raw_link(f"{record.folder}/{name}", target)
    if record.links.get("driver") and subsystem:
        tree.bind(record.folder, subsystem, last(record.links["driver"]))
    if subsystem and not is_bus(subsystem, record.path):
        _device_link(tree, record, known)


def _device_link(tree: Tree, record: Record, known: dict[str, Record]) -> None:
    """A device of a class has a link ``device`` to the nearest bus device above it."""
    holder = above(record.path)
    while holder:
        if holder in known and is_bus(known[holder].subsystem or "", holder):
            tree.link(record.folder + "/device", "sys" + holder)
            return
        holder = above(holder)


def _node(tree: Tree, record: Record) -> None:
    if record.numbers:
        numbers = ":".join(record.numbers)
        tree.attribute(f"{record.folder}/dev", numbers, derived=True)
        tree.link(f"sys/dev/{record.kind}/{numbers}", record.folder)
    properties = record.properties
    node = record.node or (properties["DEVNAME"].removeprefix("/dev/") if properties.get("DEVNAME") else None)
    if not node or record.subsystem == "net":
        return
    tree.node(node, record.kind, properties.get("MAJOR"), properties.get("MINOR"))
    path = "dev/" + node.lstrip("/")
    data = _bytes(record.node_hex or "")
    if data:
        tree.write(path, data, keep=False)
    for link in [*record.node_links, *properties.get("DEVLINKS", "").split()]:
        tree.link("dev/" + link.removeprefix("/dev/"), path)


def _database(tree: Tree, record: Record) -> None:
    """What udevd keeps of the device below /run/udev/data."""
    key = _database_key(record)
    if key is None:
        return
    lines = ["S:" + link for link in record.node_links]
    if record.priority:
        lines.append("L:" + record.priority)
    if record.properties.get("USEC_INITIALIZED"):
        lines.append("I:" + record.properties["USEC_INITIALIZED"])
    for name, value in record.properties.items():
        if not _KERNEL_KEY.match(name) and name not in _OTHER_KEYS:
            lines.append(f"E:{name}={value}")
    lines += ["G:" + tag for tag in record.properties.get("TAGS", "").strip(":").split(":") if tag]
    lines.append("V:1")
    tree.write("run/udev/data/" + key.replace("/", "!"), "\n".join(lines) + "\n", derived=True)


def _database_key(record: Record) -> str | None:
    if record.numbers:
        return record.kind[0] + ":".join(record.numbers)
    if record.subsystem == "net" and record.properties.get("IFINDEX"):
        return "n" + record.properties["IFINDEX"]
    return f"+{record.subsystem}:{record.name}" if record.subsystem else None


def _bytes(text: str) -> bytes | None:
    """The bytes of a hexadecimal text; None when it is none."""
    try:
        return bytes.fromhex(text)
    except ValueError:
        return None
