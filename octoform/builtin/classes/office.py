"""Printers and scanners; still cameras and phones that offer their files over the picture transfer class.

A printer's state is read where the kernel has a node for it. Nothing is printed: what a printer takes as text and what
as commands of its language is not shown by any interface of the system, and paper is not given back.
"""

from octoform.builtin.description import product_names
from octoform.builtin.description.class_model import (
    ACTUATOR,
    BIDIRECTIONAL,
    FLAG,
    INFRASTRUCTURE,
    SENSOR,
    TEXT,
    Capability,
    Claim,
    Evidence,
    Kind,
    listing,
    record,
)
from octoform.builtin.description.device_evidence import Device

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
        spoken = product_names.words(f"{device.strings} {device.database.product}")
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
        fields = dict(pair.split(":", 1) for pair in fact.text.split(";") if ":" in pair)
        model = fields.get("MDL") or fields.get("MODEL", "")
        if model:
            found.append((product_names.join(fields.get("MFG") or fields.get("MANUFACTURER", ""), model), fact.line))
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


# What guards keys and identities: trusted platform modules, smart card readers, security tokens, fingerprint readers.
#
# None of them gets a tool: a key store or a fingerprint is nothing that an agent should be handed.

_USB_SMART_CARD = "0b"


def claim_security(device: Device) -> Claim | None:
    """A device that keeps secrets or recognises people, or nothing of the kind."""
    if "tpm" in device.classes:
        return Claim("tpm", INFRASTRUCTURE, "trusted platform module", (device.cite("tpm", "the kernel's TPM class"),))
    for name, kind, noun in (
        ("ID_SECURITY_TOKEN", "security", "security token"),
        ("ID_HARDWARE_WALLET", "security", "hardware wallet"),
        ("ID_SMARTCARD_READER", "security", "smart card reader"),
    ):
        if found := device.udev(name):
            return Claim(kind, INFRASTRUCTURE, noun, (Evidence(found.line, "udev's rules set this property"),))
    if driver := device.udev("LIBFPRINT_DRIVER"):
        evidence = Evidence(driver.line, "the fingerprint library has a driver for it")
        return Claim("fingerprint", SENSOR, "fingerprint reader", (evidence,))
    if interface := device.usb(_USB_SMART_CARD):
        evidence = Evidence(interface.line, "USB smart card class")
        return Claim("security", INFRASTRUCTURE, "smart card reader", (evidence,))
    return None


# USB functions for engineers: test instruments, infrared links, devices waiting for new firmware.

_INSTRUMENT = "fe/03"
_HEALTH, _DIAGNOSTIC = "0f", "dc"
_INFRARED = "fe/02"
_FIRMWARE = "fe/01"


def claim_service(device: Device) -> Claim | None:
    """A test instrument, an infrared bridge, or a device that shows nothing but its firmware loader."""
    if interface := device.usb(_INSTRUMENT):
        evidence = Evidence(interface.line, "USB test and measurement class")
        # A generator and a supply speak the same class as a meter; words in the strings distinguish them before.
        return Claim("instrument", BIDIRECTIONAL, "test instrument", (evidence,))
    if interface := device.usb(_HEALTH):
        evidence = Evidence(interface.line, "USB personal healthcare class")
        return Claim("health", SENSOR, "personal health device", (evidence,))
    if interface := device.usb(_DIAGNOSTIC):
        evidence = Evidence(interface.line, "USB diagnostic class")
        return Claim("debugger", BIDIRECTIONAL, "diagnostic device", (evidence,), settled=False)
    if interface := device.usb(_INFRARED):
        return Claim("ir", BIDIRECTIONAL, "infrared bridge", (Evidence(interface.line, "USB IrDA bridge"),))
    if {"rc", "lirc"} & device.classes and "input" not in device.classes and device.bus != "usb":
        evidence, own = device.cite_self("the kernel's class for infrared remote control"), device.fact("name")
        names = ((own.text, own.line),) if own else ()
        return Claim("ir", ACTUATOR, "infrared transmitter", (evidence,), names=names, settled=False)
    interface = device.usb(_FIRMWARE)
    if interface and len(device.interfaces) == len([one for one in device.interfaces if one.triple[0] == "fe"]):
        evidence = Evidence(interface.line, "USB firmware upgrade class and nothing else")
        return Claim("mcu", INFRASTRUCTURE, "device in firmware update mode", (evidence,), settled=False)
    return None


# Printers: what they say of themselves. Printing is left to the print service of the system.

PRINTER = record(
    "Printer",
    device=TEXT,
    online=FLAG,
    out_of_paper=FLAG,
    error=FLAG,
    maker=TEXT,
    model=TEXT,
    languages=listing(TEXT),
)

KINDS = (
    Kind(
        "read_printer_status",
        "Read whether the printer is online, out of paper or in error, and which languages it takes. Prints nothing.",
        PRINTER,
        60,
    ),
)
