"""A USB device with its interfaces as sysfs shows it, from whatever a text said of it.

lsusb, usb-devices, a kernel log and fwupd's emulation files describe the same descriptors in different words; each of
their readers makes a `UsbDevice`, and this module alone knows how the kernel lays one out.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from recordings.sysroot.tree import Tree

# (bus, device number) -> (kernel name, driver of each interface number, speed in Mbit/s); from `lsusb -t` or a log.
Ports = Mapping[tuple[int, int], tuple[str, Mapping[int, str], str | None]]

_ROOT_HUBS = frozenset({("1d6b", "0001"), ("1d6b", "0002"), ("1d6b", "0003")})


@dataclass(frozen=True)
class UsbInterface:
    """One interface; number and class codes as two hexadecimal digits, ``text`` is its own string."""

    number: str
    codes: tuple[str, str, str]
    endpoints: str | None = None
    text: str | None = None
    driver: str | None = None


@dataclass
class UsbDevice:
    """One device; ``attributes`` has sysfs names, ``number`` is its number on the bus where that was recorded."""

    vendor: str
    product_id: str
    bus: str
    number: str | None = None
    name: str = ""
    attributes: dict[str, str | None] = field(default_factory=dict)
    interfaces: list[UsbInterface] = field(default_factory=list)
    drivers: Mapping[int, str] = field(default_factory=dict)

    @property
    def codes(self) -> tuple[str, str, str]:
        """Class, subclass and protocol of the device, two hexadecimal digits each."""
        names = ("bDeviceClass", "bDeviceSubClass", "bDeviceProtocol")
        first, second, third = (self.attributes.get(name) or "00" for name in names)
        return first, second, third


def place(devices: Iterable[UsbDevice], ports: Ports) -> list[UsbDevice]:
    """Give each device the name the kernel gave it; where no port is known, the device number stands in for it."""
    placed, used = [], set()
    for device in devices:
        bus, number = int(device.bus), int(device.number or 2)
        if (bus, number) in ports:
            device.name, device.drivers, device.attributes["speed"] = ports[bus, number]
        elif (device.vendor, device.product_id) in _ROOT_HUBS:
            device.name = f"usb{bus}"
        else:
            device.name = f"{bus}-{number}"
        while device.name in used:
            device.name += "9"
        used.add(device.name)
        placed.append(device)
    return placed


def put(tree: Tree, device: UsbDevice) -> None:
    """Write a device and its interfaces below /sys/devices."""
    folder = _folder(tree, device.name)
    values: dict[str, str | None] = {
        "idVendor": device.vendor,
        "idProduct": device.product_id,
        "busnum": device.bus,
        "devnum": device.number,
        **device.attributes,
    }
    if device.interfaces:
        values["bNumInterfaces"] = f"{len(device.interfaces):2d}"
    if found := re.match(r"^(?:usb\d+|\d+-([\d.]+))$", device.name):
        values["devpath"] = found[1] or "0"
    revision = int(device.attributes.get("bcdDevice") or "0", 16)
    uevent = ["DEVTYPE=usb_device", "DRIVER=usb"]
    uevent.append(f"PRODUCT={int(device.vendor, 16):x}/{int(device.product_id, 16):x}/{revision:x}")
    if device.attributes.get("bDeviceClass"):
        uevent.append("TYPE=" + _decimal(device.codes))
    if device.bus and device.number:
        bus, number = int(device.bus), int(device.number)
        minor, node = (bus - 1) * 128 + number - 1, f"bus/usb/{bus:03d}/{number:03d}"
        uevent += [f"BUSNUM={bus:03d}", f"DEVNUM={number:03d}", "MAJOR=189", f"MINOR={minor}", f"DEVNAME={node}"]
        values["dev"] = f"189:{minor}"
        tree.node(node, "char", "189", str(minor))
    for name, value in values.items():
        tree.attribute(f"{folder}/{name}", value, derived=True)
    tree.register(folder.removeprefix("sys"), "usb", "usb")
    tree.write(folder + "/uevent", "\n".join(uevent) + "\n", derived=True)
    for interface in device.interfaces:
        _put_interface(tree, device, interface, folder)


def _folder(tree: Tree, name: str) -> str:
    """Where the device lies: where a better recording has put it already, else below a controller of no kind."""
    known = tree.real(f"sys/bus/usb/devices/{name}")
    if known.exists():
        return str(known.resolve().relative_to(tree.root))
    if name.startswith("usb"):
        return f"sys/devices/recorded/{name}"
    bus, _, port = name.partition("-")
    parts = port.split(".")
    chain = [f"{bus}-" + ".".join(parts[: depth + 1]) for depth in range(len(parts))]
    return "/".join([f"sys/devices/recorded/usb{bus}", *chain])


def _put_interface(tree: Tree, device: UsbDevice, interface: UsbInterface, folder: str) -> None:
    number = int(interface.number, 16)
    owner = device.name[3:] + "-0" if device.name.startswith("usb") else device.name
    folder = f"{folder}/{owner}:{device.attributes.get('bConfigurationValue') or '1'}.{number}"
    driver = device.drivers.get(number, interface.driver)
    modalias = _modalias(device, interface)
    values = {
        "bInterfaceNumber": interface.number,
        "bInterfaceClass": interface.codes[0],
        "bInterfaceSubClass": interface.codes[1],
        "bInterfaceProtocol": interface.codes[2],
        "bNumEndpoints": interface.endpoints,
        "bAlternateSetting": " 0",
        "interface": interface.text,
        "modalias": modalias,
    }
    for name, value in values.items():
        tree.attribute(f"{folder}/{name}", value, derived=True)
    uevent = ["DEVTYPE=usb_interface", *([f"DRIVER={driver}"] if driver else [])]
    uevent += ["INTERFACE=" + _decimal(interface.codes), "MODALIAS=" + modalias]
    tree.write(folder + "/uevent", "\n".join(uevent) + "\n", derived=True)
    tree.register(folder.removeprefix("sys"), "usb", driver, bus=True)


def _decimal(codes: Iterable[str]) -> str:
    return "/".join(str(int(code, 16)) for code in codes)


def _modalias(device: UsbDevice, interface: UsbInterface) -> str:
    ids = (device.vendor, device.product_id, device.attributes.get("bcdDevice") or "0000")
    parts = zip(
        ("v", "p", "d", "dc", "dsc", "dp", "ic", "isc", "ip", "in"),
        (*ids, *device.codes, *interface.codes, interface.number),
        strict=True,
    )
    return "usb:" + "".join(key + value.upper() for key, value in parts)
