"""Network adapters: Ethernet, Wi-Fi, Bluetooth, mobile broadband. Infrastructure: named and read, never driven.

What is reached through them is not part of this host: neighbours on a network, and paired Bluetooth devices, of which
the kernel shows a device of its own as soon as one of them is connected and has a profile with a kernel class.
"""

from octoform.builtin.classes import words
from octoform.builtin.description import product_names
from octoform.builtin.description.class_model import (
    BIDIRECTIONAL,
    FLAG,
    INFRASTRUCTURE,
    TEXT,
    UNKNOWN,
    WHOLE,
    Capability,
    Claim,
    Evidence,
    Kind,
    Leave,
    listing,
    maybe,
    record,
)
from octoform.builtin.description.device_evidence import Device
from octoform.builtin.description.identity import names_its_chip
from octoform.patterns import regex

USB_BLUETOOTH = "e0/01/01"
_USB_ETHERNET = ("02/06", "02/0d", "02/0c", "e0/01/03", "ef/04/01")
_USB_MODEM = ("02/0e",)
# The kernel's drivers for mobile broadband: they bind to nothing else.
_MODEM_DRIVERS = frozenset(("option", "qmi_wwan", "cdc_mbim", "sierra", "huawei_cdc_ncm", "iosm", "mtk_t7xx"))
_PCI = {
    "0200": ("network", "network adapter"),
    "0207": ("network", "network adapter"),
    "0280": ("wifi", "wireless network adapter"),
    "0d11": ("bluetooth", "Bluetooth adapter"),
    "0d80": ("wifi", "wireless network adapter"),
}
_BLUETOOTH_WORDS = frozenset(("bluetooth", "bt"))
_VENDOR_CLASS = "ff"
# Profiles by which a connected device becomes an input device of the kernel.
_INPUT_PROFILES = ("1124 ", "1812 ")
_INPUT_KINDS = ("input",)
_LABEL = regex(r"\blabel=(.*)$")
_READ_INTERFACES = Capability(
    "read_network_interfaces",
    "Read state, speed and traffic counters of the adapter's network interfaces.",
    "Linux network class (/sys/class/net)",
)
_READ_BLUETOOTH = Capability(
    "read_bluetooth",
    "Read whether the Bluetooth adapter is switched off, how many devices are connected, and which are paired.",
    "Linux Bluetooth and rfkill classes (/sys/class/bluetooth, /sys/class/rfkill)",
)


def leave_context(device: Device) -> Leave:
    """Why something that is merely near is omitted: paired, on the other side of WSL2, or a neighbour."""
    if device.bus == "windows":
        return _leave_windows(device)
    if device.bus != "bluetooth":
        return Leave("network_neighbour", "seen on the network; not part of this host")
    if device.text("paired") in _INPUT_KINDS or any(mark in device.text("profiles") for mark in _INPUT_PROFILES):
        detail = "paired input device; while it is connected the kernel shows an input device of its own for it"
        return Leave("no_standard_interface", detail)
    return Leave("no_standard_interface", "paired, but no class of the kernel carries its profiles")


def _leave_windows(device: Device) -> Leave:
    """Hardware of the Windows side of WSL2; what stands on USB can be handed over, and the command is stated."""
    if device.fact("group"):
        return Leave("virtual", "made by Windows itself")
    labels = [
        found[1] for fact in device.facts if fact.key.startswith("function ") and (found := _LABEL.search(fact.text))
    ]
    name = ", ".join(dict.fromkeys(labels)) or device.name
    if device.text("usbipd") == "attached":
        return Leave("duplicate_path", f"{name}: handed over to this system, where it is a USB device of its own")
    if not device.vid or not (device.fact("usbipd") or device.id.startswith("windows-usb-")):
        return Leave("no_standard_interface", f"{name}: belongs to Windows, which cannot hand it over")
    ids = f"--hardware-id {device.vid}:{device.pid}"
    shared = "" if device.text("usbipd") == "shared" else f"`usbipd bind {ids}` as administrator, then "
    return Leave("not_permitted", f"{name[:100]}: belongs to Windows; run there {shared}`usbipd attach --wsl {ids}`")


def claim_bluetooth(device: Device) -> Claim | None:
    """A Bluetooth adapter: by class, by the standard interface, or a vendor's interface that states that in words."""
    if "bluetooth" in device.classes:
        evidence = device.cite("bluetooth", "the kernel's Bluetooth class")
    elif interface := device.usb(USB_BLUETOOTH):
        evidence = Evidence(interface.line, "USB Bluetooth interface")
    elif device.usb_class == _VENDOR_CLASS and _speaks_of_bluetooth(device):
        evidence = device.cite_key("product", "a vendor's interface whose name has Bluetooth")
    else:
        return None
    capabilities = (_READ_BLUETOOTH,) if "bluetooth" in device.classes else ()
    return Claim("bluetooth", INFRASTRUCTURE, "Bluetooth adapter", (evidence,), capabilities)


