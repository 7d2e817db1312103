"""What guards keys and identities: trusted platform modules, smart card readers, security tokens, fingerprint readers.

None of them gets a tool: a key store or a fingerprint is nothing that an agent should be handed.
"""

from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import INFRASTRUCTURE, SENSOR, Claim, Evidence

_USB_SMART_CARD = "0b"


def claim(device: Device) -> Claim | None:
    """A device that keeps secrets or recognises people, or nothing of the kind."""
    if "tpm" in device.classes:
        return Claim("tpm", INFRASTRUCTURE, "trusted platform module", (device.cite("tpm", "the kernel's TPM class"),))
    for name, kind, noun in (
        ("ID_SECURITY_TOKEN", "security", "security token"),
        ("ID_HARDWARE_WALLET", "security", "hardware wallet"),
        ("ID_SMARTCARD_READER", "security", "smart card reader"),
    ):
        if told := device.udev(name):
            return Claim(kind, INFRASTRUCTURE, noun, (Evidence(told.line, "udev's rules say so"),))
    if driver := device.udev("LIBFPRINT_DRIVER"):
        evidence = Evidence(driver.line, "the fingerprint library has a driver for it")
        return Claim("fingerprint", SENSOR, "fingerprint reader", (evidence,))
    if interface := device.usb(_USB_SMART_CARD):
        evidence = Evidence(interface.line, "USB smart card class")
        return Claim("security", INFRASTRUCTURE, "smart card reader", (evidence,))
    return None
