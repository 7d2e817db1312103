"""Serial ports: what is wired to one cannot be known from its adapter, so most of them stay unknown.

A USB device whose strings name a real product (a radio stick, an instrument) is that product; one whose strings only
name the adapter's chip or function is a wire with something at its other end, and a person must say what. In neither
case is there a capability: bytes sent to a device of unknown meaning are no control of it.
"""

from octoform.builtin.identify import naming
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import BIDIRECTIONAL, UNKNOWN, Claim, Evidence

_CDC_SERIAL = "02/02"
_MISSING = "Say what is connected through this serial adapter, for example: '{id}: the <maker and model> on the bench'."


def claim(device: Device) -> Claim | None:
    """A product behind a serial port, a serial adapter of unknown meaning, or nothing of the kind."""
    if device.bus != "usb" or not _is_serial(device):
        return None
    port = device.usb(_CDC_SERIAL)
    evidence = (
        Evidence(port.line, "USB serial interface") if port else device.cite("tty", "a serial port of the kernel")
    )
    if naming.names_a_model(device.product_text) and not _is_chip(device):
        return Claim("serial", BIDIRECTIONAL, "serial device", (evidence,))
    name = device.product or device.fact("manufacturer")
    quotes = (Evidence(name.line, "names the adapter, not what is connected to it"),) if name else (evidence,)
    return Claim("serial", UNKNOWN, "USB serial adapter", quotes, missing=_MISSING.format(id=device.id))


def _is_serial(device: Device) -> bool:
    spoken = naming.describes_transport(f"{device.strings} {device.database.product}")
    return "tty" in device.classes or bool(device.usb(_CDC_SERIAL)) or spoken


def _is_chip(device: Device) -> bool:
    """True when the id database knows these ids as a serial chip and the product string is that chip's name."""
    told = device.database.product
    product = device.product_text
    return naming.describes_transport(told) and naming.share_a_word(told, product)
