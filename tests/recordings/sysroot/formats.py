"""Which formats a file of a recording holds. One text may hold several: a mail quotes lsusb and the kernel's log."""

import json
import re
from pathlib import Path

_ARCHIVE = re.compile(r"\.(tar(\.\w+)?|tgz)$")
_NOT_READ = re.compile(r"\.(ioctl|script|script\.\d+|pcapng|pcap|png|xz|gz)$")
_NOT_RECORDED = frozenset({"SOURCE.txt", "truth.json", "NOTES.md", "README", "machine.txt"})
_ANYWHERE: tuple[tuple[str, str], ...] = (
    ("udevwalk", r"looking at (?:parent )?device '/"),
    ("lsusb-tree", r"^/:\s+Bus \d+\.Port"),
    ("lsusb-long", r"^\s{0,6}idVendor\s+0x"),
    ("lsusb-short", r"^Bus \d{3} Device \d{3}: ID "),
    ("usb-devices", r"^[>| \t]*P:\s+Vendor=[0-9a-f]{4} ProdID="),
    ("kernel-log", r"New USB device found, idVendor="),
    ("by-id", r"\busb-[^\s'\"]+-if[0-9a-f]{2}"),
    ("input-devices", r"^I: Bus=[0-9a-f]{4} Vendor="),
    ("sound", r"!!Soundcards recognised by ALSA|^ *\d+ \[[^\]]{15,16}\]: \S+"),
    ("video-list", r"^\s+/dev/video\d+\s*$|^v4l2-ctl \| \t/dev/video"),
    ("i2c-list", r"^i2c-\d+\s+\S+\s+.+\s{2,}"),
    ("gpio-info", r"^gpiochip\d+.* - \d+ lines:"),
    ("ups", r"^ups\.(vendorid|mfr|model|status)|^device\.type: ups"),
)
_TOGETHER: tuple[tuple[str, str, str], ...] = (
    ("udev-records", r"^P: /", r"^E: "),
    ("sensors", r"^\s*Adapter: ", r"-(isa|pci|i2c|acpi|virtual|hid|nvme)-"),
)


def is_archive(path: Path) -> bool:
    """True for a tar."""
    return _ARCHIVE.search(path.name) is not None


def is_recording(path: Path) -> bool:
    """False for notes about the entry and for traffic logs, of which no format here makes a file."""
    name = path.name
    if name in _NOT_RECORDED or name.startswith("devtree") or name.endswith(".hid.bin"):
        return False
    return path.is_file() and (is_archive(path) or _NOT_READ.search(name) is None)


def read_text(path: Path) -> str:
    """The text in whatever encoding it is; every byte stands for something in latin-1."""
    data = path.read_bytes()
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", "replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def formats_of(path: Path, text: str) -> set[str]:
    """The names of the formats in a file; empty when it has none that is known."""
    if is_archive(path):
        return {"tar"}
    start = text.lstrip()
    if start.startswith("<?xml") and "<context" in start:
        return {"iio-context"}
    if start.startswith("{"):
        return _formats_of_document(text)
    found = {name for name, pattern in _ANYWHERE if re.search(pattern, text, re.M)}
    found |= {name for name, *both in _TOGETHER if all(re.search(pattern, text, re.M) for pattern in both)}
    if "lsusb-long" in found:
        found.discard("lsusb-short")
    if found & {"udev-records", "lsusb-long"}:
        found.discard("by-id")
    return found


def _formats_of_document(text: str) -> set[str]:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return set()
    if "UsbDevices" in document:
        return {"emulation"}
    return {"inventory"} if "storage" in document or "network" in document else set()
