"""`convert`: every recording of an entry, read into one tree, the richest first.

A file that turns out not to be what it looks like costs that file alone: the entry keeps what the others have, and the
fault is named.
"""

import tarfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from recordings.sysroot import (
    boards,
    documents,
    files,
    iio,
    inputs,
    kernel_log,
    lsusb,
    sound,
    udevdb,
    udevwalk,
    ups,
    usbdevices,
)
from recordings.sysroot.formats import formats_of, is_archive, is_recording, read_text
from recordings.sysroot.tree import Tree
from recordings.sysroot.usb import Ports

# What a damaged or unforeseen recording raises in a reader; anything else is a bug of ours and may end the run.
DAMAGE = (OSError, ValueError, LookupError, TypeError, AttributeError, EOFError, RecursionError)
DAMAGE_OF_FORMATS = (tarfile.TarError, ET.ParseError)

_Reader = Callable[[Tree, str], int]
# In this order: what is written first stays.
_READERS: Mapping[str, _Reader] = {
    "udev-records": udevdb.load,
    "udevwalk": udevwalk.load,
    "lsusb-long": partial(lsusb.load_long, ports={}),
    "usb-devices": usbdevices.load,
    "lsusb-short": partial(lsusb.load_short, ports={}),
    "kernel-log": kernel_log.load_log,
    "by-id": kernel_log.load_by_id,
    "input-devices": inputs.load,
    "sound": sound.load,
    "video-list": boards.load_video,
    "iio-context": iio.load,
    "inventory": documents.load_inventory,
    "emulation": documents.load_emulation,
    "ups": ups.load,
    "sensors": boards.load_sensors,
    "i2c-list": boards.load_i2c_adapters,
    "gpio-info": boards.load_gpio,
}
# A poorer text about a bus that a richer one describes would only add doubles.
_RICHER = {
    "lsusb-short": {"lsusb-long", "usb-devices", "udev-records", "sysinfo"},
    "kernel-log": {"lsusb-long", "lsusb-short", "usb-devices", "udev-records", "sysinfo"},
}


@dataclass(frozen=True)
class Converted:
    """What became of an entry: things read by format, and the files that could not be read with the reason."""

    loaded: Mapping[str, int]
    faults: tuple[str, ...]


@dataclass(frozen=True)
class _File:
    path: Path
    text: str
    formats: frozenset[str]


class _Conversion:
    """One entry under way."""

    def __init__(self, entry: Path, tree: Tree) -> None:
        self._entry = entry
        self._tree = tree
        self._loaded: dict[str, int] = {}
        self._faults: list[str] = []

    def run(self) -> Converted:
        """Read the entry's files and finish the tree."""
        if any((self._entry / name).exists() for name in ("devtree.txt", "devtree_data.txt")):
            self._try("sysinfo", self._entry, lambda: files.load_sysinfo(self._tree, self._entry))
        found = [self._open(path) for path in sorted(self._entry.iterdir()) if is_recording(path)]
        present = {name for file in found for name in file.formats} | set(self._loaded)
        for file in found:
            if "tar" in file.formats:
                self._try("tar", file.path, partial(files.load_tar, self._tree, file.path))
        readers = _with_ports(_ports(found))
        for name, reader in readers.items():
            for file in found:
                if name in file.formats and not present & _RICHER.get(name, set()):
                    self._try(name, file.path, partial(reader, self._tree, file.text))
        self._tree.finish()
        return Converted(self._loaded, tuple(self._faults))

    def _open(self, path: Path) -> _File:
        try:
            text = "" if is_archive(path) else read_text(path)
        except OSError as problem:
            self._faults.append(f"{path.name}: cannot be read: {problem.strerror}")
            return _File(path, "", frozenset())
        return _File(path, text, frozenset(formats_of(path, text)))

    def _try(self, name: str, path: Path, load: Callable[[], int]) -> None:
        try:
            self._loaded[name] = self._loaded.get(name, 0) + load()
        except (*DAMAGE, *DAMAGE_OF_FORMATS) as problem:
            self._faults.append(f"{path.name}: no readable {name}: {type(problem).__name__}: {problem}")


def convert(entry: Path, root: Path) -> Converted:
    """Make the folder ``root`` of the recordings in the folder ``entry``."""
    return _Conversion(entry, Tree(root)).run()


def _ports(found: list[_File]) -> Ports:
    """The ports by bus and device number, for texts that have only those; `lsusb -t` knows better than a log."""
    ports: dict[tuple[int, int], tuple[str, Mapping[int, str], str | None]] = {}
    for name, read in (("kernel-log", kernel_log.read_ports), ("lsusb-tree", lsusb.read_tree)):
        for file in found:
            if name in file.formats:
                ports.update(read(file.text))
    return ports


def _with_ports(ports: Ports) -> dict[str, _Reader]:
    return {
        **_READERS,
        "lsusb-long": partial(lsusb.load_long, ports=ports),
        "lsusb-short": partial(lsusb.load_short, ports=ports),
    }
