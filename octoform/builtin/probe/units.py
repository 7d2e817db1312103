"""Makes units of nodes: which device owns which class devices, what each kind is called, what is its instance.

Two hosts with the same kinds of devices must get the same text wherever they are plugged in, so everything that is
ordered here is ordered by what it says first and by where it is only among equals.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from octoform.builtin.probe import text
from octoform.builtin.probe.node import Node
from octoform.builtin.probe.sysfs import DEVICES, VIRTUAL, group_of
from octoform.builtin.probe.udev import JOINED_NAME

NAME_CHARS = 200
DESCRIPTOR_CHARS = 4000
MAX_MEMBERS = 400
MAX_NAMES = 60
# Facts of a unit that stand before those of its class devices, without a prefix.
_UNPREFIXED = frozenset(("usb",))
_NO_CLASS = frozenset(
    ("wakeup", "usb", "scsi", "pci_express", "i2c", "usb-serial", "serial-base", "serial", "auxiliary")
)
_HEADS = {"input": "input", "sound": "card"}
_NO_SERIALS = frozenset(
    ("0", "1", "none", "n/a", "na", "default string", "to be filled by o.e.m.", "unknown", "serial")
)
_SCRUB_FROM = 6
_HIDDEN = "<serial>"
# Numbered in the order of discovery: the name says nothing about the place.
_UNPLACED_BUSES = frozenset(("hid", "scsi"))
_NAMING_CLASSES = (
    "video4linux",
    "sound",
    "input",
    "hwmon",
    "iio",
    "power_supply",
    "gpio",
    "rtc",
    "thermal",
    "tty",
    "block",
)
_NAMING_KEYS = ("model_name", f"udev.{JOINED_NAME}", "model", "name", "label", "type")
_SAME_MANY = 4


@dataclass(slots=True)
class Unit:
    """A device on a bus (or a class device that has none above it) with everything that hangs below it."""

    head: Node
    group: str = ""
    members: list[Node] = field(default_factory=list)
    context: bool = False
    extra: dict[str, str | int | bool] = field(default_factory=dict)

    def vid_pid(self) -> tuple[str, str]:
        """Vendor and product id: its own, or that of the HID device in it."""
        for node in (self.head, *self.members):
            if node.vid and node.pid and node.subsystem in ("usb", "pci", "hid"):
                return node.vid, node.pid
        return "", ""


def collect(nodes: Mapping[str, Node]) -> list[Unit]:
    """All units; each node belongs to exactly one."""
    units: dict[str, Unit] = {}
    owner: dict[str, str] = {}
    for path in sorted(nodes):
        node = nodes[path]
        group = group_of(node)
        key = f"group:{group}" if group else _owner_key(node, owner, units)
        owner[path] = key
        if key in units:
            units[key].members.append(node)
        else:
            units[key] = Unit(node, group, [node] if group else [])
    return list(units.values())


def _owner_key(node: Node, owner: Mapping[str, str], units: Mapping[str, Unit]) -> str:
    above = node.path
    while len(above := above.rpartition("/")[0]) >= len(DEVICES):
        key = owner.get(above)
        # Nothing real hides in a unit that stands for many of a kind.
        if key is not None and not units[key].group:
            return key if node.member or _same_product(node, units[key].head) else node.path
    return node.path


def _same_product(node: Node, above: Node) -> bool:
    """A HID device is its transport's own unless it says that it is another product (behind a radio receiver)."""
    if node.subsystem != "hid" or above.subsystem == "hid":
        return False
    return (above.vid, above.pid) in (("", ""), (node.vid, node.pid))


def entries(units: Iterable[Unit]) -> list[dict[str, object]]:
    """The ``devices`` of the artifact, in canonical order, ids unique."""
    made = sorted(
        ((_base(unit), _descriptor(unit), text.natural(unit.head.path), unit) for unit in units),
        key=lambda row: row[:3],
    )
    serials = Counter((*unit.vid_pid(), _serial(unit)) for _, _, _, unit in made)
    ordinals: Counter[str] = Counter()
    found = []
    for base, descriptor, _, unit in made:
        ordinals[base] += 1
        ordinal = ordinals[base]
        unique = serials[(*unit.vid_pid(), _serial(unit))] == 1
        found.append(_entry(unit, f"{base}-{ordinal}" if ordinal > 1 else base, descriptor, unique))
    return found


