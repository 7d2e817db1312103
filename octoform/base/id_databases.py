"""The host's own id databases (usb.ids, pci.ids), read for the few ids that a host has.

They are part of the operating system, like the kernel's tables; octoform ships none. A database names what a vendor
registered, which is often the chip, so its word ranks below the device's own strings. Files are searched as bytes:
parsing 40,000 lines to find twenty would cost more than all the rest of the stage.
"""

from contextlib import suppress
from pathlib import Path

from octoform.base.files import read

PLACES = {
    "usb": ("usr/share/hwdata/usb.ids", "var/lib/usbutils/usb.ids", "usr/share/misc/usb.ids"),
    "pci": ("usr/share/hwdata/pci.ids", "usr/share/misc/pci.ids"),
}
LARGEST = 16 << 20


class IdDatabases:
    """Look-ups below one sysroot; a file is read once, when the first id of its bus is asked for."""

    def __init__(self, sysroot: Path) -> None:
        self._sysroot = sysroot
        self._text: dict[str, bytes] = {}

    def lookup(self, bus: str, vendor: str, product: str) -> tuple[str, str]:
        """(vendor name, product name) of two 4-digit ids; empty strings for what the database does not know."""
        text = self._read(bus)
        start = text.find(f"\n{vendor.lower()}  ".encode()) if vendor else -1
        if start < 0:
            return "", ""
        block = _block(text, start + 1)
        vendor_name = block.split(b"\n", 1)[0][6:]
        mark = f"\n\t{product.lower()}  ".encode()
        found = block.find(mark)
        product_name = block[found + len(mark) :].split(b"\n", 1)[0] if found >= 0 else b""
        return _decode(vendor_name), _decode(product_name)

    def _read(self, bus: str) -> bytes:
        if bus not in self._text:
            self._text[bus] = self._load(PLACES.get(bus, ()))
        return self._text[bus]

    def _load(self, places: tuple[str, ...]) -> bytes:
        for place in places:
            path = self._sysroot / place
            # An absolute link below a sysroot would read another system's file.
            if path.is_symlink() and self._sysroot != Path("/"):
                continue
            if path.is_file():
                with suppress(OSError):
                    return b"\n" + read(path, LARGEST)
        return b""


def _block(text: bytes, start: int) -> bytes:
    """The vendor's line and the indented lines below it."""
    end = text.find(b"\n", start)
    while end >= 0 and text[end + 1 : end + 2] in (b"\t", b"#"):
        end = text.find(b"\n", end + 1)
    return text[start:] if end < 0 else text[start:end]


def _decode(raw: bytes) -> str:
    return " ".join(raw.decode("utf-8", "replace").split())
