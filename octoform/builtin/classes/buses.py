"""Devices that connect others: USB hubs, I2C and SPI buses, billboards, controllers."""

from octoform.builtin.classes import words
from octoform.builtin.description import product_names
from octoform.builtin.description.class_model import BIDIRECTIONAL, INFRASTRUCTURE, SENSOR, Claim, Evidence
from octoform.builtin.description.device_evidence import Device
from octoform.patterns import regex

USB_HUB = "09"
USB_BILLBOARD = "11"
_PARTS = (
    ("watchdog", "watchdog", "watchdog timer"),
    ("infiniband", "rdma", "RDMA network adapter"),
    ("ipmi", "ipmi", "IPMI management controller"),
    ("typec", "typec", "USB-C port"),
    ("nvmem", "memory", "memory chip"),
    ("mtd", "storage", "flash memory"),
    ("remoteproc", "coprocessor", "coprocessor"),
    ("hw_random", "rng", "random number generator"),
    ("fpga_manager", "fpga", "FPGA"),
    ("accel", "accelerator", "compute accelerator"),
    ("virtio-ports", "virtual", "virtual serial port"),
    ("udc", "gadget", "USB device controller"),
    ("extcon", "connector", "connector"),
    ("ptp", "clock", "precision clock"),
    ("regulator", "regulator", "voltage regulator"),
    ("mei", "management", "management controller"),
    ("w1_master", "bridge", "1-Wire bus"),
    ("fpga_region", "fpga", "FPGA"),
)
"""Classes of the kernel that are parts of the machine: (class, kind, noun)."""
_FUNCTIONS = (
    ("nfc", "nfc", BIDIRECTIONAL, "NFC controller"),
    ("cec", "cec", BIDIRECTIONAL, "HDMI CEC adapter"),
    ("pps", "pps", SENSOR, "pulse-per-second input"),
    ("dvb", "tv_receiver", SENSOR, "digital television receiver"),
)
"""Classes of the kernel that sense or speak, and that no tool of this agent serves."""
_BUSES = {"typec": ("typec", "USB-C port"), "thunderbolt": ("thunderbolt", "Thunderbolt device")}
# Names that the device tree's specification recommends for a part, of which the kernel makes no class.
_TREE = {
    "npu": ("accelerator", "neural processing unit"),
    "crypto": ("crypto", "encryption engine"),
    "rng": ("rng", "random number generator"),
    "gpu": ("gpu", "graphics processor"),
}
_MEMORY_DRIVERS = regex(r"^(?:at2[45]|ee1004|eeprom|spd5118|m24c|w1_ds2(?:43|8))")
# PCI class codes (PCI Code and ID Assignment) of what no rule above takes: code, kind, noun.
_PCI = (
    ("0400", "capture", SENSOR, "video capture card"),
    ("0480", "multimedia", BIDIRECTIONAL, "multimedia controller"),
    ("0700", "serial", INFRASTRUCTURE, "serial port card"),
    ("0702", "serial", INFRASTRUCTURE, "serial port card"),
    ("0701", "printer_port", INFRASTRUCTURE, "parallel port card"),
    ("0703", "modem", INFRASTRUCTURE, "modem"),
    ("07", "management", INFRASTRUCTURE, "communication controller"),
    ("0805", "storage_controller", INFRASTRUCTURE, "SD card controller"),
    ("0880", "system", INFRASTRUCTURE, "system function"),
    ("09", "input", SENSOR, "input controller"),
    ("0b", "coprocessor", INFRASTRUCTURE, "coprocessor"),
    ("0c00", "firewire", INFRASTRUCTURE, "FireWire controller"),
    ("0c07", "ipmi", INFRASTRUCTURE, "IPMI management controller"),
    ("0c09", "can", BIDIRECTIONAL, "CAN bus adapter"),
    ("0d", "radio", INFRASTRUCTURE, "wireless controller"),
    ("10", "crypto", INFRASTRUCTURE, "encryption controller"),
    ("11", "signal", INFRASTRUCTURE, "signal processing controller"),
    ("12", "accelerator", INFRASTRUCTURE, "processing accelerator"),
    ("ff", "unassigned", INFRASTRUCTURE, "PCI device"),
    ("00", "unassigned", INFRASTRUCTURE, "PCI device"),
)
_VIRTIO = {"0003": "virtual serial port", "0004": "random number generator", "0005": "memory balloon"}
_BRIDGES = (("i2c-adapter", "I2C bus"), ("i2c-dev", "I2C bus"), ("spidev", "SPI bus"), ("spi_master", "SPI bus"))


