"""Builds small trees in the form of sysfs: device folders, `subsystem` links, and the links below class and bus."""

import os
import shutil
from collections.abc import Mapping
from pathlib import Path


class Tree:
    """A system root below a folder; paths are written as the host would write them, without /sys/devices/."""

    def __init__(self, root: Path) -> None:
        self.root = root
        for folder in ("sys/devices", "dev", "proc/self"):
            (root / folder).mkdir(parents=True, exist_ok=True)

    def bus(self, path: str, bus: str, attributes: Mapping[str, str | bytes] | None = None, **uevent: str) -> Path:
        """A device on a bus."""
        return self._device(path, "bus", bus, attributes or {}, uevent)

    def member(self, path: str, kind: str, attributes: Mapping[str, str | bytes] | None = None, **uevent: str) -> Path:
        """A device of a class."""
        return self._device(path, "class", kind, attributes or {}, uevent)

    def usb(self, path: str, vid: str, pid: str, serial: str = "") -> Path:
        """A USB device with its ids, and a serial number if it has one."""
        given = {"serial": serial} if serial else {}
        return self.bus(path, "usb", {"idVendor": vid, "idProduct": pid, **given})

    def unplug(self, path: str) -> None:
        """Take a device and everything below it away, with the links to it."""
        folder = self.root / "sys/devices" / path
        shutil.rmtree(folder)
        for link in [*self.root.glob("sys/class/*/*"), *self.root.glob("sys/bus/*/devices/*")]:
            if not link.exists():
                link.unlink()

    def _device(
        self, path: str, form: str, name: str, attributes: Mapping[str, str | bytes], uevent: Mapping[str, str]
    ) -> Path:
        folder = self.root / "sys/devices" / path
        folder.mkdir(parents=True, exist_ok=True)
        listing = self.root / "sys" / form / name / ("devices" if form == "bus" else "")
        listing.mkdir(parents=True, exist_ok=True)
        (folder / "subsystem").symlink_to(os.path.relpath(self.root / "sys" / form / name, folder))
        (listing / folder.name).symlink_to(os.path.relpath(folder, listing))
        for key, value in attributes.items():
            file = folder / key
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(value if isinstance(value, bytes) else f"{value}\n".encode())
        (folder / "uevent").write_text("".join(f"{key}={value}\n" for key, value in uevent.items()))
        return folder
