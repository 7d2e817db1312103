"""Serial ports: what is wired to one cannot be known from its adapter, so most of them stay unknown.

A USB device whose strings name a real product (a radio stick, an instrument) is that product; one whose strings only
name the adapter's chip or function is a wire with something at its other end, and a person must say what. In neither
case is there a capability: bytes sent to a device of unknown meaning are no control of it.
"""

from octoform.builtin.identify import naming
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.identity import names_its_chip
from octoform.builtin.identify.verdict import BIDIRECTIONAL, UNKNOWN, Claim, Evidence

_CDC_SERIAL = "02/02"
_MISSING = "What is connected through this {noun}?"


def claim(device: Device) -> Claim | None:
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
    spoken = naming.describes_transport(f"{device.strings} {device.database.product}")
    return "tty" in device.classes or bool(device.usb(_CDC_SERIAL)) or spoken


def _names_a_product(device: Device) -> bool:
    """True when the strings say more than which brand it is and which chip is in it."""
    product = device.product_text
    named = naming.names_a_product(product) and naming.adds_to(device.text("manufacturer"), product)
    return named and not names_its_chip(device)


def _is_registered(device: Device) -> bool:
    """True when the numbers of a device without strings were given to a product, and not to a chip or its wire."""
    told = device.database.product
    return naming.names_a_product(told) and naming.adds_to(device.database.vendor, told)
