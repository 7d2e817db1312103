"""The folder that stands in for a host's root: sysfs, procfs, /dev and the udev database as plain files and links.

Everything is written through one class, so that three promises hold for every format: nothing is written outside the
folder whatever a recording has, what is there already is kept (the richer recording is read first), and what was not
recorded as a file but worked out from another form of it (a udev property, a line of text) is listed as such.
"""

import json
import posixpath
import re
from contextlib import suppress
from pathlib import Path

_BUS_NAMES = """
    ac97 acpi amba ap auxiliary bcma ccw ccwgroup cec clockevents clocksource container coreisa counter cpu css dax
    edac eisa event_source firewire fsl-mc gameport genpd gpio greybus hdaudio hid host1x hsi i2c ibmebus ide ieee1394
    iio intel_th isa ishtp iucv machinecheck mcb mdio_bus media mei memory mhi mipi-dsi mmc most moxtet nd node ntb
    ntb_transport nvmem of_platform parport pci pci_express pcmcia peci platform pnp rapidio rmi4 rpmsg scmi_protocol
    scom scsi sdio serio siox slimbus snd_seq soundwire spi ssb surface_aggregator thunderbolt typec ulpi usb
    usb-serial usb_device vio virtio virtual_root visorbus vmbus vme w1 wmi workqueue xen xen-backend
    """
BUSES = frozenset(_BUS_NAMES.split())


def is_bus(subsystem: str, devpath: str) -> bool:
    """True for a device on a bus, False for one of a kernel class."""
    return subsystem in BUSES and "/class/" not in devpath


def above(path: str) -> str:
    """The folder that holds this path."""
    return path.rpartition("/")[0]


def last(path: str) -> str:
    """The last part of a path: the kernel's name of a device."""
    return path.rpartition("/")[2]


class Tree:
    """One root. Paths are relative to it (``sys/devices/...``); a device path is the kernel's (``/devices/...``)."""

    def __init__(self, root: Path) -> None:
        root.mkdir(parents=True, exist_ok=True)
        self.root = root.resolve()
        self.written = 0
        self._derived: set[str] = set()
        self._nodes: dict[str, dict[str, str | None]] = {}
        self._folders: dict[Path, bool] = {self.root: True}

    def real(self, path: str) -> Path:
        """The absolute name of a path; ``..`` does not climb out."""
        return self.root / posixpath.normpath("/" + path).lstrip("/")

    def folder(self, path: str) -> bool:
        """Make a folder and those above it; False where something else is in the way or a link leads out."""
        return self._folder(self.real(path))

    def write(self, path: str, data: str | bytes, *, derived: bool = False, keep: bool = True) -> None:
        """Write a file; with ``keep`` one that is there stays. What cannot be a file here is left out."""
        real = self.real(path)
        content = data.encode("utf-8", "surrogateescape") if isinstance(data, str) else data
        # A name that no file system takes is as good as not recorded.
        try:
            if not self._folder(real.parent) or real.is_symlink() or real.is_dir() or (keep and real.exists()):
                return
            real.write_bytes(content)
        except (OSError, ValueError):
            return
        self.written += 1
        if derived:
            self._derived.add(str(real.relative_to(self.root)))

    def attribute(self, path: str, value: str | None, *, derived: bool = False) -> None:
        """Write an attribute as the kernel shows it, with a line feed; nothing for an unknown or empty value."""
        if value:
            self.write(path, value if value.endswith("\n") else value + "\n", derived=derived)

    def link(self, path: str, target: str) -> None:
        """A relative link to another path of the tree, there or not."""
        self.raw_link(path, posixpath.relpath(self.real(target), self.real(path).parent))

    def raw_link(self, path: str, target: str) -> None:
        """A link whose text was recorded; a name that is taken stays as it is."""
        real = self.real(path)
        with suppress(OSError, ValueError):
            if self._folder(real.parent) and not real.is_symlink() and not real.exists():
                real.symlink_to(target)

    def node(self, name: str, kind: str, major: str | None = None, minor: str | None = None) -> None:
        """A device node (``video0`` or ``/dev/video0``) as an empty file, its kind and numbers in the list of nodes."""
        name = name.lstrip("/").removeprefix("dev/")
        self.write("dev/" + name, b"")
        self._nodes[name] = {"kind": kind, "major": major, "minor": minor}

    def register(
        self,
        devpath: str,
        subsystem: str | None,
        driver: str | None = None,
        *,
        disk: bool = False,
        bus: bool | None = None,
    ) -> None:
        """The links by which the kernel shows a device under its bus or class; ``bus`` overrules the name."""
        if not subsystem or subsystem == "drivers" or "/drivers/" in devpath or "/module/" in devpath:
            return
        path, name = "sys" + devpath, last(devpath)
        if subsystem == "block":
            self.link(f"sys/class/block/{name}", path)
            if disk:
                self.link(f"sys/block/{name}", path)
            self.link(path + "/subsystem", "sys/class/block")
        elif bus if bus is not None else is_bus(subsystem, devpath):
            self.link(f"sys/bus/{subsystem}/devices/{name}", path)
            self.link(path + "/subsystem", f"sys/bus/{subsystem}")
            if driver:
                self.bind(path, subsystem, driver)
                self.link(f"sys/bus/{subsystem}/drivers/{driver}/{name}", path)
        else:
            self.link(f"sys/class/{subsystem}/{name}", path)
            self.link(path + "/subsystem", f"sys/class/{subsystem}")

    def bind(self, path: str, bus: str, driver: str) -> None:
        """The device's link to its driver."""
        self.folder(f"sys/bus/{bus}/drivers/{driver}")
        self.link(path + "/driver", f"sys/bus/{bus}/drivers/{driver}")

    def finish(self) -> None:
        """Write `.recorded.json`: the count of files, those that were derived, and the device nodes."""
        record = {
            "files_written": self.written,
            "derived": sorted(self._derived),
            "nodes": self._nodes,
            "notes": [],
        }
        self.write(".recorded.json", json.dumps(record, indent=0), keep=False)

    def _folder(self, real: Path) -> bool:
        if real not in self._folders:
            self._folders[real] = self._make(real)
        return self._folders[real]

    def _make(self, real: Path) -> bool:
        try:
            real.mkdir(parents=True, exist_ok=True)
            return real.resolve().is_relative_to(self.root)
        except (OSError, ValueError, RuntimeError):
            return False


def unhex(text: str | None) -> str | None:
    r"""udev's ``\xNN`` encoding as text; the bytes are taken as UTF-8."""
    if text is None:
        return None
    raw = text.encode("utf-8", "surrogateescape")
    plain = re.sub(rb"\\x([0-9a-fA-F]{2})", lambda found: bytes([int(found[1], 16)]), raw)
    return plain.decode("utf-8", "replace").strip()


def id4(text: str) -> str:
    """A hexadecimal id as sysfs writes it: four lower-case digits."""
    return text.lower().zfill(4)


def hex2(number: str) -> str:
    """A decimal number as two hexadecimal digits."""
    return f"{int(number):02x}"
