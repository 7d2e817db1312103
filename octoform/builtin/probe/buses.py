"""Facts of a device by its bus: identity of the kind, strings, instance facts.

A table of attributes for each bus, a function where ids are packed into something else. The names of the buses and
attributes are those of the kernel's own documentation (Documentation/ABI).
"""

from collections.abc import Callable, Mapping

from octoform.builtin.probe import capabilities
from octoform.builtin.probe.kernel_text import slug
from octoform.builtin.probe.reader import Reader
from octoform.builtin.probe.unit_model import Node
from octoform.patterns import regex

# Buses whose devices are parts of the device above them: ports, channels, functions.
MEMBER_BUSES = frozenset(
    (
        *("auxiliary", "cec", "counter", "genpd", "gpio", "hdaudio", "iio", "media", "nvmem", "pci_express"),
        *("rmi4", "sdio", "serial-base", "siox", "snd_seq", "spi_master", "ulpi", "usb-serial", "usb_device"),
    )
)
# Buses whose devices are numbered parts of the machine itself: one unit for all of them.
SYSTEM_BUSES = frozenset(
    (
        *("clockevents", "clocksource", "container", "cpu", "edac", "event_source"),
        *("machinecheck", "memory", "memory_tiering", "node", "workqueue"),
    )
)
ATTRIBUTES: Mapping[str, tuple[str, ...]] = {
    "firewire": ("vendor_name", "model_name", "hardware_version"),
    "i2c": ("name",),
    "mdio_bus": ("phy_id",),
    "mei": ("name",),
    "nd": ("devtype",),
    "pnp": ("id",),
    "serio": ("description", "firmware_id"),
    "soc": ("machine", "family", "soc_id", "revision"),
    "thunderbolt": ("vendor_name", "device_name"),
    "typec": ("svid", "description"),
    "vmbus": ("class_id",),
    "xen": ("devtype",),
}
_PLAIN_MODALIAS = frozenset(("spi", "i2c", "platform", "acpi", "wmi", "rpmsg", "tee", "scmi", "mdio"))
# A device without a name on these is called by its place only, which is nothing for an id.
_NAMED_BY_PLACE = frozenset(("i2c", "spi", "mdio_bus", "pnp", "serio", "serial", "soundwire", "rapidio", "eisa", "nd"))
_KERNEL_VERSION = regex(r"^Linux \d\S* ")
_AT_ADDRESS = regex(r",? at \S+$")
_HID_ID = regex(r"^0*([0-9A-Fa-f]{1,4}):0*([0-9A-Fa-f]{1,8}):0*([0-9A-Fa-f]{1,8})$")
_HID_NAME = regex(r"^([0-9A-F]{4}):([0-9A-F]{4}):([0-9A-F]{4})\.[0-9A-F]+$")
_ADDRESS = regex(r"^(?:[0-9a-f]{4,16}\.|soc:|[0-9a-f]{4,16}[:.])(?=[a-z])")
_TRAILER = regex(r"(?:[:.]\d+|\.auto|:[0-9a-fA-F]{2}|@[0-9a-f]+)+$")
_ANONYMOUS_ACPI = regex(r"^device:[0-9a-f]+$")
_SCSI_TYPES = {
    "0": "disk",
    "1": "tape",
    "3": "processor",
    "5": "cdrom",
    "7": "optical",
    "8": "changer",
    "13": "enclosure",
}
_USB_PRODUCT = regex(r"^([0-9a-f]{1,4})/([0-9a-f]{1,4})/")
_W1 = regex(r"^([0-9a-f]{2})-([0-9a-f]{12})$")


def is_member(subsystem: str, name: str, path: str) -> bool:
    """Whether a bus device is a part of the device above it."""
    if subsystem in MEMBER_BUSES:
        return True
    if subsystem == "usb":
        return ":" in name
    if subsystem == "scsi":
        return name.startswith(("host", "target"))
    if subsystem == "i2c":
        return name.startswith("i2c-") and name[4:].isdecimal()
    if subsystem == "serial":
        return "-" not in name
    return subsystem == "mmc_rpmb" or "/usb_device/" in path


def group_of(subsystem: str, name: str) -> str:
    """The name of the one unit that stands for all such devices; empty for a device that is its own unit."""
    if subsystem in SYSTEM_BUSES:
        return subsystem
    return "acpi-namespace" if subsystem == "acpi" and _ANONYMOUS_ACPI.match(name) else ""


