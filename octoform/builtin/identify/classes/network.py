"""Network adapters: Ethernet, Wi-Fi, Bluetooth, mobile broadband. Infrastructure: named, never driven."""

from octoform.builtin.identify import naming
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import INFRASTRUCTURE, Claim, Evidence

USB_BLUETOOTH = "e0/01/01"
_USB_ETHERNET = ("02/06", "02/0d", "02/0c", "e0/01/03", "ef/04/01")
_USB_MODEM = ("02/0e",)
# The kernel's drivers for mobile broadband: they bind to nothing else.
_MODEM_DRIVERS = frozenset(("option", "qmi_wwan", "cdc_mbim", "sierra", "huawei_cdc_ncm", "iosm", "mtk_t7xx"))
_PCI = {
    "0200": ("network", "network adapter"),
    "0207": ("network", "network adapter"),
    "0280": ("wifi", "wireless network adapter"),
    "0d11": ("bluetooth", "Bluetooth adapter"),
    "0d80": ("wifi", "wireless network adapter"),
}
_BLUETOOTH_WORDS = frozenset(("bluetooth", "bt"))
_VENDOR_CLASS = "ff"


def claim_bluetooth(device: Device) -> Claim | None:
    """A Bluetooth adapter: by class, by the standard interface, or a vendor's interface that says so in words."""
    if "bluetooth" in device.classes:
        evidence = device.cite("bluetooth", "the kernel's Bluetooth class")
    elif interface := device.usb(USB_BLUETOOTH):
        evidence = Evidence(interface.line, "USB Bluetooth interface")
    elif device.usb_class == _VENDOR_CLASS and _speaks_of_bluetooth(device):
        evidence = device.cite_key("product", "a vendor's interface whose name says Bluetooth")
    else:
        return None
    return Claim("bluetooth", INFRASTRUCTURE, "Bluetooth adapter", (evidence,))


def claim(device: Device) -> Claim | None:
    """A wired or wireless network adapter or a modem, or nothing of the kind."""
    if device.bus == "virtual":
        return None
    if "wwan" in device.classes or device.usb(*_USB_MODEM) or _MODEM_DRIVERS & device.drivers:
        return Claim("modem", INFRASTRUCTURE, "mobile broadband modem", (_evidence(device, "wwan"),))
    if "net" in device.classes:
        wireless = "ieee80211" in device.classes or any(fact.text == "wlan" for fact in device.of("net", "kind"))
        kind, noun = ("wifi", "wireless network adapter") if wireless else ("network", "network adapter")
        if any(fact.text == "can" for fact in device.of("net", "kind")):
            return Claim("can", "bidirectional", "CAN bus adapter", (_evidence(device, "net"),))
        return Claim(kind, INFRASTRUCTURE, noun, (_evidence(device, "net"),))
    if "ieee80211" in device.classes:
        return Claim("wifi", INFRASTRUCTURE, "wireless network adapter", (_evidence(device, "ieee80211"),))
    if device.pci_class in _PCI:
        kind, noun = _PCI[device.pci_class]
        return Claim(kind, INFRASTRUCTURE, noun, (device.cite_key("class_code", f"PCI {noun}"),))
    if interface := device.usb(*_USB_ETHERNET):
        return Claim(
            "network", INFRASTRUCTURE, "USB network adapter", (Evidence(interface.line, "USB Ethernet interface"),)
        )
    return None


def _speaks_of_bluetooth(device: Device) -> bool:
    return not _BLUETOOTH_WORDS.isdisjoint(naming.words(device.strings))


def _evidence(device: Device, kernel_class: str) -> Evidence:
    interface = device.usb(*_USB_MODEM, *_USB_ETHERNET)
    if interface and not device.of(kernel_class):
        return Evidence(interface.line, "USB network interface")
    return device.cite(kernel_class, "the kernel's network class")
