"""Finds a device by identity at the moment of a call, wherever it is plugged in now.

Generated code holds ids of kinds, never a node or a port. The instances file says which specimen an id is: where it
was seen (`sysfs`, `port`), its serial number where it has one, and how strong that identity is. Without the file the
id alone decides, by kind and ordinal.
"""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import kinds
from .faults import AmbiguousDevice, DeviceAbsent
from .locks import DEFAULT_TIMEOUT, Bus
from .sysfs import members, natural, subsystem, sysroot, uevent

STRONG, POSITIONAL, WEAK = "strong", "positional", "weak"
_cache: dict[str, tuple[tuple[int, int], dict[str, Any]]] = {}


@dataclass(frozen=True)
class Device:
    """A device as it was found: its id, its folder in sysfs, and how surely it is the one that was meant."""

    id: str
    folder: Path
    strength: str

    def paths(self, kind: str) -> list[Path]:
        """Folders of its class devices (``hwmon``, ``block``, ``iio`` ...) in natural order; may be empty."""
        found = [path for path in members(kind) if self._owns(path)]
        return sorted(found, key=lambda path: natural(path.name))

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
        with Bus(str(self.folder), timeout):
            yield self

    def _owns(self, path: Path) -> bool:
        if path != self.folder and self.folder not in path.parents:
            return False
        while path != self.folder:
            if kinds.is_unit(path) and not self._same_product(path):
                return False
            path = path.parent
        return True

    def _same_product(self, path: Path) -> bool:
        """A HID device belongs to its transport unless it says that it is another product behind a receiver."""
        if subsystem(path)[1] != "hid" or subsystem(self.folder)[1] == "hid":
            return False
        return kinds.vid_pid(self.folder) in ("", kinds.vid_pid(path))


def device(device_id: str, actuate: bool = False) -> Device:
    """The device of this id as it is attached now.

    DeviceAbsent when it is not there; AmbiguousDevice when ``actuate`` is true, several specimens of the kind are
    there, and neither a serial number nor the place tells which one is meant.
    """
    known = _instances()
    instance = known.get(device_id)
    if isinstance(instance, Mapping):
        found = _recorded(device_id, instance)
        return found or _moved(device_id, instance, known, actuate)
    return _by_kind(device_id, actuate)


def _recorded(device_id: str, instance: Mapping[str, Any]) -> Device | None:
    """The device where it was last seen, if what is there now does not contradict its identity."""
    place = str(instance.get("sysfs") or "")
    if not place.startswith("/sys/"):
        return None
    folder = (sysroot() / place.lstrip("/")).resolve()
    if not folder.is_dir() or kinds.contradicts(folder, device_id):
        return None
    wanted, seen = _serial(instance), kinds.serial(folder)
    if wanted and seen and wanted != seen:
        return None
    return Device(device_id, folder, str(instance.get("strength") or POSITIONAL))


def _moved(device_id: str, instance: Mapping[str, Any], known: Mapping[str, Any], actuate: bool) -> Device:
    """The device somewhere else: by serial number, else the one specimen that no other id lays claim to."""
    candidates = kinds.specimens(device_id)
    wanted = _serial(instance)
    for folder in candidates:
        if wanted and kinds.serial(folder) == wanted:
            return Device(device_id, folder, STRONG)
    if wanted and any(kinds.serial(folder) for folder in candidates):
        text = f"{device_id} is not attached; a device of the same kind with another serial number is"
        raise DeviceAbsent(device_id, text)
    taken = {
        str(other.get("sysfs")) for name, other in known.items() if name != device_id and isinstance(other, Mapping)
    }
    free = [folder for folder in candidates if _absolute(folder) not in taken]
    same_port = [folder for folder in free if folder.name == instance.get("port")]
    return _choose(device_id, same_port if len(same_port) == 1 else free, 1, actuate)


def _by_kind(device_id: str, actuate: bool) -> Device:
    candidates = kinds.specimens(device_id)
    if actuate and len(candidates) > 1:
        raise AmbiguousDevice(device_id, _doubt(device_id, candidates))
    return _choose(device_id, candidates, kinds.ordinal_of(device_id), actuate)


def _choose(device_id: str, candidates: list[Path], ordinal: int, actuate: bool) -> Device:
    if len(candidates) < ordinal:
        raise DeviceAbsent(device_id, f"{device_id} is not attached, or its driver does not see it")
    if actuate and len(candidates) > 1:
        raise AmbiguousDevice(device_id, _doubt(device_id, candidates))
    return Device(device_id, candidates[ordinal - 1], WEAK)


def _doubt(device_id: str, candidates: list[Path]) -> str:
    places = ", ".join(folder.name for folder in candidates[:4])
    return f"{device_id} may be any of {len(candidates)} equal devices ({places}); leave only one attached"


def _serial(instance: Mapping[str, Any]) -> str:
    """Its serial number where that is an identity: an empty one, or one shared by others, is none."""
    return str(instance.get("serial") or "").strip() if instance.get("strength") == STRONG else ""


def _absolute(folder: Path) -> str:
    """A folder as the host names it, without the system root."""
    root = sysroot().resolve()
    return "/" + str(folder.relative_to(root)) if folder.is_relative_to(root) else str(folder)


def _node(path: Path) -> str:
    """The node of a class device; empty for one that has none, as most have."""
    name = uevent(path).get("DEVNAME", "").removeprefix("/dev/")
    node = sysroot() / "dev" / (name or path.name.replace("!", "/"))
    return str(node) if name or node.exists() else ""


def _instances() -> Mapping[str, Any]:
    """The instances file's devices, read again when it changed; empty without a file."""
    place = os.environ.get("OCTOFORM_INSTANCES")
    if not place:
        return {}
    try:
        status = Path(place).stat()
        stamp = (status.st_mtime_ns, status.st_size)
        before = _cache.get(place)
        if before is None or before[0] != stamp:
            devices = json.loads(Path(place).read_bytes()).get("devices")
            _cache[place] = before = (stamp, devices if isinstance(devices, dict) else {})
        return before[1]
    except (OSError, ValueError, AttributeError):
        # Identity by kind is weaker but right for most hosts; refusing every call would be worse.
        return {}
