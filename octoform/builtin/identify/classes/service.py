"""USB functions for engineers: test instruments, infrared links, devices waiting for new firmware."""

from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import ACTUATOR, BIDIRECTIONAL, INFRASTRUCTURE, SENSOR, Claim, Evidence

_INSTRUMENT = "fe/03"
_HEALTH, _DIAGNOSTIC = "0f", "dc"
_INFRARED = "fe/02"
_FIRMWARE = "fe/01"


def claim(device: Device) -> Claim | None:
    """A test instrument, an infrared bridge, or a device that shows nothing but its firmware loader."""
    if interface := device.usb(_INSTRUMENT):
        evidence = Evidence(interface.line, "USB test and measurement class")
        # A generator and a supply speak the same class as a meter; words in the strings tell them apart before.
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