def claim(device: Device) -> Claim | None:
    """A wired or wireless network adapter or a modem, or nothing of the kind."""
    if device.bus == "virtual":
        return None
    readable = (_READ_INTERFACES,) if "net" in device.classes else ()
    if "wwan" in device.classes or device.usb(*_USB_MODEM) or _MODEM_DRIVERS & device.drivers:
        return Claim("modem", INFRASTRUCTURE, "mobile broadband modem", (_evidence(device, "wwan"),), readable)
    if "net" in device.classes:
        wireless = "ieee80211" in device.classes or any(fact.text == "wlan" for fact in device.of("net", "kind"))
        kind, noun = ("wifi", "wireless network adapter") if wireless else ("network", "network adapter")
        if any(fact.text == "ethernet" for fact in device.of("net", "kind")):
            noun = "Ethernet network adapter"
        if any(fact.text == "can" for fact in device.of("net", "kind")):
            return Claim("can", "bidirectional", "CAN bus adapter", (_evidence(device, "net"),), readable)
        return Claim(kind, INFRASTRUCTURE, noun, (_evidence(device, "net"),), readable)
    if "ieee80211" in device.classes:
        return Claim("wifi", INFRASTRUCTURE, "wireless network adapter", (_evidence(device, "ieee80211"),))
    if device.pci_class in _PCI:
        kind, noun = _PCI[device.pci_class]
        return Claim(kind, INFRASTRUCTURE, noun, (device.cite_key("class_code", f"PCI {noun}"),))
    if interface := device.usb(*_USB_ETHERNET):
        return Claim(
            "network",
            INFRASTRUCTURE,
            "USB Ethernet network adapter",
            (Evidence(interface.line, "USB Ethernet interface"),),
        )
    return None


def _speaks_of_bluetooth(device: Device) -> bool:
    return not _BLUETOOTH_WORDS.isdisjoint(product_names.words(device.strings))


def _evidence(device: Device, kernel_class: str) -> Evidence:
    interface = device.usb(*_USB_MODEM, *_USB_ETHERNET)
    if interface and not device.of(kernel_class):
        return Evidence(interface.line, "USB network interface")
    return device.cite(kernel_class, "the kernel's network class")


# Serial ports: what is wired to one cannot be known from its adapter, so most of them stay unknown.
#
# A USB device whose strings name a real product (a radio stick, an instrument) is that product; one whose strings only
# name the adapter's chip or function is a wire with something at its other end, and a person must say what. In neither
# case is there a capability: bytes sent to a device of unknown meaning are no control of it.

_CDC_SERIAL = "02/02"
_MISSING = "What is connected through this {noun}?"


def claim_serial(device: Device) -> Claim | None:
    """A product behind a serial port, a serial adapter of unknown meaning, or nothing of the kind."""
    if device.bus != "usb" or not _is_serial(device):
        return None
    port = device.usb(_CDC_SERIAL)
    evidence = (
        Evidence(port.line, "USB serial interface") if port else device.cite("tty", "a serial port of the kernel")
    )
    if _names_a_product(device):
        return Claim("serial", BIDIRECTIONAL, "serial device", (evidence,))
    if not device.product and _is_registered(device):
        registered = Evidence(device.database.line, f"{device.database.source}: {device.database.product}")
        return Claim("serial", BIDIRECTIONAL, "serial device", (registered, evidence), settled=False)
    name = device.product or device.fact("manufacturer")
    quotes = (Evidence(name.line, "names the adapter, not what is connected to it"),) if name else (evidence,)
    noun = "USB serial port" if port else "USB serial adapter"
    return Claim("serial", UNKNOWN, noun, quotes, missing=_MISSING.format(noun=noun))


def _is_serial(device: Device) -> bool:
    """True by the kernel's class or the interface's; else by the strings, and last by the registered name."""
    if "tty" in device.classes or device.usb(_CDC_SERIAL) or product_names.describes_transport(device.strings):
        return True
    return product_names.describes_transport(device.database.product) and not words.names_own_kind(device)


def _names_a_product(device: Device) -> bool:
    """True when the strings say more than which brand it is and which chip is in it."""
    product = device.product_text
    named = product_names.names_a_product(product) and product_names.adds_to(device.text("manufacturer"), product)
    return named and not names_its_chip(device)


def _is_registered(device: Device) -> bool:
    """True when the numbers of a device without strings were given to a product, and not to a chip or its wire.

    A product with a class of its own on USB is not behind this line: its number serves for something else here.
    """
    found = device.database.product
    if words.has_own_class(found):
        return False
    return product_names.names_a_product(found) and product_names.adds_to(device.database.vendor, found)


# Network adapters and Bluetooth adapters: their state as the kernel shows it. Nothing is sent, switched or paired.

INTERFACE = record(
    "NetworkInterface",
    name=TEXT,
    state=TEXT,
    carrier=maybe(FLAG),
    wireless=FLAG,
    speed_mbps=maybe(WHOLE),
    duplex=maybe(TEXT),
    mtu=maybe(WHOLE),
    received_bytes=maybe(WHOLE),
    sent_bytes=maybe(WHOLE),
    receive_errors=maybe(WHOLE),
    send_errors=maybe(WHOLE),
)
INTERFACES = record("NetworkInterfaces", device=TEXT, interfaces=listing(INTERFACE))
RADIO = record(
    "BluetoothRadio",
    name=TEXT,
    switched_off=maybe(FLAG),
    blocked_by_hardware=maybe(FLAG),
    connections=WHOLE,
    paired=maybe(listing(TEXT)),
)
RADIOS = record("BluetoothRadios", device=TEXT, radios=listing(RADIO))

KINDS = (
    Kind(
        "read_network_interfaces",
        "Read state, link speed in Mbit/s and traffic counters of the adapter's network interfaces.",
        INTERFACES,
        40,
    ),
    Kind(
        "read_bluetooth",
        "Read whether the Bluetooth adapter is switched off, its open connections, and the names of paired devices "
        "(null where only root may read them).",
        RADIOS,
        35,
    ),
)
