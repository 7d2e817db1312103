"""JSON documents that hold devices: an installer's inventory of a machine, and fwupd's emulation files."""

import base64
import json
import re
from typing import Any

from recordings.sysroot.tree import Tree, last
from recordings.sysroot.udevdb import Record, load_records
from recordings.sysroot.usb import UsbDevice, UsbInterface, put

_NOT_ATTRIBUTES = ("uevent", "subsystem", "device")


def load_inventory(tree: Tree, text: str) -> int:
    """The block devices and network links that probert saw, with udev properties and attributes; how many."""
    document = json.loads(text)
    blocks = (document.get("storage") or {}).get("blockdev") or {}
    records = [_block(name, facts) for name, facts in blocks.items()]
    for link in (document.get("network") or {}).get("links") or ():
        facts = dict(link.get("udev_data") or {})
        name = (link.get("netlink_data") or {}).get("name") or facts.get("INTERFACE")
        if name:
            properties = {"SUBSYSTEM": "net"} | _texts(facts)
            attributes = _attributes(facts, _NOT_ATTRIBUTES)
            records.append(Record(properties.get("DEVPATH", f"/devices/virtual/net/{name}"), properties, attributes))
    load_records(tree, records)
    return len(records)


def _block(name: str, facts: dict[str, Any]) -> Record:
    properties = {"SUBSYSTEM": "block"} | _texts(facts)
    path = properties.get("DEVPATH", f"/devices/recorded/block/{last(name)}")
    attributes = _attributes(facts, (*_NOT_ATTRIBUTES, "dev"))
    return Record(path, properties, attributes, node=name.removeprefix("/dev/") or None)


def _texts(facts: dict[str, Any]) -> dict[str, str]:
    """The udev properties; one of several lines is none."""
    return {key: value for key, value in facts.items() if isinstance(value, str) and "\n" not in value}


def _attributes(facts: dict[str, Any], unwanted: tuple[str, ...]) -> dict[str, str]:
    """The attributes as a record of a database spells them."""
    return {
        key: value.replace("\\", "\\\\").replace("\n", "\\n")
        for key, value in (facts.get("attrs") or {}).items()
        if isinstance(value, str) and key not in unwanted
    }


def load_emulation(tree: Tree, text: str) -> int:
    """The devices of a fwupd emulation: USB descriptors, or a sysfs path and a driver; how many."""
    count = 0
    for device in json.loads(text).get("UsbDevices", ()):
        backend = device.get("BackendId", "")
        if "IdVendor" in device:
            count += 1
            put(tree, _emulated(device, count))
        elif backend.startswith("/sys/"):
            count += 1
            path, subsystem = backend.removeprefix("/sys"), device.get("Subsystem")
            tree.folder("sys" + path)
            tree.register(path, subsystem, device.get("Driver"), disk=subsystem == "block")
            if device.get("DeviceFile"):
                tree.node(device["DeviceFile"], "char")
    return count


def _emulated(device: dict[str, Any], number: int) -> UsbDevice:
    name = device.get("PlatformId") or ""
    if not re.match(r"^\d+-[\d.]+$", name):
        name = f"1-{number}"
    strings = _strings(device)
    made = UsbDevice(f"{device['IdVendor']:04x}", f"{device['IdProduct']:04x}", name.split("-")[0], name=name)
    made.attributes = {
        "bcdDevice": f"{device.get('Device', 0):04x}",
        "bDeviceClass": f"{device.get('DeviceClass', 0):02x}",
        "bDeviceSubClass": f"{device.get('DeviceSubClass', 0):02x}",
        "bDeviceProtocol": f"{device.get('DeviceProtocol', 0):02x}",
        "manufacturer": strings.get(device.get("Manufacturer")),
        "product": strings.get(device.get("Product")),
        "serial": strings.get(device.get("SerialNumber")),
    }
    interfaces: dict[int, UsbInterface] = {}
    for one in device.get("UsbInterfaces", ()):
        names = ("InterfaceClass", "InterfaceSubClass", "InterfaceProtocol")
        first, second, third = (f"{one.get(name, 0):02x}" for name in names)
        index, endpoints = one.get("InterfaceNumber", 0), f"{len(one.get('UsbEndpoints', ())):02x}"
        interfaces.setdefault(index, UsbInterface(f"{index:02x}", (first, second, third), endpoints))
    made.interfaces = list(interfaces.values())
    return made


def _strings(device: dict[str, Any]) -> dict[int | None, str]:
    """The string descriptors that were asked for while the file was recorded, by index."""
    strings: dict[int | None, str] = {}
    for event in [*device.get("UsbEvents", ()), *device.get("Events", ())]:
        found = re.match(r"GetStringDescriptor:DescIndex=0x([0-9a-f]+)$", event.get("Id", ""))
        if found and event.get("Data"):
            strings[int(found[1], 16)] = _text(event["Data"])
    return strings


def _text(data: str) -> str:
    """The reply, which is base64 of text that ends at the first zero byte, or the text itself."""
    try:
        return base64.b64decode(data).split(b"\0")[0].decode("utf-8", "replace").strip()
    except ValueError:
        return data
