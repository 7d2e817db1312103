"""Disks, cards, optical drives and their controllers: an inventory to read, never a block to write."""

from octoform.builtin.description import product_names
from octoform.builtin.description.class_model import (
    FLAG,
    INFRASTRUCTURE,
    NUMBER,
    TEXT,
    WHOLE,
    Capability,
    Claim,
    Evidence,
    Kind,
    listing,
    maybe,
    record,
)
from octoform.builtin.description.device_evidence import Device, Fact

USB_STORAGE = "08"
_CLASSES = ("block", "nvme", "mtd", "scsi_disk", "nvdimm", "scsi_tape")
_PCI_STORAGE = "01"
_OPTICAL_TYPES = ("cdrom", "optical")


def claim(device: Device) -> Claim | None:
    """A drive, a card, or a controller that drives hang on; nothing otherwise."""
    if device.bus == "virtual":
        return None
    held = next((name for name in _CLASSES if name in device.classes), "")
    interface = device.usb(USB_STORAGE)
    if held:
        evidence = device.cite(held, "a block device of the kernel")
    elif interface:
        evidence = Evidence(interface.line, "USB mass storage interface")
    elif device.pci_class.startswith(_PCI_STORAGE):
        evidence = device.cite_key("class_code", "PCI mass storage controller")
        return Claim("storage_controller", INFRASTRUCTURE, "storage controller", (evidence,))
    elif device.bus in ("mmc", "scsi") and device.text("type") in ("SD", "MMC", "disk", *_OPTICAL_TYPES):
        evidence = device.cite_key("type", "a storage medium")
    else:
        return None
    names = (*_own_names(device), *device.names("block", "model"), *device.names("nvme", "model"))
    names = (*names, *device.names("mtd", "name"), *_udev_names(device))
    if _is_optical(device):
        return Claim("optical", INFRASTRUCTURE, "optical drive", (evidence,), names=names)
    capabilities = (_inventory(),) if "block" in device.classes else ()
    return Claim("storage", INFRASTRUCTURE, "storage device", (evidence,), capabilities, names)


def _own_names(device: Device) -> tuple[tuple[str, ...], ...]:
    if device.bus not in ("scsi", "mmc"):
        return ()
    card, name = device.fact("type"), device.fact("name")
    if device.bus == "mmc" and card and name and card.text == "SD":
        return ((f"{name.text} SD card", name.line, card.line),)
    return _joined(device.fact("vendor"), device.fact("model", "name"))


def _udev_names(device: Device) -> tuple[tuple[str, ...], ...]:
    return _joined(device.udev("ID_VENDOR"), device.udev("ID_MODEL")) if "block" in device.classes else ()


def _joined(maker: Fact | None, model: Fact | None) -> tuple[tuple[str, ...], ...]:
    """The name that the two give, with the lines that they are in."""
    if not model:
        return ()
    # SCSI fills the vendor of a SATA drive with the name of the bus.
    if not maker or maker.text == "ATA":
        return ((model.text, model.line),)
    return ((product_names.join(maker.text, model.text), model.line, maker.line),)


def _is_optical(device: Device) -> bool:
    disks = [name for kind, name in device.nodes if kind == "block"]
    is_known = device.text("type") in _OPTICAL_TYPES or bool(device.udev_text("ID_CDROM"))
    return is_known or (bool(disks) and all(name.startswith("sr") for name in disks))


def _inventory() -> Capability:
    return Capability(
        "read_storage",
        "Read size, partitions, free space of mounted file systems and the health that the kernel reports.",
        "Linux block layer (/sys/block, /proc/mounts)",
    )


# Block devices and displays: inventories that the kernel shows as text. No block device is ever opened.

VOLUME = record(
    "Volume", name=TEXT, size_bytes=WHOLE, mounted_at=maybe(TEXT), file_system=maybe(TEXT), free_bytes=maybe(WHOLE)
)
DISK = record(
    "Disk",
    name=TEXT,
    model=maybe(TEXT),
    size_bytes=WHOLE,
    rotational=maybe(FLAG),
    removable=maybe(FLAG),
    read_only=maybe(FLAG),
    state=maybe(TEXT),
    wear=maybe(TEXT),
    io_errors=maybe(WHOLE),
    temperature_degc=maybe(NUMBER),
    volumes=listing(VOLUME),
)
STORAGE = record("Storage", device=TEXT, disks=listing(DISK))
CONNECTOR = record(
    "Connector",
    name=TEXT,
    status=TEXT,
    enabled=maybe(TEXT),
    modes=listing(TEXT),
    manufacturer=maybe(TEXT),
    product=maybe(TEXT),
    width_mm=maybe(WHOLE),
    height_mm=maybe(WHOLE),
)
DISPLAYS = record("Displays", device=TEXT, connectors=listing(CONNECTOR))

KINDS = (
    Kind(
        "read_storage",
        "Read size, partitions, free space and what the kernel reports of health. What is not reported is null.",
        STORAGE,
        60,
    ),
    Kind(
        "read_display",
        "Read which displays are connected, their names, size in mm and modes in pixels.",
        DISPLAYS,
        50,
    ),
)