def claim_hub(device: Device) -> Claim | None:
    """A USB hub or a billboard (which only states that a display mode failed), or nothing of the kind."""
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


def claim_part(device: Device) -> Claim | None:
    """A part of the machine identified by a class of the kernel, a driver of memory chips, virtio or PCI's own code."""
    if device.context:
        return None
    if any(_MEMORY_DRIVERS.match(driver) for driver in device.drivers):
        evidence, names = device.cite_self("a memory chip"), _own_name(device, " memory chip")
        return Claim("memory", INFRASTRUCTURE, "memory chip", (evidence,), names=names)
    for kernel_class, kind, category, noun in _FUNCTIONS:
        if kernel_class in device.classes and device.bus != "virtual":
            evidence, names = device.cite(kernel_class, f"the kernel's class of a {noun}"), _own_name(device)
            return Claim(kind, category, noun, (evidence,), names=names)
    for kernel_class, kind, noun in _PARTS:
        if kernel_class in device.classes and not (device.bus == "virtual" and kernel_class not in _PHYSICAL):
            names = device.names(kernel_class, "identity", "hca_type", "name", "clock_name")
            names = (*names, *_own_name(device, f" {noun}"))
            return Claim(kind, INFRASTRUCTURE, noun, (device.cite(kernel_class, f"a {noun}"),), names=names)
    return _by_bus(device)


def _by_bus(device: Device) -> Claim | None:
    """Devices identified by their bus: a port, a function of a virtual machine, a code of PCI, a plain serial port."""
    maker, model = device.fact("vendor_name"), device.fact("device_name")
    if device.bus == "typec" or (device.bus == "thunderbolt" and model):
        kind, noun = _BUSES[device.bus]
        lines = tuple(fact.line for fact in (model, maker) if fact)
        text = product_names.join(maker.text if maker else "", model.text if model else "")
        evidence = device.cite_key("bus", f"a {noun}") if not lines else Evidence(lines[0], f"a {noun}")
        return Claim(kind, INFRASTRUCTURE, noun, (evidence,), names=((text, *lines),) if text else ())
    if device.bus == "firewire" and (model := device.fact("model_name")):
        shown = words.spoken_of(model.text) or ("firewire", BIDIRECTIONAL, "FireWire device")
        name = product_names.join(maker.text if maker else "", model.text)
        return Claim(*shown, evidence=(Evidence(model.line, "what it calls itself"),), names=((name, model.line),))
    if device.bus == "virtio" and (noun := _VIRTIO.get(device.text("device")[-4:], "")):
        return Claim("virtual", INFRASTRUCTURE, noun, (device.cite_key("device", f"a {noun}"),))
    if device.text("of_name") in _TREE and device.fact("driver"):
        kind, noun = _TREE[device.text("of_name")]
        return Claim(kind, INFRASTRUCTURE, noun, (device.cite_key("of_name", f"a {noun}"),))
    for code, kind, category, noun in _PCI:
        if device.pci_class and device.pci_class.startswith(code):
            evidence = device.cite_key("class_code", f"PCI {noun}")
            # A code that stands for all multimedia is less specific than the registered name of the function, unless
            # that is a thing which neither records nor plays.
            found = words.spoken_of(device.database.product) if code.startswith("04") else None
            kind, category, noun = found if found and found[1] in (SENSOR, BIDIRECTIONAL) else (kind, category, noun)
            return Claim(kind, category, noun, (evidence,))
    return None


def claim_usb_bridge(device: Device) -> Claim | None:
    """A USB device of which the kernel made a bus for chips, and no serial line."""
    return claim_bridge(device) if device.bus == "usb" and "tty" not in device.classes else None


_PHYSICAL = frozenset(("ipmi", "watchdog", "typec", "extcon", "tpm"))


def _own_name(device: Device, noun: str = "") -> tuple[tuple[str, str], ...]:
    found = device.fact("name") if device.bus in ("i2c", "spi", "platform", "nvmem", "w1") else None
    return ((f"{found.text}{noun}", found.line),) if found else ()
