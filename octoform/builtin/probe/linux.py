"""PROBE on Linux: sysfs with the udev database, the texts beside it, paired devices, and the other side of WSL2."""

import os
import re

from octoform.builtin.probe import device_units, kernel_text, wsl
from octoform.builtin.probe.commands import Command, output
from octoform.builtin.probe.paired import Paired
from octoform.builtin.probe.reader import Reader, Scan
from octoform.builtin.probe.sysfs import Sysfs
from octoform.builtin.probe.udev import UdevDatabase
from octoform.builtin.probe.unit_model import Node, Unit

# What stands beside sysfs: sound cards in words, input devices, device names, the board, the platform, neighbours.
#
# These scans enrich nodes that sysfs gave, or stand in for them where a host shows the text and not the folder.

TEXT_BYTES = 65536
_CARD = re.compile(r"^\s*(\d+)\s+\[(.{1,16}?)\s*\]:\s*(\S+)\s+-\s+(.*)$")
_PCM = re.compile(r"^(\d+)-(\d+):\s*([^:]*?)\s*:[^:]*(?::(.*))?$")
_POSITION = re.compile(r"\s+at\s+\S.*$")
_DEV_FOLDERS = ("snd", "input", "dri", "iio", "v4l", "usb", "serial", "i2c", "spi")
_OS_FIELD = re.compile(r'^([A-Z_]+)="?([^"\n]*)"?$', re.M)
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
                key, _, said = rest.partition("=")
                block[f"{kind}.{key}"] = said.strip().strip('"')
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
        """``reader`` tells which buses and classes there are, and whether this is WSL2."""
        self._reader = reader
        self._udev = UdevDatabase()
        self._sysfs = Sysfs(self._udev)
        self._context, self._paired = Context(self._sysfs.nodes), Paired()
        self._windows = wsl.Windows() if wsl.is_here(reader) else None

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
        """What the kernel shows, and what is merely near."""
        kernel = device_units.collect(dict(self._sysfs.nodes))
        near = [*self._context.units(), *self._paired.units()]
        return [*kernel, *near, *(self._windows.units() if self._windows else ())]
