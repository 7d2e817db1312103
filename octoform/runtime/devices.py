"""Finds a device by identity at the moment of a call, wherever it is plugged in now.

Generated code holds ids of kinds, never a node or a port. The instances file says which specimen an id is: where it
was seen (`sysfs`, `port`), its serial number where it has one, and how strong that identity is. Without the file the
id alone decides, by kind and ordinal (`binding` has the rules).
"""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import kinds, trace
from .binding import bind, in_place
from .faults import AmbiguousDevice, DeviceAbsent
from .locks import DEFAULT_TIMEOUT, bus
from .plainfiles import read_json
from .shape import INSTANCES, fits
from .sysfs import members, subsystem, sysroot, uevent

_cache: dict[str, tuple[tuple[int, int, int], dict[str, Any] | None]] = {}


@dataclass(frozen=True)
class Device:
    """A device as it was found: its id, its folder in sysfs, and how surely it is the one that was meant."""

    id: str
    folder: Path
    strength: str
    actuate: bool = False

    def paths(self, kind: str) -> list[Path]:
        """Folders of its class devices (``hwmon``, ``block``, ``iio`` ...) in the order of its parts; may be empty.

        A part keeps its place in the order whatever number the kernel gives it: the first of two lines is the first.
        """
        with trace.asking(self.id):
            return [trace.Folder(path) for path in members(kind) if self._owns(path)]

    def path(self, kind: str) -> Path:
        """The first folder of a class; DeviceAbsent when the device has none now."""
        found = self.paths(kind)
        if not found:
            raise DeviceAbsent(self.id, f"{self.id} is there but has no {kind} device now; its driver may be missing")
        return found[0]

    def nodes(self, kind: str, prefix: str = "") -> list[str]:
        """Device nodes of a class whose names start with ``prefix``, below the system root: ``/dev/video0``."""
        found = [_node(path) for path in self.paths(kind) if path.name.startswith(prefix)]
        return [node for node in found if node]

    def node(self, kind: str, prefix: str = "") -> str:
        """The first of them; DeviceAbsent when there is none."""
        found = self.nodes(kind, prefix)
        if not found:
            raise DeviceAbsent(self.id, f"{self.id} is there but has no {kind} node now; its driver may be missing")
        return found[0]

    @contextmanager
    def bus(self, timeout: float = DEFAULT_TIMEOUT) -> Iterator["Device"]:
        """The device with its lock held: ``with runtime.device(id).bus() as unit:``. BusBusy after ``timeout`` s."""
        with bus(self, timeout):
            yield self

    def confirm(self) -> None:
        """For a tool that acts: DeviceAbsent when the device was plugged in elsewhere while the call waited."""
        if self.actuate and device(self.id, actuate=True).folder != self.folder:
            raise DeviceAbsent(self.id, f"{self.id} was plugged in elsewhere while the call waited; call again")

    def _owns(self, path: Path) -> bool:
        if path != self.folder and self.folder not in path.parents:
            return False
        while path != self.folder:
            if kinds.is_unit(path) and not self._is_cell(path) and not self._same_product(path):
                return False
            path = path.parent
        return True

    def _is_cell(self, path: Path) -> bool:
        """A platform device below a USB or HID one serves a function of it."""
        return subsystem(path)[1] == "platform" and subsystem(self.folder)[1] in ("usb", "hid")

    def _same_product(self, path: Path) -> bool:
        """A HID device belongs to its transport unless it says that it is another product behind a receiver."""
        if subsystem(path)[1] != "hid" or subsystem(self.folder)[1] == "hid":
            return False
        return kinds.vid_pid(self.folder) in ("", kinds.vid_pid(path))


def device(device_id: str, actuate: bool = False) -> Device:
    """The device of this id as it is attached now.

    DeviceAbsent when it is not there; AmbiguousDevice when ``actuate`` is true and neither a serial number nor a place
    tells which specimen is meant.
    """
    with trace.asking(device_id):
        known = _instances()
        if known is None and actuate:
            raise AmbiguousDevice(device_id, _unknown_specimen(device_id))
        found = None if actuate else in_place(device_id, known or {})
        found = found or bind(device_id, known or {}, actuate)
    return Device(device_id, trace.Folder(found.folder), found.strength, actuate)


def _unknown_specimen(device_id: str) -> str:
    return (
        f"which unit {device_id} is cannot be read on this machine, and what moves something is not guessed; "
        "run `octoform apply -replace probe`"
    )


def _node(path: Path) -> str:
    """The node of a class device; empty for one that has none, as most have."""
    name = uevent(path).get("DEVNAME", "").removeprefix("/dev/")
    node = sysroot() / "dev" / (name or path.name.replace("!", "/"))
    return str(node) if name or node.exists() else ""


def _instances() -> Mapping[str, Any] | None:
    """The instances file's devices, read again when it changed; empty where none is named, None for one without use."""
    place = os.environ.get("OCTOFORM_INSTANCES")
    if not place:
        return {}
    try:
        status = Path(place).stat()
        stamp = (status.st_mtime_ns, status.st_size, status.st_ino)
        before = _cache.get(place)
        if before is None or before[0] != stamp:
            found = read_json(Path(place))
            _cache[place] = before = (stamp, found["devices"] if fits(found, INSTANCES) else None)
        return before[1]
    except (OSError, ValueError):
        # A reader goes on by kind, which is right for most hosts; refusing every call would be worse.
        return None
