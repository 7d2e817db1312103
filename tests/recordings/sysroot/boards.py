"""What people list of a small board: v4l2-ctl --list-devices, sensors, i2cdetect -l, gpioinfo."""

import re

from recordings.sysroot.tree import Tree

_CHIP = re.compile(
    r"^\s*([\w-]+?)-(isa|pci|i2c|acpi|virtual|hid|spi|mdio|scsi|nvme|usb)-(\S+)\n\s*Adapter: (.*)$", re.M
)
_READING = re.compile(r"^\s*([^:\n]+):\s+([+-]?[\d.]+)\s*(°C|C\b|RPM|V\b|mV|W\b|mW|A\b|mA|%RH)", re.M)
# Unit of a reading -> the kind of hwmon channel and how many of the kernel's units it is.
_UNITS = {
    "°C": ("temp", 1000),
    "C": ("temp", 1000),
    "RPM": ("fan", 1),
    "V": ("in", 1000),
    "mV": ("in", 1),
    "W": ("power", 10**6),
    "mW": ("power", 1000),
    "A": ("curr", 1000),
    "mA": ("curr", 1),
    "%RH": ("humidity", 1000),
}


def load_video(tree: Tree, text: str) -> int:
    """`v4l2-ctl --list-devices`: a name and a bus, and below them the nodes; how many nodes."""
    count, name, bus = 0, "", ""
    for line in text.splitlines():
        if head := re.match(r"^(?:v4l2-ctl \| )?(\S.*?) \(([^()]+)\):\s*$", line):
            name, bus = head[1], head[2]
            continue
        found = re.match(r"^(?:v4l2-ctl \| )?\s+/dev/(video\d+|media\d+|v4l-subdev\d+)\s*$", line)
        if not found or not name:
            continue
        count += 1
        node = found[1]
        if node.startswith("video"):
            path = f"/devices/recorded/{re.sub('[^A-Za-z0-9:._-]', '_', bus)}/video4linux/{node}"
            tree.attribute(f"sys{path}/name", name, derived=True)
            tree.register(path, "video4linux")
        tree.node(node, "char")
    # What each node can do, where v4l2-ctl was asked for it.
    for name, pattern in (("driver", r"Driver name\s+: (.*)"), ("device_caps", r"Device Caps\s+: (0x[0-9a-f]+)")):
        for node, value in re.findall(rf"^/dev/(video\d+) \| \t{pattern}$", text, re.M):
            tree.attribute(f"run/recorded/v4l2/{node}/{name}", value.strip(), derived=True)
    return count


def load_sensors(tree: Tree, text: str) -> int:
    """`sensors`: hwmon chips with their readings and labels; how many chips."""
    count = 0
    for chunk in re.split(r"\n\s*\n", text):
        chip = _CHIP.search(chunk) if _CHIP.match(chunk) else None
        if chip:
            _put_chip(tree, f"/devices/recorded/hwmon/hwmon{count}", chip[1], chunk)
            count += 1
    return count


def _put_chip(tree: Tree, path: str, name: str, chunk: str) -> None:
    tree.attribute(f"sys{path}/name", name, derived=True)
    # The kernel counts voltages from 0 and everything else from 1.
    last = {"temp": 0, "fan": 0, "in": -1, "power": 0, "curr": 0, "humidity": 0}
    for label, value, unit in _READING.findall(chunk):
        kind, scale = _UNITS[unit]
        last[kind] += 1
        channel = f"sys{path}/{kind}{last[kind]}"
        tree.attribute(f"{channel}_input", str(int(float(value) * scale)), derived=True)
        tree.attribute(f"{channel}_label", label.strip(), derived=True)
    tree.register(path, "hwmon")


def load_i2c_adapters(tree: Tree, text: str) -> int:
    """`i2cdetect -l`: the adapters; how many."""
    found = re.findall(r"^i2c-(\d+)\s+\S+\s+(.*?)\s{2,}.*$", text, re.M)
    for number, name in found:
        path = f"/devices/recorded/i2c-{number}"
        tree.attribute(f"sys{path}/name", name.strip(), derived=True)
        tree.register(path, "i2c", bus=True)
        tree.link(f"sys/class/i2c-adapter/i2c-{number}", "sys" + path)
        tree.node(f"i2c-{number}", "char")
    return len(found)


def load_gpio(tree: Tree, text: str) -> int:
    """`gpioinfo`: the chips (the text itself is kept, no sysfs file holds the names of the lines); how many."""
    found = re.findall(r"^(gpiochip\d+)(?: \[[^\]]*\])?(?: \([^)]*\))? - (\d+) lines:", text, re.M)
    for chip, lines in found:
        path = f"/devices/recorded/{chip}"
        tree.folder("sys" + path)
        tree.register(path, "gpio", bus=True)
        tree.node(chip, "char")
        tree.attribute(f"run/recorded/gpio/{chip}/ngpio", lines, derived=True)
    tree.write("run/recorded/gpioinfo.txt", text)
    return len(found)
