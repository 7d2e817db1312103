"""A device dump of Network UPS Tools: variables of one UPS, among them the USB ids the driver matched."""

import re

from recordings.sysroot.tree import Tree
from recordings.sysroot.usb import UsbDevice, put

_ID = re.compile(r"[0-9a-fA-F]{4}")


def load(tree: Tree, text: str) -> int:
    """Write the USB device, where the dump has its ids; 1 or 0."""
    values = dict(re.findall(r"^([a-z][\w.-]+): ?(.*)$", text, re.M))
    tree.write("run/recorded/nut.txt", text)
    vendor, product = (
        values.get(f"ups.{name}") or values.get(f"driver.parameter.{name}") or "" for name in ("vendorid", "productid")
    )
    if not (_ID.fullmatch(vendor) and _ID.fullmatch(product)):
        return 0
    device = UsbDevice(vendor.lower(), product.lower(), "1", "2", name="1-1")
    # These two parameters are the USB strings by which the driver found the device.
    strings = {"manufacturer": values.get("driver.parameter.vendor"), "product": values.get("driver.parameter.product")}
    if values.get("driver.name", "").startswith(("usbhid", "newhidups")):
        strings["manufacturer"] = strings["manufacturer"] or values.get("ups.mfr")
        strings["product"] = strings["product"] or values.get("ups.model")
        strings["serial"] = values.get("ups.serial")
    device.attributes.update(strings)
    put(tree, device)
    return 1
