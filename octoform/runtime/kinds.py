"""Tells what kind of device a sysfs folder is, in the words of device ids, and which specimen it is.

An id such as ``usb-046d-0825-2`` names a bus, a kind and an ordinal. A folder may be called in several ways (by its
ids, its name attribute, its driver), so it has a set of kinds and matches an id when one of them does.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from .sysfs import files, members, read_text, subsystem, uevent

# Devices on these buses are parts of the device above them, as interfaces and channels are.
_PARTS = frozenset(
    (
        *("auxiliary", "cec", "counter", "gpio", "hdaudio", "iio", "media", "nvmem", "pci_express", "rmi4", "sdio"),
        *("serial-base", "siox", "snd_seq", "spi_master", "ulpi", "usb-serial", "usb_device"),
    )
)
_NAMES = ("name", "type", "model", "id", "description", "hid", "label", "identity")
_KIND_NAMES = ("product", "manufacturer", "model", "name")
_ANNOUNCED = ("OF_NAME", "NAME", "HID_NAME", "POWER_SUPPLY_MODEL_NAME", "POWER_SUPPLY_TYPE", "DEVTYPE")
_ADDRESS = re.compile(r"^(?:[0-9a-f]{4,16}\.|soc:|[0-9a-f]{4,16}[:.])(?=[a-z])")
# A number behind a colon or a dot counts specimens; digits that end a name itself (AMDI0010, i2c2) are the kind's.
_TRAILER = re.compile(r"(?:[:.]\d+|\.auto|:[0-9a-fA-F]{2}|@[0-9a-f]+)+$")
_NUMBERED = re.compile(r"[0-9:.].*$")
_AT_ADDRESS = re.compile(r",? at \S+$")
_LED_OWNER = re.compile(r"(?<![a-z])(input|phy|mmc|usb|hid|card)\d+(?=\W|$)")
_LED_HID = re.compile(r"^[0-9A-F]{4}:[0-9A-F]{4}:[0-9A-F]{4}\.[0-9A-F]+:")
_HID_ID = re.compile(r"0*[0-9A-Fa-f]{1,4}:0*([0-9A-Fa-f]{1,8}):0*([0-9A-Fa-f]{1,8})")
_HID_NAME = re.compile(r"[0-9A-F]{4}:([0-9A-F]{4}):([0-9A-F]{4})\.[0-9A-F]+")
_HEX = re.compile(r"[0-9a-f]+")
_FAMILY = re.compile(r"([0-9a-f]{2})-[0-9a-f]{12}")
_SLUG_CHARS = 72
# Ids say what a thermal device is for; the kernel lists zones and cooling devices in one class.
_LISTED = {"cooling": "thermal"}
_PLAIN_MODALIAS = frozenset(("spi", "i2c", "platform", "acpi", "wmi", "rpmsg", "tee", "scmi", "mdio"))
_OWN_WORDS = {"usb": "device", "pci": "device", "hid": "device", "scsi": "device", "mmc": "card", "dmi": "board"}
_OWN_WORDS |= {"gpio": "gpiochip"}
_ORDINAL = re.compile(r"^(.*)-([2-9]|[1-9]\d+)$")


def slug(text: str) -> str:
    """Lower-case words joined by dashes, at most 72 characters, as in device ids."""
    return re.sub(r"[^a-z0-9]+", "-", text[: 4 * _SLUG_CHARS].lower()).strip("-")[:_SLUG_CHARS].strip("-")


def is_unit(path: Path) -> bool:
    """Whether a folder is a device on a bus that stands for itself, rather than a part of the one above it."""
    kind, name = subsystem(path)
    if kind != "bus" or name in _PARTS:
        return False
    if name == "usb":
        return ":" not in path.name
    if name == "scsi":
        return not path.name.startswith(("host", "target"))
    return not (name == "i2c" and re.fullmatch(r"i2c-\d+", path.name))


def vid_pid(path: Path) -> str:
    """``vvvv-pppp`` of a USB, PCI or HID device, empty for others."""
    _, name = subsystem(path)
    pair: Sequence[str] = ()
    if name == "usb":
        vendor, product = _two(uevent(path).get("PRODUCT", ""), "/")
        pair = (read_text(path / "idVendor") or vendor, read_text(path / "idProduct") or product)
    elif name == "pci":
        vendor, product = _two(uevent(path).get("PCI_ID", ""), ":")
        pair = (vendor or read_text(path / "vendor") or "", product or read_text(path / "device") or "")
    elif name == "hid":
        found = _HID_ID.fullmatch(uevent(path).get("HID_ID", "")) or _HID_NAME.fullmatch(path.name)
        pair = found.groups() if found else ()
    digits = [part.lower().removeprefix("0x").zfill(4)[-4:] for part in pair if part]
    return "-".join(digits) if len(digits) == 2 and all(map(_HEX.fullmatch, digits)) else ""


def _two(packed: str, sign: str) -> tuple[str, str]:
    first, _, rest = packed.partition(sign)
    return first, rest.partition(sign)[0]


def kinds(path: Path) -> set[str]:
    """Every word by which an id may call the device of this folder."""
    ids = vid_pid(path)
    return {ids} if ids else {slug(text) for text in _said(path)} - {""}


def _said(path: Path) -> Iterator[str]:
    """What the folder, its attributes and the kernel's announcement call the device, whole and without its place."""
    events = uevent(path)
    attributes = [_AT_ADDRESS.sub("", read_text(path / name) or "") for name in _NAMES]
    alias = _of_modalias(events.get("MODALIAS") or read_text(path / "modalias") or "")
    driver = events.get("DRIVER") or _driver(path)
    announced = (events.get(key, "").strip('"') for key in _ANNOUNCED)
    if not (alias or driver):
        yield "device"
    for text in (*attributes, *announced, alias, driver, path.name, _ADDRESS.sub("", path.name)):
        yield text
        yield _TRAILER.sub("", text)
    # A clock's driver, before the place where the clock is attached.
    yield attributes[0].partition(" ")[0]
    yield f"{read_text(path / 'vendor') or ''} {read_text(path / 'model') or ''}"
    yield " ".join(events.get(f"MMC_{key}") or read_text(path / key.lower()) or "" for key in ("TYPE", "NAME"))
    yield from _of_folder_name(path)
    yield from _of_bus(path)


