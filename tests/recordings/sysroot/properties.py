"""The sysfs attributes that udev properties still carry, for recordings that hold the properties alone.

udev reads an attribute, encodes it and stores it under a name of its own; each function here undoes that for one
subsystem. Nothing is invented: a value that no property carries stays absent.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Protocol

from recordings.sysroot.tree import Tree, above, id4, unhex

Properties = Mapping[str, str]
Attributes = Iterator[tuple[str, str | None]]

_WITH_MODALIAS = frozenset(
    ("usb", "pci", "i2c", "spi", "platform", "acpi", "hid", "serio", "scsi", "pnp", "virtio", "sdio", "input")
)
_DMI = {
    "sys_vendor": "svn",
    "product_name": "pn",
    "product_version": "pvr",
    "board_vendor": "rvn",
    "board_name": "rn",
    "bios_vendor": "bvn",
    "bios_version": "bvr",
    "bios_date": "bd",
    "chassis_type": "ct",
}


class Device(Protocol):
    """What is read of a record of the database."""

    path: str
    properties: dict[str, str]
    attributes: dict[str, str]
    binaries: dict[str, str]

    @property
    def subsystem(self) -> str | None: ...

    @property
    def name(self) -> str: ...

    @property
    def folder(self) -> str: ...


def derive_attributes(tree: Tree, device: Device, known: Mapping[str, Device]) -> None:
    """Write the attributes in the device's properties; an attribute that was recorded stays."""
    for name, value in _attributes(device):
        if name not in device.attributes and name not in device.binaries:
            tree.attribute(f"{device.folder}/{name}", value, derived=True)
    if device.subsystem == "block":
        _disk_model(tree, device, known)


def _attributes(device: Device) -> Attributes:
    subsystem, properties = device.subsystem or "", device.properties
    if subsystem in _WITH_MODALIAS:
        yield "modalias", properties.get("MODALIAS")
    derive = _BY_SUBSYSTEM.get(subsystem)
    if derive:
        yield from derive(properties, device.name)


def _usb(properties: Properties, name: str) -> Attributes:
    kinds = {"usb_device": _usb_device, "usb_interface": _usb_interface}
    derive = kinds.get(properties.get("DEVTYPE", ""))
    if derive:
        yield from derive(properties, name)


def _usb_device(properties: Properties, name: str) -> Attributes:
    ids = properties.get("PRODUCT", "").split("/")
    if len(ids) == 3:
        yield from zip(("idVendor", "idProduct", "bcdDevice"), map(id4, ids), strict=True)
    yield from _triple(properties.get("TYPE"), "bDeviceClass", "bDeviceSubClass", "bDeviceProtocol")
    # udev falls back to the hexadecimal id when the device has no such string.
    for attribute, text, number in (
        ("manufacturer", "ID_VENDOR_ENC", "ID_VENDOR_ID"),
        ("product", "ID_MODEL_ENC", "ID_MODEL_ID"),
    ):
        value = unhex(properties.get(text))
        if value and value.lower() != properties.get(number, "").lower():
            yield attribute, value
    yield "serial", properties.get("ID_SERIAL_SHORT")
    for attribute, key in (("busnum", "BUSNUM"), ("devnum", "DEVNUM")):
        if properties.get(key, "").isdecimal():
            yield attribute, str(int(properties[key]))
    found = re.match(r"^(?:usb(\d+)|\d+-([\d.]+))$", name)
    if found:
        yield "devpath", found[2] or "0"


def _usb_interface(properties: Properties, name: str) -> Attributes:
    yield from _triple(properties.get("INTERFACE"), "bInterfaceClass", "bInterfaceSubClass", "bInterfaceProtocol")
    found = re.search(r":(\d+)\.(\d+)$", name)
    if found:
        yield "bInterfaceNumber", f"{int(found[2]):02x}"


def _triple(text: str | None, *names: str) -> Attributes:
    """Class, subclass and protocol: decimal numbers in the property, hexadecimal ones in sysfs."""
    numbers = (text or "").split("/")
    if len(numbers) == 3 and all(number.isdecimal() for number in numbers):
        yield from ((name, f"{int(number):02x}") for name, number in zip(names, numbers, strict=True))


