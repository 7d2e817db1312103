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
        if name == "usb":
            uevent = {**_usb_uevent(folder, attributes), **uevent}
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


def _usb_uevent(folder: Path, attributes: Mapping[str, str | bytes]) -> dict[str, str]:
    """The variables by which the kernel announces a USB device, and each interface with the ids of its device.

    See usb_dev_uevent and usb_uevent in drivers/usb/core of Linux.
    """
    is_interface = ":" in folder.name
    ids = [_attribute(folder.parent, attributes, name, of_parent=is_interface) for name in ("idVendor", "idProduct")]
    if not all(ids):
        return {}
    product = "/".join(f"{int(text, 16):x}" for text in (*ids, "0100"))
    return {"DEVTYPE": "usb_interface" if is_interface else "usb_device", "PRODUCT": product}


def _attribute(parent: Path, attributes: Mapping[str, str | bytes], name: str, *, of_parent: bool) -> str:
    if of_parent:
        return (parent / name).read_text().strip() if (parent / name).is_file() else ""
    given = attributes.get(name, "")
    return given.decode() if isinstance(given, bytes) else given
