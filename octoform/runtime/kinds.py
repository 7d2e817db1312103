"""Tells what kind of device a sysfs folder is, in the words of device ids, and which specimen it is.

An id such as ``usb-046d-0825-2`` names a bus, a kind and an ordinal. A folder may be called in several ways (by its
ids, its name attribute, its driver), so it has a set of kinds and matches an id when one of them does.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from .sysfs import files, members, read_text, subsystem, uevent

# Devices on these buses are parts of the device above them, as interfaces and channels are.
_PARTS = frozenset(
    (
        *("auxiliary", "cec", "counter", "gpio", "hdaudio", "iio", "media", "nvmem", "pci_express", "rmi4", "sdio"),
        *("serial-base", "siox", "snd_seq", "spi_master", "ulpi", "usb-serial", "usb_device"),
    )
)
_NAMES = ("name", "type", "model", "id", "description", "hid")
_ADDRESS = re.compile(r"^(?:[0-9a-f]{4,16}\.|soc:|[0-9a-f]{4,16}[:.])(?=[a-z])")
_TRAILER = re.compile(r"(?:[:.]\d+|\.auto|:[0-9a-f]{2}|@[0-9a-f]+|-?\d+)+$")
_NOT_SERIAL = re.compile(r"[^0-9a-z]+")
_COUNTING = ("0123456789abcdef", "1234567890abcdef")
_ORDINAL = re.compile(r"^(.*)-([2-9]|[1-9]\d+)$")


def slug(text: str) -> str:
    """Lower-case words joined by dashes, as in device ids."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


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
    pair: tuple[str, ...] = ()
    if name == "usb":
        pair = (read_text(path / "idVendor") or "", read_text(path / "idProduct") or "")
    elif name == "pci":
        pair = (read_text(path / "vendor") or "", read_text(path / "device") or "")
    elif name == "hid":
        pair = tuple(uevent(path).get("HID_ID", "").split(":")[1:3])
    digits = [part.lower().removeprefix("0x").zfill(4)[-4:] for part in pair if part]
    return "-".join(digits) if len(digits) == 2 else ""


def kinds(path: Path) -> set[str]:
    """Every word by which an id may call the device of this folder."""
    ids = vid_pid(path)
    if ids:
        return {ids}
    said = [read_text(path / name) or "" for name in _NAMES]
    events = uevent(path)
    said += [events.get("DRIVER", ""), events.get("OF_NAME", ""), path.name]
    said.append(_TRAILER.sub("", _ADDRESS.sub("", path.name)))
    said.append(f"{read_text(path / 'vendor') or ''} {read_text(path / 'model') or ''}")
    said.append((read_text(path / "device") or "").removeprefix("0x"))
    said.append(f"{events.get('MMC_TYPE', '')} {events.get('MMC_NAME', '')}")
    return {slug(text) for text in said} - {""}


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
        yield {"-".join(parts[:count]), "_".join(parts[:count])}, "-".join(parts[count:])


def serial(path: Path) -> str | None:
    """What a device gives as its serial number, empty where it gives none.

    None where the kernel shows none in a place known here, or not yet.
    """
    _, name = subsystem(path)
    if name in ("usb", "mmc"):
        return (read_text(path / "serial") or "").removeprefix("0x")
    if name == "pci":
        return next((read_text(each) for each in files(path / "nvme", "nvme*/serial")), None)
    # A driver may fill it in when the device speaks for the first time.
    return uevent(path).get("HID_UNIQ") or None if name == "hid" else None


def telling(serial: str) -> str:
    """A serial number that can tell one specimen from another, empty for one that makers put where they have none."""
    bare = _NOT_SERIAL.sub("", serial.lower())
    if len(set(bare)) < 2 or not any(map(str.isdigit, bare)) or bare in _COUNTING[0] or bare in _COUNTING[1]:
        return ""
    return serial.strip()


def same_serial(one: str, other: str | None) -> bool:
    """Whether two serial numbers are one, as tools spell them: some replace blanks, some change the case."""
    return bool(one and other) and _NOT_SERIAL.sub("_", one.lower()) == _NOT_SERIAL.sub("_", (other or "").lower())
