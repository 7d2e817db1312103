"""Makes units of nodes: which device owns which class devices, what each kind is called, what is its instance.

Two hosts with the same kinds of devices must get the same text wherever they are plugged in, so everything that is
ordered here is ordered by its own facts first and by where it is only among equals.
"""

import re
from collections.abc import Iterable, Mapping

from octoform.base import serials
from octoform.builtin.probe import kernel_text
from octoform.builtin.probe.sysfs import DEVICES, VIRTUAL, group_of
from octoform.builtin.probe.udev import JOINED_NAME
from octoform.builtin.probe.unit_model import (
    SCRUB_FROM,
    Node,
    Unit,
    by_class,
    in_class_order,
    in_order,
    owned,
    scrub,
    secrets_of,
)
from octoform.patterns import regex

# What a unit's kind is called and what the kernel reports of it, as text without anything of the one instance.
#
# The descriptor is lines of ``key: value``; a key holds no colon followed by a blank, a value no line end. First what
# the unit's own bus reports (``bus``, ids, strings, ``driver``, ``modalias``, ``udev.<PROPERTY>``, for USB ``interface
# NN: class cc/ss/pp driver=name label=text``), then its class devices as ``class[ordinal].key``, with ``class.count``
# before them when there are several. A class device's ordinal is its place among the ``nodes`` of that class in the
# instance. A channel of a sensor is a key (``hwmon[0].temp1: input,max label=Core 0``), its value the attributes that
# can be read.

