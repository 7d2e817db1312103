"""Builds the tree of an invented host (sys, proc, dev, run) from its text in this folder.

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
    dev ttyS0 null             device nodes that nothing else makes (empty files: PROBE must not open them)

Run as a program it plants one host: ``python tests/hosts/plant.py laptop FOLDER``.
"""

import os
import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
NAMES = tuple(sorted(path.stem for path in HERE.glob("*.host")))
_ESCAPE = re.compile(rb"\\x([0-9a-fA-F]{2})|\\n|\{(\d+)\*(.)\}")


class _Planter:
    def __init__(self, root: Path) -> None:
        self.root = root
        self.device = Path()
        self.file = Path()
        self.uevent: dict[Path, list[bytes]] = {}

    def line(self, line: str) -> None:
        if not line.strip() or line.lstrip().startswith("#"):
            return
        if line.startswith(" "):
            self.detail(line.strip())
            return
        kind, *words = line.split(" ", 1)[:1] + line.split(" ", 1)[1].split()
        {"file": self.start_file, "udev": self.start_udev, "dev": self.nodes}.get(kind, self.devices)(kind, words)

    def devices(self, kind: str, words: list[str]) -> None:
        how, _, subsystem = kind.partition(":")
        path, options = expand(words[0]).decode(), dict(word.split("=", 1) for word in words[1:])
        span = re.search(r"\{(\d+)\.\.(\d+)\}", path)
        numbers = range(int(span[1]), int(span[2]) + 1) if span else [0]
        for number in numbers:
            self.one(how, subsystem, path.replace(span[0], str(number)) if span else path, options)

    def one(self, how: str, subsystem: str, path: str, options: dict[str, str]) -> None:
        self.device = self.root / "sys" / path.lstrip("/")
        self.file = Path()
        self.device.mkdir(parents=True, exist_ok=True)
        folder = self.root / "sys" / ("bus" if how == "bus" else "class") / subsystem
        links = folder / "devices" if how == "bus" else folder
        link(links / self.device.name, self.device)
        link(self.device / "subsystem", folder)
        self.uevent.setdefault(self.device, [])
        if driver := options.get("driver"):
            self.uevent[self.device].append(f"DRIVER={driver}".encode())
            place = self.root / "sys/bus" / subsystem / "drivers" / driver
            place.mkdir(parents=True, exist_ok=True)
            link(self.device / "driver", place)
        if modalias := options.get("modalias"):
            self.uevent[self.device].append(f"MODALIAS={modalias}".encode())
            (self.device / "modalias").write_text(modalias + "\n")
        if node := options.get("node"):
            name, major, minor = node.rsplit(":", 2)
            self.uevent[self.device] += [f"MAJOR={major}\nMINOR={minor}\nDEVNAME={name}".encode()]
            (self.device / "dev").write_text(f"{major}:{minor}\n")
            self.nodes("dev", [name])
        if subsystem == "block" and how == "class" and "partition" not in options:
            link(self.root / "sys/block" / self.device.name, self.device)

    def start_file(self, _kind: str, words: list[str]) -> None:
        self.file = self.root / words[0].lstrip("/")
        self.file.parent.mkdir(parents=True, exist_ok=True)
        self.file.write_bytes(b"")

    def start_udev(self, _kind: str, words: list[str]) -> None:
        self.start_file("file", ["/run/udev/data/" + words[0]])

    def nodes(self, _kind: str, words: list[str]) -> None:
        for word in words:
            path = self.root / "dev" / word
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(b"")

    def detail(self, line: str) -> None:
        if self.file != Path():
            udev = "run/udev/data" in str(self.file)
            text = b"E:" + expand(line) if udev else expand(line.removeprefix("|").removeprefix(" "))
            self.file.write_bytes(self.file.read_bytes() + text + b"\n")
            return
        name, _, value = line.partition("=")
        path = self.device / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if name == "uevent+":
            self.uevent[self.device].append(expand(value))
        elif value == "!EIO":
            path.mkdir()
        else:
            path.write_bytes(expand(value) + b"\n")

    def finish(self) -> None:
        for device, lines in self.uevent.items():
            (device / "uevent").write_bytes(b"".join(line + b"\n" for line in lines))


def expand(text: str) -> bytes:
    r"""Bytes of a value: ``\n``, ``\xNN`` and ``{1000*A}`` are expanded."""

    def one(found: re.Match[bytes]) -> bytes:
        if found[1]:
            return bytes([int(found[1], 16)])
        return found[3] * int(found[2]) if found[2] else b"\n"

    return _ESCAPE.sub(one, text.encode())


def link(place: Path, target: Path) -> None:
    """A relative symbolic link, as sysfs has them."""
    place.parent.mkdir(parents=True, exist_ok=True)
    if not place.is_symlink():
        place.symlink_to(os.path.relpath(target, place.parent))


def plant(name: str, root: Path, replace: dict[str, str] | None = None) -> Path:
    """Build the host's tree in ``root``; ``replace`` changes its text first (another port, another serial number)."""
    text = (HERE / f"{name}.host").read_text()
    for old, new in (replace or {}).items():
        assert old in text, old
        text = text.replace(old, new)
    for folder in ("sys/bus", "sys/class", "sys/devices", "proc", "dev"):
        (root / folder).mkdir(parents=True, exist_ok=True)
    planter = _Planter(root)
    for line in text.splitlines():
        planter.line(line)
    planter.finish()
    return root


if __name__ == "__main__":
    print(plant(sys.argv[1], Path(sys.argv[2])))
