"""A kernel log's lines on new USB devices, and listings of /dev/serial/by-id.

Both are what people paste when they ask about one device; they have ids, strings and the tty, little more.
"""

import re

from recordings.sysroot.tree import Tree, last
from recordings.sysroot.usb import Ports, UsbDevice, put

_FOUND = "New USB device found"
_NEW = re.compile(
    rf"usb (\d+-[\d.]+|usb\d+): {_FOUND}, idVendor=([0-9a-f]{{4}}), idProduct=([0-9a-f]{{4}})"
    r"(?:, bcdDevice=\s*([0-9a-f]+\.[0-9a-f]+))?"
)
_STRINGS = {"product": "Product", "manufacturer": "Manufacturer", "serial": "SerialNumber"}
_STRING_SPAN = 4000
# The kernel's own numbers of these two drivers' nodes.
_MAJORS = {"ttyUSB": "188", "ttyACM": "166"}


def read_ports(text: str) -> Ports:
    """The port of every device that the log numbers, for other texts that have the numbers alone."""
    found = re.finditer(r"usb (\d+)-([\d.]+): new .*?USB device(?: number|.*? address) (\d+)", text)
    return {(int(one[1]), int(one[3])): (f"{one[1]}-{one[2]}", {}, None) for one in found}


def load_log(tree: Tree, text: str) -> int:
    """Devices and their ttys; how many lines named one."""
    devices: dict[str, UsbDevice] = {}
    for found in _NEW.finditer(text):
        name = found[1]
        device = UsbDevice(found[2], found[3], name.split("-")[0].replace("usb", ""), name=name)
        if found[4]:
            device.attributes["bcdDevice"] = found[4].replace(".", "").zfill(4)
        tail = text[found.end() : found.end() + _STRING_SPAN].split(_FOUND)[0]
        for attribute, word in _STRINGS.items():
            if string := re.search(rf"usb {re.escape(name)}: {word}: (.*)", tail):
                device.attributes[attribute] = string[1].strip()
        devices[name] = device
    for device in devices.values():
        put(tree, device)
    attached = re.findall(r"usb \d+-[\d.]+: \S+ converter now attached to (tty\w+)", text)
    for tty in attached:
        tree.node(tty, "char")
        tree.folder(f"sys/class/tty/{tty}")
    return len(devices) + len(attached)


def load_by_id(tree: Tree, text: str) -> int:
    """Lines with a link name of /dev/serial/by-id, perhaps its target, perhaps ids and a manufacturer."""
    count = 0
    free = dict.fromkeys(_MAJORS, 0)
    for line in text.splitlines():
        found = re.search(r"(?:/dev/serial/by-id/)?(usb-[^\s'\"]+)(?:\s+->\s+(\S+))?", line)
        if not found:
            continue
        count += 1
        link, target = found[1], found[2]
        if target:
            tty = last(target)
        else:
            driver = "ttyUSB" if "-port" in link else "ttyACM"
            tty = f"{driver}{free[driver]}"
            free[driver] += 1
        rest = line[: found.start()] + " " + line[found.end() :]
        ids = re.search(r"\b([0-9a-fA-F]{4}):([0-9a-fA-F]{4})\b", rest)
        if ids:
            maker = re.search(r"manufacturer=(?:\"([^\"]*)\"|(\S+))", line)
            device = UsbDevice(ids[1].lower(), ids[2].lower(), "1", name=f"1-{count}")
            device.attributes["manufacturer"] = (maker[1] or maker[2]) if maker else None
            put(tree, device)
        _put_tty(tree, f"1-{count}", tty, link, (ids[1].lower(), ids[2].lower()) if ids else None)
    return count


def _put_tty(tree: Tree, name: str, tty: str, link: str, ids: tuple[str, str] | None) -> None:
    """The serial port of the device ``name``: its class device, node, link and udev record."""
    by_driver = tty.startswith("ttyUSB")
    major = _MAJORS["ttyUSB" if by_driver else "ttyACM"]
    numbers = f"{major}:{re.sub(r'[^0-9]', '', tty) or '0'}"
    tree.node(tty, "char", *numbers.split(":"))
    tree.link(f"dev/serial/by-id/{link}", f"dev/{tty}")
    interface = re.search(r"-if([0-9a-f]{2})", link)
    holder = f"/devices/recorded/usb1/{name}/{name}:1.{int(interface[1], 16) if interface else 0}"
    # A USB serial driver has a port device of its own between the interface and the tty; CDC-ACM has none.
    if by_driver:
        holder += f"/{tty}"
    path = f"{holder}/tty/{tty}"
    tree.register(path, "tty")
    tree.attribute(f"sys{path}/dev", numbers, derived=True)
    tree.link(f"sys{path}/device", "sys" + holder)
    serial = re.sub(r"-if[0-9a-f]{2}(-port\d+)?$", "", link.removeprefix("usb-"))
    lines = [f"S:serial/by-id/{link}", "E:ID_BUS=usb", f"E:ID_SERIAL={serial}"]
    if ids:
        lines += [f"E:ID_VENDOR_ID={ids[0]}", f"E:ID_MODEL_ID={ids[1]}"]
    tree.write(f"run/udev/data/c{numbers}", "\n".join(lines) + "\n", derived=True)
