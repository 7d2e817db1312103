"""The outputs of lsusb: the long one (-v), the short one (ids alone) and the tree (-t, ports and drivers)."""

import re
from collections.abc import Iterator

from recordings.sysroot.tree import Tree, hex2
from recordings.sysroot.usb import Ports, UsbDevice, UsbInterface, place, put

_NO_TEXT = ("", "(error)", "--")
_HEAD = re.compile(r"Bus (\d{3}) Device (\d{3}): ID ([0-9a-fA-F]{4}):([0-9a-fA-F]{4})")


def load_long(tree: Tree, text: str, ports: Ports) -> int:
    """`lsusb -v`, also of one device without its head line and as quoted in a mail; how many devices it has."""
    devices = place(_read_long(text), ports)
    for device in devices:
        put(tree, device)
    return len(devices)


def load_short(tree: Tree, text: str, ports: Ports) -> int:
    """`lsusb`: it has only ids and bus numbers."""
    found = re.finditer(r"^Bus (\d{3}) Device (\d{3}): ID ([0-9a-f]{4}):([0-9a-f]{4})", text, re.M)
    plain = (UsbDevice(one[3], one[4], str(int(one[1])), str(int(one[2]))) for one in found)
    devices = place(plain, ports)
    for device in devices:
        put(tree, device)
    return len(devices)


def read_tree(text: str) -> Ports:
    """`lsusb -t`: the name, the drivers and the speed of every device by bus and device number."""
    ports: dict[tuple[int, int], tuple[str, dict[int, str], str | None]] = {}
    bus: int | None = None
    above: list[str] = []
    for line in text.splitlines():
        if head := re.match(r"^/:\s+Bus (\d+)\.Port (\d+): Dev (\d+), Class=([^,]*), Driver=([^,]*), ([\d.]+)M", line):
            bus, above = int(head[1]), []
            ports[bus, int(head[3])] = (f"usb{bus}", {0: "hub"}, head[6])
            continue
        found = re.match(r"^(\s*)\|__ Port (\d+): Dev (\d+), If (\d+), Class=([^,]*), Driver=([^,]*), ([\d.]+)M", line)
        if found and bus is not None:
            above = [*above[: len(found[1]) // 4 - 1], str(int(found[2]))]
            key, driver = (bus, int(found[3])), found[6].split("/")[0]
            drivers = ports[key][1] if key in ports else {}
            if driver not in ("", "[none]"):
                drivers[int(found[4])] = driver
            ports[key] = (f"{bus}-" + ".".join(above), drivers, found[7])
    return ports


def _read_long(text: str) -> Iterator[UsbDevice]:
    text = re.sub(r"^[> ]{1,4}(?=Bus \d{3} Device)", "", text, flags=re.M)
    chunks = re.split(r"^(?=Bus \d{3} Device \d{3}: ID )", text, flags=re.M)
    if not any("idVendor" in chunk for chunk in chunks[1:]):
        chunks = re.split(r"^(?=\s*Device Descriptor:)", text, flags=re.M)
    count = 0
    for chunk in chunks:
        vendor = re.search(r"idVendor\s+0x([0-9a-fA-F]{4})", chunk)
        product = re.search(r"idProduct\s+0x([0-9a-fA-F]{4})", chunk)
        if vendor and product:
            count += 1
            head = _HEAD.match(chunk)
            bus, number = (str(int(head[1])), str(int(head[2]))) if head else ("1", str(count + 1))
            device = UsbDevice(vendor[1].lower(), product[1].lower(), bus, number)
            device.attributes = _attributes(chunk)
            device.interfaces = list(_interfaces(chunk))
            yield device


def _attributes(chunk: str) -> dict[str, str | None]:
    revision = _one(r"bcdDevice\s+([0-9a-fA-F]+\.[0-9a-fA-F]+)", chunk)
    version = _one(r"bcdUSB\s+([\d.]+)", chunk)
    values: dict[str, str | None] = {
        "bcdDevice": revision.replace(".", "").zfill(4).lower() if revision else None,
        "version": version.rjust(5) if version else None,
        "bMaxPacketSize0": _one(r"bMaxPacketSize0\s+(\d+)", chunk),
        "bNumConfigurations": _one(r"bNumConfigurations\s+(\d+)", chunk),
        "bConfigurationValue": _one(r"bConfigurationValue\s+(\d+)", chunk),
        "bMaxPower": _one(r"^\s*MaxPower\s+(\d+mA)", chunk),
        "bmAttributes": _one(r"^    bmAttributes\s+0x([0-9a-f]{2})", chunk),
        "manufacturer": _string("iManufacturer", chunk),
        "product": _string("iProduct", chunk),
        "serial": _string("iSerial", chunk),
    }
    for name in ("bDeviceClass", "bDeviceSubClass", "bDeviceProtocol"):
        code = _one(name + r"\s+(\d+)", chunk)
        values[name] = hex2(code) if code else None
    return values


def _interfaces(chunk: str) -> Iterator[UsbInterface]:
    """The interfaces of the first configuration, each in its first setting."""
    configurations = re.split(r"^\s*(?=Configuration Descriptor:)", chunk, flags=re.M)
    body = configurations[1] if len(configurations) > 1 else ""
    seen = set()
    for text in re.split(r"^\s+(?=Interface Descriptor:)", body, flags=re.M)[1:]:
        number = _one(r"bInterfaceNumber\s+(\d+)", text)
        if number is None or number in seen:
            continue
        seen.add(number)
        names = ("bInterfaceClass", "bInterfaceSubClass", "bInterfaceProtocol")
        first, second, third = (hex2(_one(name + r"\s+(\d+)", text) or "0") for name in names)
        endpoints = hex2(_one(r"bNumEndpoints\s+(\d+)", text) or "0")
        yield UsbInterface(hex2(number), (first, second, third), endpoints, _string("iInterface", text))


def _one(pattern: str, text: str) -> str | None:
    found = re.search(pattern, text, re.M)
    return found[1].strip() if found else None


def _string(name: str, text: str) -> str | None:
    """A string descriptor's text; None for the index 0 and where it could not be read."""
    found = re.search(rf"^\s*{name}\s+(\d+) ?(.*)$", text, re.M)
    if not found or found[1] == "0" or found[2].strip() in _NO_TEXT:
        return None
    return found[2].strip()