def _base(unit: Unit) -> str:
    if unit.group:
        return text.slug(unit.group if "-" in unit.group else f"system-{unit.group}")
    head = unit.head
    kind = text.slug(head.kind or head.title) or text.slug(head.name.rstrip("0123456789")) or "device"
    first = "cooling" if ("role", "cooling") in head.lines else text.slug(head.subsystem) or "device"
    return kind if kind.startswith(f"{first}-") or kind == first else f"{first}-{kind}"


def _entry(unit: Unit, identity: str, descriptor: str, unique: bool) -> dict[str, object]:
    vid, pid = unit.vid_pid()
    nodes = [unit.head, *unit.members] if not unit.group else unit.members
    entry: dict[str, object] = {
        "id": identity,
        "name": _name(unit, vid, pid),
        "interface": _interface(unit),
        "raw_descriptor": descriptor,
    }
    if vid and pid:
        entry |= {"vid": vid, "pid": pid}
    names = sorted({node.subsystem for node in nodes if node.member and node.subsystem not in _NO_CLASS})
    drivers = sorted({text.value(node.driver, 60) for node in nodes if node.driver})
    if names:
        entry["classes"] = [text.value(name, 60) for name in names[:MAX_NAMES]]
    if drivers:
        entry["drivers"] = drivers[:MAX_NAMES]
    if unit.context:
        entry["context"] = True
    return entry | {"instance": _instance(unit, unique)}


def _interface(unit: Unit) -> str:
    if unit.context:
        return "network"
    if unit.group:
        return unit.group.partition("-")[0] if "-" in unit.group else "system"
    if unit.head.path.startswith(VIRTUAL) and unit.head.member:
        return "virtual"
    return text.value(unit.head.subsystem, 40)


def _name(unit: Unit, vid: str, pid: str) -> str:
    facts = dict(unit.head.lines)
    if unit.group:
        return unit.group.replace("-", " ")
    if unit.head.title:
        return text.value(unit.head.title, NAME_CHARS)
    maker = facts.get("manufacturer") or facts.get("vendor") or facts.get("udev.ID_VENDOR_FROM_DATABASE", "")
    product = facts.get("product") or facts.get("model") or facts.get("udev.ID_MODEL_FROM_DATABASE", "")
    product = product or facts.get("name") or facts.get("description", "") or _member_name(unit)
    if maker and text.slug(product).startswith(text.slug(maker)):
        maker = ""
    shown = " ".join(part for part in (maker, product) if part)
    if not product:
        kind = f"device {vid}:{pid}" if vid else unit.head.kind or unit.head.name.rstrip("0123456789")
        shown = f"{maker} {unit.head.subsystem} {kind}".strip()
    return text.value(_scrub(shown, _secrets(unit)), NAME_CHARS)


def _member_name(unit: Unit) -> str:
    """What the first class device with a name is called, in the order of how much such a name tells."""
    for subsystem in _NAMING_CLASSES:
        for node in in_order(node for node in _owned(unit) if node.subsystem == subsystem):
            facts = dict(node.lines)
            found = next((facts[key] for key in _NAMING_KEYS if facts.get(key)), "")
            # Behind a numbered product a class device's name may be that of a part (a camera's button).
            if found and (not unit.head.vid or subsystem == "tty"):
                return found
    return ""


def _descriptor(unit: Unit) -> str:
    """All ``key: value`` lines, the unit's own first; cut at a line end when there are too many."""
    rows: list[tuple[str, str]] = [("bus" if not unit.head.member else "class", unit.head.subsystem)]
    if unit.group:
        rows = [("group", unit.group)]
    else:
        rows += unit.head.lines if not unit.head.member else []
        rows += [("driver", unit.head.driver), ("modalias", unit.head.modalias if not unit.head.member else "")]
        rows += [row for node in unit.members if node.subsystem in _UNPREFIXED for row in node.lines]
        rows += _member_rows([node for node in _owned(unit) if node.subsystem not in _UNPREFIXED], set(rows))
    secrets = _secrets(unit)
    lines = [f"{key}: {text.value(_scrub(said, secrets))}" for key, said in rows if said]
    return _bounded([text.visible(line[:600]) for line in lines])


def _owned(unit: Unit) -> list[Node]:
    return [unit.head, *unit.members] if unit.head.member else unit.members