def describe(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    """Add what the bus of ``node`` reports of its kind, and the instance facts that are beside it."""
    special = _SPECIAL.get(node.subsystem)
    if special is not None:
        special(node, reader, uevent)
        return
    for attribute in ATTRIBUTES.get(node.subsystem, ()):
        node.add(attribute, _AT_ADDRESS.sub("", reader.text(f"{node.path}/{attribute}")))
    facts = dict(node.lines)
    found = facts.get("name") or facts.get("description") or facts.get("id")
    node.kind = _TRAILER.sub("", found or "") or _announced_kind(node.modalias) or node.driver
    if not node.kind and node.subsystem not in _NAMED_BY_PLACE:
        node.kind = _platform_kind(node, uevent)


def _usb(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    if ":" in node.name:
        _usb_interface(node, reader, uevent)
        return
    packed = _USB_PRODUCT.match(uevent.get("PRODUCT", ""))
    node.vid = _four(reader.text(f"{node.path}/idVendor") or (packed[1] if packed else ""))
    node.pid = _four(reader.text(f"{node.path}/idProduct") or (packed[2] if packed else ""))
    node.kind = f"{node.vid}-{node.pid}" if node.vid and node.pid else "device"
    node.add("vendor_id", node.vid)
    node.add("product_id", node.pid)
    maker, kernel = _KERNEL_VERSION.subn("Linux ", reader.text(f"{node.path}/manufacturer"))
    node.add("manufacturer", maker)
    node.add("product", reader.text(f"{node.path}/product"))
    # A root hub is made by the running kernel and carries its version, which is no fact about hardware.
    node.add("revision", "" if kernel else reader.text(f"{node.path}/bcdDevice"))
    triple = [reader.text(f"{node.path}/bDevice{part}") for part in ("Class", "SubClass", "Protocol")]
    node.add("device_class", "/".join(triple) if all(triple) else _triple(uevent.get("TYPE", "")))
    node.serial = reader.text(f"{node.path}/serial")
    node.attached = reader.text(f"{node.path}/removable")


def _usb_interface(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    triple = [reader.text(f"{node.path}/bInterface{part}") for part in ("Class", "SubClass", "Protocol")]
    shown = "/".join(triple) if all(triple) else _triple(uevent.get("INTERFACE", ""))
    number = reader.text(f"{node.path}/bInterfaceNumber") or node.name.rpartition(".")[2].zfill(2)
    label = reader.text(f"{node.path}/interface")
    parts = [f"class {shown}" if shown else "", f"driver={node.driver}" if node.driver else ""]
    parts.append(f"label={label}" if label else "")
    node.add(f"interface {number}", " ".join(part for part in parts if part))


def _triple(decimal: str) -> str:
    parts = decimal.split("/")
    return "/".join(f"{int(part):02x}" for part in parts) if len(parts) == 3 and all(map(str.isdecimal, parts)) else ""


def _four(text: str) -> str:
    text = text.lower().removeprefix("0x")
    return text.zfill(4)[-4:] if text and all(char in "0123456789abcdef" for char in text) else ""


def _pci(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    vendor, _, device = uevent.get("PCI_ID", "").partition(":")
    node.vid = _four(vendor or reader.text(f"{node.path}/vendor"))
    node.pid = _four(device or reader.text(f"{node.path}/device"))
    node.kind = f"{node.vid}-{node.pid}" if node.vid and node.pid else "device"
    node.add("vendor_id", node.vid)
    node.add("device_id", node.pid)
    code = reader.text(f"{node.path}/class") or uevent.get("PCI_CLASS", "")
    node.add("class_code", f"0x{code.lower().removeprefix('0x').zfill(6)}" if code else "")
    below, _, system = uevent.get("PCI_SUBSYS_ID", "").partition(":")
    node.add("subsystem_vendor", _four(below or reader.text(f"{node.path}/subsystem_vendor")))
    node.add("subsystem_device", _four(system or reader.text(f"{node.path}/subsystem_device")))
    node.add("revision", reader.text(f"{node.path}/revision"))


def _hid(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    packed = _HID_ID.match(uevent.get("HID_ID", "")) or _HID_NAME.match(node.name)
    if packed:
        node.vid, node.pid = _four(packed[2]), _four(packed[3])
        node.add("id", f"{packed[1].zfill(4)}:{node.vid}:{node.pid}".lower())
    node.kind = f"{node.vid}-{node.pid}" if packed else "device"
    node.add("name", uevent.get("HID_NAME", ""))
    descriptor = reader.data(f"{node.path}/report_descriptor")
    node.add("usages", ",".join(capabilities.hid_usages(descriptor)) if descriptor else "")
    node.serial = uevent.get("HID_UNIQ", "")


def _scsi(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    if node.member:
        return
    facts = {part: reader.text(f"{node.path}/{part}") for part in ("vendor", "model", "type")}
    kind = _SCSI_TYPES.get(facts["type"], "")
    node.add("vendor", facts["vendor"])
    node.add("model", facts["model"])
    node.add("type", kind or facts["type"])
    node.kind = " ".join(text for text in (facts["vendor"], facts["model"]) if text) or kind or "device"


def _mmc(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    facts = {
        part: uevent.get(f"MMC_{part.upper()}", "") or reader.text(f"{node.path}/{part}") for part in ("type", "name")
    }
    node.add("type", facts["type"])
    node.add("name", facts["name"])
    for attribute in ("manfid", "oemid"):
        node.add(attribute, reader.text(f"{node.path}/{attribute}"))
    node.serial = reader.text(f"{node.path}/serial").removeprefix("0x")
    node.kind = " ".join(text for text in facts.values() if text) or "card"


def _sdio(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    packed = uevent.get("SDIO_ID", "")
    if not packed:
        packed = ":".join(reader.text(f"{node.path}/{part}").removeprefix("0x") for part in ("vendor", "device"))
    node.add("id", packed.strip(":").lower())
    node.add("class", uevent.get("SDIO_CLASS", ""))


def _hdaudio(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    names = [reader.text(f"{node.path}/{part}") for part in ("vendor_name", "chip_name")]
    node.add("codec", " ".join(name for name in names if name))
    node.add("modalias", uevent.get("MODALIAS", ""))


def _virtio(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    vendor, device = (_four(reader.text(f"{node.path}/{part}")) for part in ("vendor", "device"))
    node.add("vendor", vendor)
    node.add("device", device)
    node.kind = device or _platform_kind(node, uevent)


def _acpi(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    hardware = reader.text(f"{node.path}/hid") or node.name.partition(":")[0]
    node.add("hid", hardware)
    node.add("description", reader.text(f"{node.path}/description"))
    node.kind = hardware


def _w1(node: Node, _reader: Reader, _uevent: dict[str, str]) -> None:
    packed = _W1.match(node.name)
    if packed:
        node.add("family", packed[1])
        node.serial = packed[2]
    node.kind = f"family {packed[1]}" if packed else node.name


def _platform(node: Node, _reader: Reader, uevent: dict[str, str]) -> None:
    node.kind = _platform_kind(node, uevent)
    node.add("name", node.kind)
    for key in ("OF_NAME", "OF_COMPATIBLE_0", "OF_COMPATIBLE_1"):
        node.add(key.lower(), uevent.get(key, ""))


def _announced_kind(modalias: str) -> str:
    """The part of a modalias that names the kind: ``spi:adc`` is ``adc``, a device tree's its first compatible."""
    prefix, _, rest = modalias.partition(":")
    if prefix == "of":
        return rest.partition("C")[2].partition("C")[0]
    return rest.strip(":") if prefix in _PLAIN_MODALIAS else ""


def _platform_kind(node: Node, uevent: dict[str, str]) -> str:
    """The name without what states where: ``3f804000.i2c`` is ``i2c``, ``PNP0103:00`` is ``PNP0103``."""
    bare = _ADDRESS.sub("", node.name)
    return _TRAILER.sub("", bare) or uevent.get("OF_NAME", "") or slug(uevent.get("DRIVER", "")) or "device"


_SPECIAL: Mapping[str, Callable[[Node, Reader, dict[str, str]], None]] = {
    "acpi": _acpi,
    "amba": _platform,
    "hdaudio": _hdaudio,
    "hid": _hid,
    "mmc": _mmc,
    "pci": _pci,
    "platform": _platform,
    "scsi": _scsi,
    "sdio": _sdio,
    "usb": _usb,
    "virtio": _virtio,
    "w1": _w1,
}
