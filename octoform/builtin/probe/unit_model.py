"""A unit: one device on a bus with everything that hangs below it, in canonical order."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from octoform.builtin.probe import kernel_text as text
from octoform.patterns import regex

# One kernel device as a scan found it, before units are made of them.


@dataclass(slots=True)
class Node:
    """A device folder of sysfs.

    ``path`` is absolute (``/sys/devices/...``), ``subsystem`` its bus or class. ``member`` states that it belongs to
    the nearest device above it (a class device, a USB interface) instead of being a unit. ``lines`` are the
    ``key, value`` facts about its kind; ``kind`` is the part of an id that distinguishes this kind from others,
    ``title`` what a person would call it. ``serial``, ``address``, ``size`` and ``attached`` (``fixed`` or
    ``removable``, as the firmware reports of the port) are facts of this one instance.
    """

    path: str
    subsystem: str
    member: bool
    lines: list[tuple[str, str]] = field(default_factory=list)
    kind: str = ""
    title: str = ""
    driver: str = ""
    modalias: str = ""
    devname: str = ""
    vid: str = ""
    pid: str = ""
    serial: str = ""
    address: str = ""
    size: int | None = None
    attached: str = ""

    @property
    def name(self) -> str:
        """The last part of the path, as the kernel calls it."""
        return self.path.rpartition("/")[2]

    def add(self, key: str, text: str) -> None:
        """One fact, omitted when there is nothing to say."""
        if text:
            self.lines.append((key, text))


_HEADS = {"input": "input", "sound": "card"}
SCRUB_FROM = 6
_HIDDEN = "<serial>"
# Words that announce a serial number, and the number, wherever a firmware has put the two.
_MARKED = regex(r"(?i)((?<![a-z])(?:s/?n|serial(?: ?no\.?| ?number)?) ?[:=#] ?)(?=[a-z-]*\d)[0-9a-z-]{4,}")


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
            if node.vid and node.pid and node.subsystem in ("usb", "pci", "hid", "bluetooth", "windows"):
                return node.vid, node.pid
        return "", ""


def owned(unit: Unit) -> list[Node]:
    """The class devices of a unit; a class device without a bus above it is its own."""
    return [unit.head, *unit.members] if unit.head.member and not unit.group else unit.members


def by_class(nodes: Iterable[Node]) -> dict[str, list[Node]]:
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


def in_class_order(nodes: Iterable[Node]) -> list[Node]:
    """Members by class, each class in the order of the descriptor's ordinals."""
    return [node for _, members in sorted(by_class(nodes).items()) for node in in_order(members)]


def secrets_of(unit: Unit) -> list[str]:
    nodes = (unit.head, *unit.members)
    said_once = {message for node in nodes for message in (node.serial, node.address) if len(message) >= SCRUB_FROM}
    # Some firmware repeats the product's name as its serial number; a number has a digit.
    found = {message for message in said_once if any(map(str.isdecimal, message))}
    return sorted(found, key=len, reverse=True)


def scrub(text: str, secrets: list[str]) -> str:
    """Some devices print their serial number into their name; an artifact about kinds must not carry it."""
    for secret in secrets:
        if secret in text:
            text = text.replace(secret, _HIDDEN)
    return _MARKED.sub(rf"\1{_HIDDEN}", text)
