"""Tells what kind of device a sysfs folder is, in the words of device ids, and which specimen it is.

An id such as ``usb-046d-0825-2`` names a bus, a kind and an ordinal. A folder may be called in several ways (by its
ids, its name attribute, its driver), so it has a set of kinds and matches an id when one of them does.
"""

import re
from pathlib import Path

from .sysfs import members, read_text, subsystem, uevent

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


def specimens(device_id: str) -> list[Path]:
    """Folders of all devices of the kind that an id names, in natural order of their paths."""
    names = [device_id]
    if ordinal := _ORDINAL.match(device_id):
        names.append(ordinal[1])
    for name in names:
        if found := _of_kind(name):
            return found
    return []


def ordinal_of(device_id: str) -> int:
    """1 for a plain id, n for one that ends in ``-n`` and whose kind does not itself end so."""
    ordinal = _ORDINAL.match(device_id)
    return int(ordinal[2]) if ordinal and not _of_kind(device_id) else 1


def _of_kind(name: str) -> list[Path]:
    parts = name.split("-")
    for count in range(1, len(parts) + 1):
        # Names of buses and classes are written with underscores and dashes alike.
        heads = {"-".join(parts[:count]), "_".join(parts[:count])}
        rest = "-".join(parts[count:])
        found = [path for head in sorted(heads) for path in members(head) if {name, rest} & kinds(path)]
        if found:
            return found
    return []


def serial(path: Path) -> str | None:
    """The serial number that tells specimens apart, None where the kernel shows none in a place known here."""
    _, name = subsystem(path)
    if name in ("usb", "mmc"):
        return (read_text(path / "serial") or "").removeprefix("0x") or None
    return uevent(path).get("HID_UNIQ") or None if name == "hid" else None
