"""What a unit's kind is called and what the kernel says about it, as text without anything of the one instance.

The descriptor is lines of ``key: value``; a key holds no colon followed by a blank, a value no line end. First what the
unit's own bus says (``bus``, ids, strings, ``driver``, ``modalias``, ``udev.<PROPERTY>``, for USB ``interface NN: class
cc/ss/pp driver=name label=text``), then its class devices as ``class[ordinal].key``, with ``class.count`` before them
when there are several. A class device's ordinal is its place among the ``nodes`` of that class in the instance. A
channel of a sensor is a key (``hwmon[0].temp1: input,max label=Core 0``), its value the attributes that can be read.
"""

from octoform.builtin.probe import text
from octoform.builtin.probe.node import Node
from octoform.builtin.probe.udev import JOINED_NAME
from octoform.builtin.probe.unit import Unit, by_class, in_order, owned, scrub, secrets_of

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
    return text.value(scrub(shown, secrets_of(unit)), NAME_CHARS)


def _member_name(unit: Unit) -> str:
    """What the first class device with a name is called, in the order of how much such a name tells."""
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
    lines = [f"{key}: {text.value(scrub(said, secrets))}" for key, said in rows if said]
    return _bounded([text.visible(line[:600]) for line in lines])


def _udev_rows(rows: list[tuple[str, str]]) -> set[tuple[str, str]]:
    """udev hands properties of a device down to its class devices; said once is enough."""
    return {row for row in rows if row[0].startswith("udev.")}


def _member_rows(nodes: list[Node], known: set[tuple[str, str]]) -> list[tuple[str, str]]:
    """``class[ordinal].key`` lines; what the unit itself said already is not repeated, nor what many say alike."""
    rows: list[tuple[str, str]] = []
    for subsystem, members in sorted(by_class(nodes).items()):
        speaking = [node for node in in_order(members) if node.lines or node.driver]
        if len(speaking) > 1:
            rows.append((f"{subsystem}.count", str(len(speaking))))
        alike = len(speaking) > _SAME_MANY and all(node.lines == speaking[0].lines for node in speaking)
        for index, node in enumerate(speaking[:1] if alike else speaking):
            said_here = [*dict.fromkeys(row for row in node.lines if row not in known), ("driver", node.driver)]
            said_here.sort(key=lambda row: row[0].startswith("udev."))
            rows += [(f"{subsystem}[{index}].{key}", said) for key, said in said_here if said]
    return rows


def _bounded(lines: list[str]) -> str:
    size = 0
    for index, line in enumerate(lines):
        size += len(line) + 1
        if size > DESCRIPTOR_CHARS - 40:
            return "\n".join([*lines[:index], f"more: {len(lines) - index} lines left out"])
    return "\n".join(lines)