def _of_folder_name(path: Path) -> Iterator[str]:
    """What the name of a folder says of a kind: a class device's before its number, an ACPI id, a 1-Wire family."""
    form, name = subsystem(path)
    if form == "class":
        yield _NUMBERED.sub("", path.name) or "device"
        yield _LED_OWNER.sub(r"\1", _LED_HID.sub("", path.name))
    elif name == "acpi":
        yield path.name.partition(":")[0]
    elif family := _FAMILY.fullmatch(path.name):
        yield f"family {family[1]}"


def _of_bus(path: Path) -> Iterator[str]:
    """The words that stand for a kind where a bus or class has a word of its own for it."""
    _, name = subsystem(path)
    if name in _OWN_WORDS:
        yield _OWN_WORDS[name]
    if name == "virtio":
        yield (read_text(path / "device") or "").lower().removeprefix("0x").zfill(4)[-4:]


def _of_modalias(alias: str) -> str:
    """The part of a modalias that names the kind: ``spi:adc`` is ``adc``, a device tree's its first compatible."""
    prefix, _, rest = alias.partition(":")
    if prefix == "of":
        return rest.partition("C")[2].partition("C")[0]
    return rest.strip(":") if prefix in _PLAIN_MODALIAS else ""


def _driver(path: Path) -> str:
    try:
        return (path / "driver").readlink().name
    except OSError:
        return ""


def contradicts(path: Path, device_id: str) -> bool:
    """Whether the folder is certainly another kind than the id says: a number was given to something else."""
    ids = vid_pid(path)
    if ids:
        return f"-{ids}" not in device_id
    kind, name = subsystem(path)
    said = slug(read_text(path / ("type" if name == "thermal" else "name")) or "")
    return kind == "class" and bool(said) and said not in device_id and slug(path.name) not in device_id


def kind_of(device_id: str) -> tuple[str, list[Path]]:
    """The kind that an id names, without an ordinal, and the folders of all its specimens in natural order."""
    if found := _of_kind(device_id):
        return device_id, found
    ordinal = _ORDINAL.match(device_id)
    return (ordinal[1], _of_kind(ordinal[1])) if ordinal else (device_id, [])


def matches(path: Path, device_id: str) -> bool:
    """Whether the folder is of the kind that an id names."""
    ordinal = _ORDINAL.match(device_id)
    words = kinds(path)
    listed = subsystem(path)[1]
    for name in (device_id, *([ordinal[1]] if ordinal else [])):
        rests = (rest for head, rest in _splits(name) if listed in head)
        if any({name, rest} & words for rest in rests):
            return True
    return False


def _of_kind(name: str) -> list[Path]:
    for heads, rest in _splits(name):
        found = [path for head in sorted(heads) for path in members(head) if {name, rest} & kinds(path)]
        if found:
            return found
    return []


def _splits(name: str) -> Iterator[tuple[set[str], str]]:
    """Every way to read a name as a bus or class and the rest; these are written with underscores and dashes alike."""
    parts = name.split("-")
    for count in range(1, len(parts) + 1):
        head = "-".join(parts[:count])
        yield {_LISTED.get(head, head), head.replace("-", "_")}, "-".join(parts[count:])


def serial(path: Path) -> str | None:
    """What a device gives as its serial number, empty where it gives none.

    None where the kernel shows none in a place known here, or not yet.
    """
    _, name = subsystem(path)
    if name in ("usb", "mmc"):
        shown = read_text(path / "serial")
        # A USB device without a number has no such attribute. Every card has one: without it nothing is known of it.
        return None if shown is None and name == "mmc" else (shown or "").removeprefix("0x")
    if name == "pci":
        return next((read_text(each) for each in files(path / "nvme", "nvme*/serial")), None)
    # A driver may fill it in when the device speaks for the first time.
    return uevent(path).get("HID_UNIQ") or None if name == "hid" else None


def said(path: Path) -> list[str]:
    """What a device says of its kind: no number of a specimen is equal to one of these."""
    ids = vid_pid(path)
    return [text for text in (ids, *(read_text(path / name) or "" for name in _KIND_NAMES)) if text]
