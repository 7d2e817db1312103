"""Printers and scanners; still cameras and phones that offer their files over the picture transfer class."""

from octoform.builtin.identify import naming
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import ACTUATOR, INFRASTRUCTURE, SENSOR, Claim, Evidence

_USB_PRINTER = "07"
_USB_STILL_IMAGE = "06"
_USB_PHONE = ("ff/42/01", "ff/42/03")
_CAMERA_WORDS = frozenset(("camera", "cam"))


def claim(device: Device) -> Claim | None:
    """A printer, a still camera or a media player, or nothing of the kind."""
    if interface := device.usb(_USB_PRINTER):
        return Claim("printer", ACTUATOR, "USB printer", (Evidence(interface.line, "USB printer class"),))
    if interface := device.usb(_USB_STILL_IMAGE):
        evidence = Evidence(interface.line, "USB still image class (PTP or MTP)")
        spoken = naming.words(f"{device.strings} {device.database.product}")
        if device.udev_text("ID_GPHOTO2") or not _CAMERA_WORDS.isdisjoint(spoken):
            return Claim("still_camera", SENSOR, "still camera", (evidence,))
        return Claim("phone", INFRASTRUCTURE, "phone or media device", (evidence,))
    return None


def claim_phone(device: Device) -> Claim | None:
    """A device whose debug or boot interface is Android's; modems and other embedded systems have one besides."""
    if interface := device.usb(*_USB_PHONE):
        return Claim(
            "phone", INFRASTRUCTURE, "Android phone", (Evidence(interface.line, "Android debug or boot interface"),)
        )
    return None