def _member_rows(nodes: list[Node], known: set[tuple[str, str]]) -> list[tuple[str, str]]:
    """``class[ordinal].key`` lines; what the unit itself said already is not repeated, nor what many say alike."""
    rows: list[tuple[str, str]] = []
    for subsystem, members in sorted(_by_class(nodes).items()):
        speaking = [node for node in in_order(members) if node.lines or node.driver]
        if len(speaking) > 1:
            rows.append((f"{subsystem}.count", str(len(speaking))))
        alike = len(speaking) > _SAME_MANY and all(node.lines == speaking[0].lines for node in speaking)
        for index, node in enumerate(speaking[:1] if alike else speaking):
            said_here = [*dict.fromkeys(row for row in node.lines if row not in known), ("driver", node.driver)]
            said_here.sort(key=lambda row: row[0].startswith("udev."))
            rows += [(f"{subsystem}[{index}].{key}", said) for key, said in said_here if said]
    return rows


def _by_class(nodes: Iterable[Node]) -> dict[str, list[Node]]:
    found: dict[str, list[Node]] = {}
    for node in nodes:
        found.setdefault(node.subsystem, []).append(node)
    return found


def in_order(nodes: Iterable[Node]) -> list[Node]:
    """Class devices of one unit in canonical order: those that say something first, equals by natural path."""
    return sorted(
        nodes,
        key=lambda node: (
            not (node.lines or node.driver),
            not node.name.startswith(_HEADS.get(node.subsystem, "")),
            node.lines,
            text.natural(node.path),
        ),
    )


def _bounded(lines: list[str]) -> str:
    size = 0
    for index, line in enumerate(lines):
        size += len(line) + 1
        if size > DESCRIPTOR_CHARS - 40:
            return "\n".join([*lines[:index], f"more: {len(lines) - index} lines left out"])
    return "\n".join(lines)


def _secrets(unit: Unit) -> list[str]:
    nodes = (unit.head, *unit.members)
    found = {said for node in nodes for said in (node.serial, node.address) if len(said) >= _SCRUB_FROM}
    return sorted(found, key=len, reverse=True)


def _scrub(said: str, secrets: list[str]) -> str:
    """Some devices print their serial number into their name; an artifact about kinds must not carry it."""
    for secret in secrets:
        if secret in said:
            said = said.replace(secret, _HIDDEN)
    return said


def _serial(unit: Unit) -> str:
    for node in (unit.head, *unit.members):
        serial = node.serial.strip()
        # A root hub gives the address of its controller as its serial number: that is a place.
        placed = len(serial) >= _SCRUB_FROM and f"/{serial}/" in node.path
        if serial and not placed and serial.lower() not in _NO_SERIALS and serial.strip("0 .:-xX"):
            return serial
    return ""


def _instance(unit: Unit, unique: bool) -> dict[str, object]:
    head = unit.head
    instance: dict[str, object] = {"sysfs": text.visible(head.path)[:1000]}
    serial = _serial(unit)
    if not unit.group:
        instance["port"] = text.value(head.name, 200)
        place = "weak" if head.subsystem in _UNPLACED_BUSES else "positional"
        instance["strength"] = "strong" if serial and unique else place
    if serial and not unit.group:
        instance["serial"] = text.value(serial, 300)
    nodes = in_class_order(_owned(unit))
    address = next((node.address for node in nodes if node.address), "")
    if address and not unit.group:
        instance["address"] = text.value(address, 300)
    size = next((node.size for node in nodes if node.size is not None), None)
    if size is not None:
        instance["size_bytes"] = size
    instance["paths"] = [text.visible(node.path)[:1000] for node in nodes[:MAX_MEMBERS]]
    instance["nodes"] = [_node(node) for node in nodes[:MAX_MEMBERS] if node.subsystem not in _NO_CLASS]
    return instance | unit.extra


def in_class_order(nodes: Iterable[Node]) -> list[Node]:
    """Members by class, each class in the order of the descriptor's ordinals."""
    return [node for _, members in sorted(_by_class(nodes).items()) for node in in_order(members)]


def _node(node: Node) -> dict[str, str]:
    entry = {"class": text.value(node.subsystem, 60), "name": text.value(node.name, 200)}
    if node.devname:
        entry["node"] = text.value(f"/dev/{node.devname}", 300)
    return entry
