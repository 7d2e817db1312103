"""What is left when no class module claims a unit: a reason for each, or an open question for a USB device.

A USB device was plugged in by someone and does something; when nothing tells what, a person is asked. Everything else
that no module claims is part of the machine.
"""

import re

from octoform.builtin.identify import naming
from octoform.builtin.identify.classes import network
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.identity import names_its_chip
from octoform.builtin.identify.verdict import BIDIRECTIONAL, UNKNOWN, Claim, Evidence, Leave

_ROOT_HUB = re.compile(r"/usb\d+$")
_PCI_BUSES = ("06", "0c", "08", "05", "0604")
_BUSES = frozenset(("pci_bus", "mdio_bus", "thunderbolt", "typec", "mei", "wmi", "nvmem", "rapidio", "memory"))
_BUSES |= {"macos-usb-controller", "macos-thunderbolt"}
_PARAVIRTUAL = "virtio-pci"
_MISSING = "What is this USB device?"


def leave_first(device: Device) -> Leave | None:
    """Units that are never annotated, whatever class devices they have."""
    if device.context:
        return network.leave_context(device)
    if device.bus == "usb" and _ROOT_HUB.search(device.path):
        return Leave("bus_infrastructure", "root hub of a USB host controller")
    if _PARAVIRTUAL in device.drivers:
        return Leave("duplicate_path", "what it does stands in an entry of its own, the virtio device behind it")
    return None


def leave(device: Device) -> Leave:
    """Why a unit that no module claims is left out."""
    if device.bus == "virtual":
        return Leave("virtual", "made by the kernel; no hardware behind it")
    if device.pci_class.startswith(_PCI_BUSES) or device.bus in _BUSES:
        return Leave("bus_infrastructure", "carries other devices")
    if "tty" in device.classes:
        return Leave("unknown_meaning", "a serial port; what is connected to it is not known")
    if device.bus == "pci":
        name = naming.join(device.database.vendor, device.database.product)
        return Leave("no_standard_interface", name or "no kernel class drives it")
    if device.bus in ("i2c", "spi", "hid", "w1"):
        return Leave("no_standard_interface", "no kernel class drives it")
    return Leave("no_function", "part of the machine; nothing to read or set through a standard interface")


def claim_named(device: Device) -> Claim | None:
    """A USB device whose own strings name a product, though nothing tells what kind of thing it is.

    What it is called is known, and that it speaks a language of its own; what it does, a profile tells. A loader's or
    a reference design's string names no product, nor does that of a chip.
    """
    if device.bus != "usb" or not device.product or not device.interfaces:
        return None
    product, maker = device.product_text, device.text("manufacturer")
    named = (
        naming.is_short(device.product.text)
        and naming.names_a_product(product)
        and naming.adds_to(maker, product)
        and not names_its_chip(device)
    )
    if (
        not named
        or naming.describes_wires(product)
        or naming.describes_chip(product)
        or naming.makes_chips(maker)
        or naming.speaks_of_a_part(product)
    ):
        return None
    evidence = Evidence(device.interfaces[0].line, "an interface of its own, for a program of its own")
    return Claim("vendor", BIDIRECTIONAL, "USB device", (evidence,), settled=False)


def unknown(device: Device) -> Claim:
    """A USB device of which nothing tells what it does."""
    evidence = [device.cite_self("no interface class, driver or word tells what it does")]
    found = device.product or device.fact("manufacturer", "product_id")
    if found:
        evidence = [Evidence(found.line, "names no kind of device")]
    if device.interfaces:
        evidence.append(Evidence(device.interfaces[0].line, "a vendor's own interface"))
    return Claim("unknown", UNKNOWN, "USB device", tuple(evidence), missing=_MISSING)
