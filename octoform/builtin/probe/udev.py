"""The udev database (``/run/udev/data``): what the system's own rules and id tables already know about a device.

Only properties that describe a kind are taken, and the short serial number, which the caller keeps with the instance.
Paths, file systems, partition ids and the state of a medium are left where they are.
"""

from octoform.builtin.probe.reader import Reader
from octoform.patterns import regex

SERIAL = "ID_SERIAL_SHORT"
# Copies of strings that the device's own attributes give better.
STRING_PROPERTIES = frozenset(("ID_VENDOR", "ID_MODEL"))
# Vendor, model and serial number in one word; used where the parts themselves are missing.
JOINED, JOINED_NAME = "ID_SERIAL", "ID_SERIAL.name"
# Of a class device only what the class itself adds; the rest repeats the device below it.
OF_CLASS = {"input": ("ID_INPUT",), "video4linux": ("ID_V4L", "COLORD", "ID_INFRARED"), "drm": ("ID_DRM",)}
FOLDER = "/run/udev/data"
RECORD_BYTES = 16384
_SERIAL_CHARS = 8

_KIND = regex(
    r"^(?:ID_(?:VENDOR|MODEL|PCI_CLASS|PCI_SUBCLASS|PCI_INTERFACE|USB_CLASS|OUI)_FROM_DATABASE"
    r"|ID_SERIAL|ID_SERIAL_SHORT|ID_(?:VENDOR|MODEL|TYPE|BUS|USB_INTERFACES|INTEGRATION)"
    r"|ID_INPUT(?:_\w+)?|ID_V4L_(?:CAPABILITIES|PRODUCT|VERSION)|ID_ATA|ID_ATA_ROTATION_RATE_RPM"
    r"|ID_CDROM(?:_(?!MEDIA)\w+)?|ID_DRIVE_\w+|ID_MM_\w+|ID_GPHOTO2|ID_MEDIA_PLAYER|ID_SMARTCARD_READER"
    r"|ID_SIGNAL_ANALYZER|ID_HARDWARE_WALLET|ID_SECURITY_TOKEN|ID_MAKER_TOOL|ID_INFRARED_CAMERA|ID_PDA"
    r"|ID_SOFTWARE_RADIO|ID_AV_\w+|ID_SENSOR\w*|LIBFPRINT_DRIVER|COLOR_MEASUREMENT_DEVICE|COLORD_KIND|AMBA_ID)$"
)
_RECORDED = ("E:ID_", "E:COLOR", "E:AMBA", "E:LIBFPRINT")
_REDUNDANT = {"ID_INPUT", "ID_V4L_VERSION"}


class UdevDatabase:
    """The records by udev's own name for a device (``c81:0``, ``b8:0``, ``n3``, ``+usb:1-1``)."""

    def __init__(self) -> None:
        """Empty until a scan has listed the folder."""
        self.names: frozenset[str] = frozenset()

    def scan(self, reader: Reader) -> None:
        """List the records; each is read when its device is."""
        self.names = frozenset(reader.names(FOLDER))

    def properties(self, reader: Reader, *keys: str) -> dict[str, str]:
        """The kind properties of the first record that is there under one of ``keys``."""
        for key in keys:
            if key and key in self.names:
                return _properties(reader.text(f"{FOLDER}/{key}", RECORD_BYTES))
        return {}


def _properties(record: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for line in record.splitlines():
        if line.startswith(_RECORDED):
            key, _, text = line[2:].partition("=")
            if text and key not in _REDUNDANT and _KIND.match(key):
                found[key] = text
    if found.get("ID_MODEL"):
        found.pop(JOINED, None)
    return found


def split_joined(properties: dict[str, str]) -> None:
    """Replace vendor_model_serial by its name part and the serial number, as far as the two can be distinguished."""
    joined = properties.pop(JOINED, "")
    head, _, tail = joined.rpartition("_")
    serial = properties.get(SERIAL, "")
    looks_unique = len(tail) >= _SERIAL_CHARS and any(char.isdigit() for char in tail) and tail.isalnum()
    if serial and joined.endswith(serial):
        joined = joined.removesuffix(serial).rstrip("_")
    elif looks_unique:
        joined, properties[SERIAL] = head.rstrip("_"), tail
    if joined:
        properties[JOINED_NAME] = joined


def key_of(subsystem: str, name: str, uevent: dict[str, str]) -> tuple[str, str]:
    """The names under which udev may keep the record of a device: by number, and by subsystem and name."""
    named = f"+{subsystem}:{name}"
    if "MAJOR" in uevent:
        kind = "b" if subsystem == "block" else "c"
        return f"{kind}{uevent['MAJOR']}:{uevent.get('MINOR', '0')}", named
    if "IFINDEX" in uevent:
        return f"n{uevent['IFINDEX']}", named
    return named, ""
