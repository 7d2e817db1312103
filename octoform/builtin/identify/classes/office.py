"""Printers and scanners; still cameras and phones that offer their files over the picture transfer class.

A printer's state is read where the kernel has a node for it. Nothing is printed: what a printer takes as text and what
as commands of its language is not told by any interface of the system, and paper is not given back.
"""

from octoform.builtin.identify import naming
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import (
    ACTUATOR,
    INFRASTRUCTURE,
    SENSOR,
    Capability,
    Claim,
    Evidence,
)

_USB_PRINTER = "07"
_USB_STILL_IMAGE = "06"
_USB_PHONE = ("ff/42/01", "ff/42/03")
_CAMERA_WORDS = frozenset(("camera", "cam", "dsc", "dslr"))


def claim(device: Device) -> Claim | None:
    """A printer, a still camera or a media player, or nothing of the kind."""
    if interface := device.usb(_USB_PRINTER):
        evidence = Evidence(interface.line, "USB printer class")
        return Claim("printer", ACTUATOR, "USB printer", (evidence,), _printer(device), _printer_names(device))
    if interface := device.usb(_USB_STILL_IMAGE):
        evidence = Evidence(interface.line, "USB still image class (PTP or MTP)")
        spoken = naming.words(f"{device.strings} {device.database.product}")
        if device.udev_text("ID_GPHOTO2") or not _CAMERA_WORDS.isdisjoint(spoken):
            return Claim("still_camera", SENSOR, "still camera", (evidence,))
        return Claim("phone", INFRASTRUCTURE, "still image and media transfer device", (evidence,))
    return None


def _printer(device: Device) -> tuple[Capability, ...]:
    if not any(kind == "usbmisc" and name.startswith("lp") for kind, name in device.nodes):
        return ()
    description = "Read whether the printer is online, out of paper or in error, and the languages that it takes."
    return (Capability("read_printer_status", description, "Linux usblp (/dev/usb/lpN, LPGETSTATUS)"),)


def _printer_names(device: Device) -> tuple[tuple[str, str], ...]:
    """Maker and model from the printer's IEEE 1284 id."""
    found = []
    for fact in device.of("usbmisc", "ieee1284_id"):
        told = dict(pair.split(":", 1) for pair in fact.text.split(";") if ":" in pair)
        model = told.get("MDL") or told.get("MODEL", "")
        if model:
            found.append((naming.join(told.get("MFG") or told.get("MANUFACTURER", ""), model), fact.line))
    return tuple(found)


def claim_phone(device: Device) -> Claim | None:
    """A device with Android's debug or boot interface; several lines of its vendor's own besides are a modem's."""
    interface = device.usb(*_USB_PHONE)
    if not interface:
        return None
    evidence = (Evidence(interface.line, "Android debug or boot interface"),)
    lines = [one for one in device.interfaces if one.triple[0] == "ff" and "/".join(one.triple) not in _USB_PHONE]
    if len(lines) > 1:
        return Claim("modem", INFRASTRUCTURE, "mobile broadband modem", evidence, settled=False)
    return Claim("phone", INFRASTRUCTURE, "Android phone", evidence)
