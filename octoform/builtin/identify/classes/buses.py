"""What other devices hang on: USB hubs, I2C and SPI buses, billboards, controllers."""

from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import INFRASTRUCTURE, Claim, Evidence

USB_HUB = "09"
USB_BILLBOARD = "11"
_BRIDGES = (("i2c-adapter", "I2C bus"), ("i2c-dev", "I2C bus"), ("spidev", "SPI bus"), ("spi_master", "SPI bus"))


def claim_hub(device: Device) -> Claim | None:
    """A USB hub or a billboard (which only says that a display mode failed), or nothing of the kind."""
    interface = device.usb(USB_HUB)
    if device.usb_class == USB_HUB or interface:
        evidence = device.cite_key("device_class", "USB hub") if not interface else Evidence(interface.line, "USB hub")
        return Claim("hub", INFRASTRUCTURE, "USB hub", (evidence,))
    if device.usb_class == USB_BILLBOARD or device.usb(USB_BILLBOARD):
        evidence = device.cite_key("device_class", "USB billboard class")
        return Claim("billboard", INFRASTRUCTURE, "USB billboard", (evidence,))
    return None


def claim_bridge(device: Device) -> Claim | None:
    """A bus to which chips are wired; what they are is not known from it."""
    for kernel_class, noun in _BRIDGES:
        if kernel_class in device.classes and device.bus != "virtual":
            names = tuple((f"{noun} {name}", line) for name, line in device.names(kernel_class, "name"))
            return Claim("bridge", INFRASTRUCTURE, noun, (device.cite(kernel_class, noun),), names=names)
    return None