def _pci(properties: Properties, _: str) -> Attributes:
    for key, vendor, device in (
        ("PCI_ID", "vendor", "device"),
        ("PCI_SUBSYS_ID", "subsystem_vendor", "subsystem_device"),
    ):
        ids = properties.get(key, "").split(":")
        if len(ids) == 2:
            yield vendor, "0x" + ids[0].lower()
            yield device, "0x" + ids[1].lower()
    if properties.get("PCI_CLASS"):
        yield "class", "0x" + properties["PCI_CLASS"].lower().zfill(6)


def _input(properties: Properties, name: str) -> Attributes:
    if not name.startswith("input"):
        return
    for key in ("NAME", "PHYS", "UNIQ"):
        yield key.lower(), properties.get(key, "").strip('"')
    yield "properties", properties.get("PROP")
    ids = properties.get("PRODUCT", "").split("/")
    if len(ids) == 4:
        yield from zip(("id/bustype", "id/vendor", "id/product", "id/version"), map(id4, ids), strict=True)
    for kind in ("EV", "KEY", "REL", "ABS", "MSC", "LED", "SND", "FF", "SW"):
        yield f"capabilities/{kind.lower()}", properties.get(kind)


def _video(properties: Properties, _: str) -> Attributes:
    yield "name", unhex(properties.get("ID_V4L_PRODUCT"))


def _net(properties: Properties, _: str) -> Attributes:
    yield "ifindex", properties.get("IFINDEX")
    found = re.match(r"^(?:en|wl|ww|ib|sl)x([0-9a-f]{12})$", properties.get("ID_NET_NAME_MAC", ""))
    if found:
        yield "address", ":".join(re.findall("..", found[1]))


def _block(properties: Properties, _: str) -> Attributes:
    yield "partition", properties.get("PARTN")


def _power_supply(properties: Properties, _: str) -> Attributes:
    prefix = "POWER_SUPPLY_"
    for key, value in properties.items():
        if key.startswith(prefix) and key != prefix + "NAME":
            yield key.removeprefix(prefix).lower(), value


def _rfkill(properties: Properties, _: str) -> Attributes:
    for name in ("name", "type", "state"):
        yield name, properties.get(f"RFKILL_{name.upper()}")


def _dmi(properties: Properties, _: str) -> Attributes:
    # The kernel removes the blanks in a modalias, so these texts are squeezed.
    modalias = properties.get("MODALIAS", "")
    if modalias.startswith("dmi:"):
        for name, key in _DMI.items():
            found = re.search(rf":{key}([^:]*)", ":" + modalias[4:])
            yield name, found[1] if found else None


def _mmc(properties: Properties, _: str) -> Attributes:
    yield "name", properties.get("MMC_NAME")
    yield "type", properties.get("MMC_TYPE")


def _serio(properties: Properties, _: str) -> Attributes:
    yield "firmware_id", properties.get("SERIO_FIRMWARE_ID")
    for name in ("type", "proto", "id", "extra"):
        yield f"id/{name}", properties.get(f"SERIO_{name.upper()}")


def _i2c(properties: Properties, _: str) -> Attributes:
    modalias = properties.get("MODALIAS", "")
    if properties.get("OF_NAME"):
        yield "name", modalias.rpartition(":")[2] or properties["OF_NAME"]
    elif modalias.startswith("i2c:"):
        yield "name", modalias[4:]


def _nvme(properties: Properties, _: str) -> Attributes:
    yield "model", properties.get("ID_MODEL")


_BY_SUBSYSTEM: dict[str, Callable[[Properties, str], Attributes]] = {
    "usb": _usb,
    "pci": _pci,
    "input": _input,
    "video4linux": _video,
    "net": _net,
    "block": _block,
    "power_supply": _power_supply,
    "rfkill": _rfkill,
    "dmi": _dmi,
    "mmc": _mmc,
    "serio": _serio,
    "i2c": _i2c,
    "nvme": _nvme,
}


def _disk_model(tree: Tree, disk: Device, known: Mapping[str, Device]) -> None:
    """A disk's model and vendor belong to the SCSI device two levels above it."""
    properties = disk.properties
    holder = above(above(disk.path))
    if properties.get("DEVTYPE") != "disk" or not properties.get("ID_MODEL"):
        return
    if holder in known and known[holder].subsystem == "scsi":
        model = unhex(properties.get("ID_MODEL_ENC")) or properties["ID_MODEL"]
        tree.attribute(f"sys{holder}/model", model, derived=True)
        if properties.get("ID_BUS") != "ata":
            vendor = unhex(properties.get("ID_VENDOR_ENC")) or properties.get("ID_VENDOR")
            tree.attribute(f"sys{holder}/vendor", vendor, derived=True)
