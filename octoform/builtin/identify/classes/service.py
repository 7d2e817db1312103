"""USB functions for engineers: test instruments, infrared links, devices waiting for new firmware."""

from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import BIDIRECTIONAL, INFRASTRUCTURE, SENSOR, Claim, Evidence

_INSTRUMENT = "fe/03"
_INFRARED = "fe/02"
_FIRMWARE = "fe/01"


def claim(device: Device) -> Claim | None:
    """A test instrument, an infrared bridge, or a device that shows nothing but its firmware loader."""
    if interface := device.usb(_INSTRUMENT):
        evidence = Evidence(interface.line, "USB test and measurement class")
        return Claim("instrument", SENSOR, "test instrument", (evidence,))
    if interface := device.usb(_INFRARED):
        return Claim("ir", BIDIRECTIONAL, "infrared bridge", (Evidence(interface.line, "USB IrDA bridge"),))
    interface = device.usb(_FIRMWARE)
    if interface and len(device.interfaces) == len([one for one in device.interfaces if one.triple[0] == "fe"]):
        evidence = Evidence(interface.line, "USB firmware upgrade class and nothing else")
        return Claim("mcu", INFRASTRUCTURE, "device in firmware update mode", (evidence,), settled=False)
    return None