NAME_CHARS = 200
DESCRIPTOR_CHARS = 4000
# Facts of a unit that stand before those of its class devices, without a prefix.
_UNPREFIXED = frozenset(("usb",))
_NAMING_CLASSES = (
    "nvme",
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


def name(unit: Unit, vid: str, pid: str) -> str:
    facts = dict(unit.head.lines)
    if unit.group:
        return unit.group.replace("-", " ")
    if unit.head.title:
        return kernel_text.value(unit.head.title, NAME_CHARS)
    maker = facts.get("manufacturer") or facts.get("vendor") or facts.get("udev.ID_VENDOR_FROM_DATABASE", "")
    product = facts.get("product") or facts.get("model") or facts.get("udev.ID_MODEL_FROM_DATABASE", "")
    product = product or facts.get("name") or facts.get("description", "") or _member_name(unit)
    if maker and kernel_text.slug(product).startswith(kernel_text.slug(maker)):
        maker = ""
    shown = " ".join(part for part in (maker, product) if part)
    if not product:
        kind = f"device {vid}:{pid}" if vid else unit.head.kind or unit.head.name.rstrip("0123456789")
        shown = f"{maker} {unit.head.subsystem} {kind}".strip()
    return kernel_text.value(scrub(shown, secrets_of(unit)), NAME_CHARS)


def _member_name(unit: Unit) -> str:
    """The name of the first class device that has one, the most specific name first."""
    for subsystem in _NAMING_CLASSES:
        for node in in_order(node for node in owned(unit) if node.subsystem == subsystem):
            facts = dict(node.lines)
            found = next((facts[key] for key in _NAMING_KEYS if facts.get(key)), "")
            # Behind a numbered product a class device's name may be that of a part (a camera's button).
            if found and (not unit.head.vid or subsystem in ("nvme", "tty")):
                return found
    return ""


def descriptor(unit: Unit) -> str:
    """All ``key: value`` lines, the unit's own first; cut at a line end when there are too many."""
    rows: list[tuple[str, str]] = [("bus" if not unit.head.member else "class", unit.head.subsystem)]
    if unit.group:
        rows = [("group", unit.group)]
    else:
        rows += unit.head.lines if not unit.head.member else []
        rows += [("driver", unit.head.driver), ("modalias", unit.head.modalias if not unit.head.member else "")]
        rows += [row for node in unit.members if node.subsystem in _UNPREFIXED for row in node.lines]
        rows += _member_rows([node for node in owned(unit) if node.subsystem not in _UNPREFIXED], _udev_rows(rows))
    secrets = secrets_of(unit)
    lines = [f"{key}: {kernel_text.value(scrub(text, secrets))}" for key, text in rows if text]
    return _bounded([kernel_text.visible(line[:600]) for line in lines])


def _udev_rows(rows: list[tuple[str, str]]) -> set[tuple[str, str]]:
    """udev hands properties of a device down to its class devices; once is enough."""
    return {row for row in rows if row[0].startswith("udev.")}


def _member_rows(nodes: list[Node], known: set[tuple[str, str]]) -> list[tuple[str, str]]:
    """``class[ordinal].key`` lines; the unit's own lines are not repeated, nor equal lines of many."""
    rows: list[tuple[str, str]] = []
    for subsystem, members in sorted(by_class(nodes).items()):
        speaking = [node for node in in_order(members) if node.lines or node.driver]
        if len(speaking) > 1:
            rows.append((f"{subsystem}.count", str(len(speaking))))
        alike = len(speaking) > _SAME_MANY and all(node.lines == speaking[0].lines for node in speaking)
        for index, node in enumerate(speaking[:1] if alike else speaking):
            said_here = [*dict.fromkeys(row for row in node.lines if row not in known), ("driver", node.driver)]
            said_here.sort(key=lambda row: row[0].startswith("udev."))
            rows += [(f"{subsystem}[{index}].{key}", text) for key, text in said_here if text]
    return rows


def _bounded(lines: list[str]) -> str:
    size = 0
    for index, line in enumerate(lines):
        size += len(line) + 1
        if size > DESCRIPTOR_CHARS - 40:
            return "\n".join([*lines[:index], f"more: {len(lines) - index} lines omitted"])
    return "\n".join(lines)


MAX_MEMBERS = 400
_NUMBERED = regex(r"[0-9:.].*$")
MAX_NAMES = 60
# The light of a display panel hangs below the graphics adapter in sysfs; it is a thing of its own that can be set. The
# RDMA function of a network adapter is no network interface.
_APART = frozenset(("backlight", "infiniband"))
# What drivers of cameras call the nodes that carry numbers about pictures, and none.
_SIDE_STREAM = regex(
    r"(?:^|[^a-z])(?:stats?|statistics|params?|parameters|embedded|meta(?:data)?|config)(?:$|[^a-z])", re.IGNORECASE
)
_NO_CLASS = frozenset(
    ("wakeup", "usb", "scsi", "pci_express", "i2c", "platform", "usb-serial", "serial-base", "serial", "auxiliary")
)
_ATTACHED = ("fixed", "removable")
# Numbered in the order of discovery: the name does not give the place.
_UNPLACED_BUSES = frozenset(("hid", "scsi"))


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
            head = units[key].head
            owned = node.member and node.subsystem not in _APART and not _is_side_stream(node, head)
            return key if owned or _is_cell(node, head) or _same_product(node, head) else node.path
    return node.path


def _is_side_stream(node: Node, above: Node) -> bool:
    """A video node that gives no pictures beside those that do: metadata, statistics, parameters.

    udev records what a USB camera's node can do; without its record, every second node is the one for metadata (the
    kernel makes one for each stream, after it). Boards' drivers have it in the name.
    """
    if node.subsystem != "video4linux" or not node.name.startswith(("video", "vbi")):
        return False
    if node.name.startswith("vbi"):
        return above.subsystem != "video4linux"  # the text between the pictures of a television signal
    facts = dict(node.lines)
    if above.subsystem != "usb":
        return bool(_SIDE_STREAM.search(facts.get("name", "").replace("_", " ")))
    able = facts.get("udev.ID_V4L_CAPABILITIES", "")
    return not able.strip(":") if able else facts.get("index", "0")[-1:] in "13579"


def _is_cell(node: Node, above: Node) -> bool:
    """The kernel serves a product of several functions by a driver for each, and calls these platform devices."""
    return node.subsystem == "platform" and above.subsystem in ("usb", "hid")


def _same_product(node: Node, above: Node) -> bool:
    """A HID device is its transport's own unless it states that it is another product (behind a radio receiver)."""
    if node.subsystem != "hid" or above.subsystem == "hid":
        return False
    return (above.vid, above.pid) in (("", ""), (node.vid, node.pid))


def entries(units: Iterable[Unit]) -> list[dict[str, object]]:
    """The ``devices`` of the artifact, in canonical order, ids unique."""
    made = sorted(
        ((_base(unit), descriptor(unit), kernel_text.natural(unit.head.path), unit) for unit in units),
        key=lambda row: row[:3],
    )
    numbers: dict[tuple[str, str, str], list[str]] = {}
    for base, _, _, unit in made:
        numbers.setdefault(_kind_of(base, unit), []).append(_serial(unit))
    taken: set[str] = set()
    found = []
    for base, text, _, unit in made:
        others = list(numbers[_kind_of(base, unit)])
        others.remove(_serial(unit))
        found.append(_entry(unit, _identity(base, taken), text, others))
    return found


def _kind_of(base: str, unit: Unit) -> tuple[str, str, str]:
    """The key that interchangeable units share: the product, else the name."""
    vid, pid = unit.vid_pid()
    return (vid, pid, "") if vid and pid else ("", "", base)


def _identity(base: str, taken: set[str]) -> str:
    """``base``, or with the first free ordinal from 2 on: ``hwmon-nvme``, ``hwmon-nvme-2``."""
    identity, ordinal = base, 1
    while identity in taken:
        ordinal += 1
        identity = f"{base}-{ordinal}"
    taken.add(identity)
    return identity


def _base(unit: Unit) -> str:
    if unit.group:
        return kernel_text.slug(unit.group if "-" in unit.group else f"system-{unit.group}")
    head = unit.head
    # The name of a class device gives its kind; that of a bus device only where it is.
    named = kernel_text.slug(_NUMBERED.sub("", head.name)) if head.member else ""
    kind = kernel_text.slug(head.kind or head.title) or named or "device"
    first = "cooling" if ("role", "cooling") in head.lines else kernel_text.slug(head.subsystem) or "device"
    return kind if kind.startswith(f"{first}-") or kind == first else f"{first}-{kind}"


def _entry(unit: Unit, identity: str, message: str, others: list[str]) -> dict[str, object]:
    vid, pid = unit.vid_pid()
    nodes = [unit.head, *unit.members] if not unit.group else unit.members
    entry: dict[str, object] = {
        "id": identity,
        "name": name(unit, vid, pid),
        "interface": _interface(unit),
        "raw_descriptor": message,
    }
    if vid and pid:
        entry |= {"vid": vid, "pid": pid}
    names = sorted({node.subsystem for node in owned(unit) if node.subsystem not in _NO_CLASS})
    drivers = sorted({kernel_text.value(node.driver, 60) for node in nodes if node.driver})
    if names:
        entry["classes"] = [kernel_text.value(name, 60) for name in names[:MAX_NAMES]]
    if drivers:
        entry["drivers"] = drivers[:MAX_NAMES]
    if unit.context:
        entry["context"] = True
    return entry | {"instance": _instance(unit, others)}


def _interface(unit: Unit) -> str:
    if unit.group:
        return unit.group.partition("-")[0] if "-" in unit.group else "system"
    if unit.head.path.startswith(VIRTUAL) and unit.head.member:
        return "virtual"
    return kernel_text.value(unit.head.subsystem, 40)


def _serial(unit: Unit) -> str:
    for node in (unit.head, *unit.members):
        serial = node.serial.strip()
        # A root hub gives the address of its controller as its serial number: that is a place.
        placed = len(serial) >= SCRUB_FROM and f"/{serial}/" in node.path
        # Nor is the number of the kind one of the unit.
        placed = placed or serial.casefold() in ("".join(unit.vid_pid()), "-".join(unit.vid_pid()))
        if serial and not placed and not serials.is_placeholder(serial):
            return serial
    return ""


def _kind_texts(unit: Unit) -> list[str]:
    """The texts of the unit's kind: no serial number is equal to one of these."""
    return ["".join(unit.vid_pid()), *(text for node in (unit.head, *unit.members) for _, text in node.lines)]


def _instance(unit: Unit, others: list[str]) -> dict[str, object]:
    head = unit.head
    kernel = head.path.startswith(("/sys/", "/proc/"))
    instance: dict[str, object] = {"sysfs": kernel_text.visible(head.path)[:1000]} if kernel else {}
    serial = _serial(unit)
    if not unit.group and not _is_function(head):
        instance["port"] = kernel_text.value(head.name, 200)
        counted = head.subsystem in _UNPLACED_BUSES or (head.member and head.name[-1:].isdecimal())
        place = "weak" if counted else "positional"
        instance["strength"] = (
            "strong" if serials.is_distinctive(serial, filter(None, others), _kind_texts(unit)) else place
        )
    if serial and not unit.group:
        instance["serial"] = kernel_text.value(serial, 300)
    nodes = in_class_order(owned(unit))
    address = next((node.address for node in nodes if node.address), "")
    if address and not unit.group:
        instance["address"] = kernel_text.value(address, 300)
    size = next((node.size for node in nodes if node.size is not None), None)
    if size is not None:
        instance["size_bytes"] = size
    if head.attached in _ATTACHED:
        instance["removable"] = head.attached
    instance["paths"] = [kernel_text.visible(node.path)[:1000] for node in nodes[:MAX_MEMBERS]]
    instance["nodes"] = [_node(node) for node in nodes[:MAX_MEMBERS] if node.subsystem not in _NO_CLASS]
    return instance | unit.extra


def _is_function(head: Node) -> bool:
    """Whether a unit is a function of a device that stands elsewhere: it has no place of its own."""
    return head.member and head.subsystem in ("video4linux", "infiniband") and not head.path.startswith(VIRTUAL)


def _node(node: Node) -> dict[str, str]:
    entry = {"class": kernel_text.value(node.subsystem, 60), "name": kernel_text.value(node.name, 200)}
    if node.devname:
        entry["node"] = kernel_text.value(f"/dev/{node.devname}", 300)
    return entry
