"""The host's own id databases (usb.ids, pci.ids, else udev's hwdb), read for the few ids that a host has.

They are part of the operating system, like the kernel's tables; octoform ships none. A database names what a vendor
registered, which is often the chip, so its word ranks below the device's own strings. Files are searched as bytes:
parsing 40,000 lines to find twenty would cost more than all the rest of the stage.
"""

import re
from contextlib import suppress
from pathlib import Path

from octoform.base.files import read

PLACES = {
    "usb": ("usr/share/hwdata/usb.ids", "var/lib/usbutils/usb.ids", "usr/share/misc/usb.ids"),
    "pci": ("usr/share/hwdata/pci.ids", "usr/share/misc/pci.ids"),
}
SOURCES = ("lib/udev/hwdb.d", "usr/lib/udev/hwdb.d", "etc/udev/hwdb.d")
"""Folders of what udev's own database is made of; a file of a later one takes the place of one of its name."""
LARGEST = 16 << 20
_MATCHES = {"usb": ("usb:v{}*", "usb:v{}p{}*"), "pci": ("pci:v0000{}*", "pci:v0000{}d0000{}*")}
_NAMES = ("ID_VENDOR_FROM_DATABASE", "ID_MODEL_FROM_DATABASE")


class IdDatabases:
    """Look-ups below one sysroot; a file is read once, when the first id of its bus is asked for."""

    def __init__(self, sysroot: Path) -> None:
        self._sysroot = sysroot
        self._text: dict[str, bytes] = {}

    def lookup(self, bus: str, vendor: str, product: str) -> tuple[str, str]:
        """(vendor name, product name) of two 4-digit ids; empty strings for what the database does not know."""
        text = self._read(bus)
        if not text:
            return self._of_udev(bus, vendor, product)
        start = text.find(f"\n{vendor.lower()}  ".encode()) if vendor else -1
        if start < 0:
            return "", ""
        block = _block(text, start + 1)
        vendor_name = block.split(b"\n", 1)[0][6:]
        mark = f"\n\t{product.lower()}  ".encode()
        found = block.find(mark)
        product_name = block[found + len(mark) :].split(b"\n", 1)[0] if found >= 0 else b""
        return _decode(vendor_name), _decode(product_name)

    def source(self, bus: str) -> str:
        """The name of a bus's database: by its file, or by its owner."""
        return f"{bus}.ids" if self._read(bus) else "udev hwdb"

    def _of_udev(self, bus: str, vendor: str, product: str) -> tuple[str, str]:
        """The same from what udev's own database is made of, for systems that have no other."""
        if not vendor or bus not in _MATCHES:
            return "", ""
        text = self._hwdb()
        maker, model = (each.format(vendor.upper(), product.upper()) for each in _MATCHES[bus])
        return _property(text, maker, _NAMES[0]), _property(text, model, _NAMES[1]) if product else ""

    def _hwdb(self) -> bytes:
        if "hwdb" not in self._text:
            files: dict[str, Path] = {}
            for folder in SOURCES:
                place = self._sysroot / folder
                if place.is_dir() and not self._leads_out(place):
                    files.update({path.name: path for path in place.glob("*.hwdb")})
            texts = (self._load((str(files[name].relative_to(self._sysroot)),)) for name in sorted(files))
            self._text["hwdb"] = b"\n".join(text for text in texts if b"\nusb:v" in text or b"\npci:v" in text)
        return self._text["hwdb"]

    def _read(self, bus: str) -> bytes:
        if bus not in self._text:
            self._text[bus] = self._load(PLACES.get(bus, ()))
        return self._text[bus]

    def _load(self, places: tuple[str, ...]) -> bytes:
        for place in places:
            path = self._sysroot / place
            if not self._leads_out(path) and path.is_file():
                with suppress(OSError):
                    return b"\n" + read(path, LARGEST)
        return b""

    def _leads_out(self, path: Path) -> bool:
        """Whether a link leads to a file of another system than that of the sysroot."""
        return not path.resolve().is_relative_to(self._sysroot.resolve())


def _property(text: bytes, match: str, name: str) -> str:
    """The value that the last record of these matches gives; udev lets a later one replace it."""
    mark, value = f"\n{match}\n".encode(), b""
    at = text.find(mark)
    while at >= 0:
        record = text[at + 1 : _end(text, at)]
        if found := re.search(rb"(?m)^ " + name.encode() + rb"=(.*)$", record):
            value = found[1]
        at = text.find(mark, at + 1)
    return _decode(value)


def _end(text: bytes, start: int) -> int:
    """Where a record ends: at an empty line, or with the file."""
    found = text.find(b"\n\n", start + 1)
    return len(text) if found < 0 else found


def _block(text: bytes, start: int) -> bytes:
    """The vendor's line and the indented lines below it."""
    end = text.find(b"\n", start)
    while end >= 0 and text[end + 1 : end + 2] in (b"\t", b"#"):
        end = text.find(b"\n", end + 1)
    return text[start:] if end < 0 else text[start:end]


def _decode(raw: bytes) -> str:
    return " ".join(raw.decode("utf-8", "replace").split())
