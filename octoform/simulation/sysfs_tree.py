"""Builds the tree of an invented host (sys, proc, dev, run) from a string, and takes a part of it away again.

The text, line by line (paths below /sys are written without it; ``#`` starts a comment):

    bus:usb /devices/pci0000:00/0000:00:14.0/usb1/1-5 driver=uvcvideo     a device on a bus, with its links
    class:video4linux /devices/.../video4linux/video0 node=video0:81:0    a class device, with its device node
    group:block /devices/virtual/block/loop{0..7}                         many alike
      idVendor=1d9c            an attribute of the last device (\\n, \\xNN and {10000*A} are expanded)
      uevent+=DRIVER=x         a line of its uevent file
      name=!EIO                an attribute that cannot be read: a folder of that name
    file /proc/asound/cards    a file; its lines follow, each after a bar
      | 0 [PCH ]: ...
    udev +usb:1-5              a record of the udev database; its properties follow
      ID_MODEL_FROM_DATABASE=Some Camera
    dev ttyS0 null             device nodes that nothing else makes (empty files: nothing may open them)
"""

import os
import re
import shutil
from functools import lru_cache
from pathlib import Path

from octoform.patterns import regex

_ESCAPE = regex(rb"\\x([0-9a-fA-F]{2})|\\n|\{(\d+)\*(.)\}")


class Planter:
    """Plants line by line; ``made`` is what is there because of it, but for folders that many share."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.made: list[Path] = []
        self._device = self._file = Path()
        self._uevent: dict[Path, list[bytes]] = {}

    def plant(self, text: str) -> None:
        """A whole text."""
        for folder in ("sys/bus", "sys/class", "sys/devices", "proc", "dev"):
            (self.root / folder).mkdir(parents=True, exist_ok=True)
        for line in text.splitlines():
            self._line(line)
        for device, lines in self._uevent.items():
            (device / "uevent").write_bytes(b"".join(line + b"\n" for line in lines))

    def uproot(self) -> None:
        """Take away all that was made."""
        for path in reversed(self.made):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)
        self.made.clear()

    def _line(self, line: str) -> None:
        if not line.strip() or line.lstrip().startswith("#"):
            return
        if line.startswith(" "):
            self._detail(line.strip())
            return
        kind, *words = line.split(" ", 1)[:1] + line.split(" ", 1)[1].split()
        {"file": self._start_file, "udev": self._start_udev, "dev": self._nodes}.get(kind, self._devices)(kind, words)

    def _devices(self, kind: str, words: list[str]) -> None:
        how, _, subsystem = kind.partition(":")
        path, options = expand(words[0]).decode(), dict(word.split("=", 1) for word in words[1:])
        span = re.search(r"\{(\d+)\.\.(\d+)\}", path)
        numbers = range(int(span[1]), int(span[2]) + 1) if span else [0]
        for number in numbers:
            self._one(how, subsystem, path.replace(span[0], str(number)) if span else path, options)

    def _one(self, how: str, subsystem: str, path: str, options: dict[str, str]) -> None:
        self._device = self.root / "sys" / path.lstrip("/")
        self._file = Path()
        if not self._device.exists():
            self._device.mkdir(parents=True)
            self.made.append(self._device)
        folder = self.root / "sys" / ("bus" if how == "bus" else "class") / subsystem
        links = folder / "devices" if how == "bus" else folder
        self._link(links / self._device.name, self._device)
        self._link(self._device / "subsystem", folder)
        lines = self._uevent.setdefault(self._device, [])
        if driver := options.get("driver"):
            lines.append(f"DRIVER={driver}".encode())
            place = self.root / "sys/bus" / subsystem / "drivers" / driver
            place.mkdir(parents=True, exist_ok=True)
            self._link(self._device / "driver", place)
        if modalias := options.get("modalias"):
            lines.append(f"MODALIAS={modalias}".encode())
            (self._device / "modalias").write_text(modalias + "\n")
        if node := options.get("node"):
            name, major, minor = node.rsplit(":", 2)
            lines += [f"MAJOR={major}\nMINOR={minor}\nDEVNAME={name}".encode()]
            (self._device / "dev").write_text(f"{major}:{minor}\n")
            self._nodes("dev", [name])
        if subsystem == "block" and how == "class" and "partition" not in options:
            self._link(self.root / "sys/block" / self._device.name, self._device)

    def _start_file(self, _kind: str, words: list[str]) -> None:
        self._file = self.root / words[0].lstrip("/")
        self._file.parent.mkdir(parents=True, exist_ok=True)
        self._file.write_bytes(b"")
        self.made.append(self._file)

    def _start_udev(self, _kind: str, words: list[str]) -> None:
        self._start_file("file", ["/run/udev/data/" + words[0]])

    def _nodes(self, _kind: str, words: list[str]) -> None:
        for word in words:
            path = self.root / "dev" / word
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(b"")
            self.made.append(path)

    def _detail(self, line: str) -> None:
        if self._file != Path():
            udev = "run/udev/data" in str(self._file)
            text = b"E:" + expand(line) if udev else expand(line.removeprefix("|").removeprefix(" "))
            self._file.write_bytes(self._file.read_bytes() + text + b"\n")
            return
        name, _, value = line.partition("=")
        path = self._device / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if name == "uevent+":
            self._uevent[self._device].append(expand(value))
        elif value == "!EIO":
            path.mkdir()
        else:
            path.write_bytes(expand(value) + b"\n")

    def _link(self, place: Path, target: Path) -> None:
        """A relative symbolic link, as sysfs has them."""
        place.parent.mkdir(parents=True, exist_ok=True)
        if not place.is_symlink():
            place.symlink_to(os.path.relpath(target, place.parent))
            self.made.append(place)


@lru_cache(maxsize=256)  # hosts say the same in many places
def expand(text: str) -> bytes:
    r"""Bytes of a value: ``\n``, ``\xNN`` and ``{1000*A}`` are expanded."""

    def one(found: re.Match[bytes]) -> bytes:
        if found[1]:
            return bytes([int(found[1], 16)])
        return found[3] * int(found[2]) if found[2] else b"\n"

    return _ESCAPE.sub(one, text.encode())
