"""The host that the scripted agent's good output is about: a thermometer of the board and a serial adapter on USB."""

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path
from typing import Any

from sysfs_tree import Tree

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe import probe_root
from octoform.builtin.serve.stage import render
from octoform.contracts.model import Artifacts

ADAPTER = "pci0000:00/0000:00:14.0/usb1/1-1"
SENSOR = "platform/benchtemp.0/hwmon/hwmon0"
HUB = "pci0000:00/0000:00:14.0/usb1"
SERIAL = "CAM-20071"
"""The serial number that the camera of `lab` prints into its product string."""


def bench_host(root: Path) -> Path:
    """Build it below ``root``, once; ``root``."""
    if root.is_dir():
        return root
    tree = Tree(root)
    tree.member(SENSOR, "hwmon", {"name": "benchtemp", "temp1_label": "board", "temp1_input": "21500"})
    tree.usb(ADAPTER, "0a0a", "0001")
    (root / "sys/devices" / ADAPTER / "product").write_text("USB Serial\n")
    tree.bus(f"{ADAPTER}/1-1:1.0", "usb", {"bInterfaceNumber": "00"}, DRIVER="ch341")
    (root / "etc").mkdir()
    (root / "etc/os-release").write_text('ID=debian\nVERSION_ID="12"\n')
    return root


def watched(root: Path) -> Path:
    """The bench and a camera that prints its serial number."""
    tree = Tree(bench_host(root))
    camera = tree.usb(f"{HUB}/1-2", "1f00", "00c1", SERIAL)
    (camera / "product").write_text(f"Bench Cam {SERIAL}\n")
    (camera / "manufacturer").write_text("Bench Works\n")
    tree.bus(f"{HUB}/1-2/1-2:1.0", "usb", {"bInterfaceNumber": "00", "bInterfaceClass": "0e"}, DRIVER="uvcvideo")
    tree.member(f"{HUB}/1-2/1-2:1.0/video4linux/video0", "video4linux", {"name": "Bench Cam"}, DEVNAME="video0")
    return root


def lab(root: Path) -> Path:
    """The bench with its camera, a disk on USB, a touch screen on I2C, two bus controllers."""
    tree = Tree(watched(root))
    stick = tree.usb(f"{HUB}/1-3", "1f00", "00d1")
    (stick / "product").write_text("Bench Stick\n")
    disk = f"{HUB}/1-3/1-3:1.0/host0/target0:0:0/0:0:0:0"
    tree.bus(f"{HUB}/1-3/1-3:1.0", "usb", {"bInterfaceNumber": "00"}, DRIVER="usb-storage")
    tree.bus(disk, "scsi", {"vendor": "Bench", "model": "Stick"}, DRIVER="sd")
    tree.member(f"{disk}/block/sda", "block", {"removable": "1"}, DEVNAME="sda")
    tree.bus(
        "platform/i2c/0018:1F00:0077.0001",
        "hid",
        HID_ID="0018:00001F00:00000077",
        HID_NAME="PNL",
        DRIVER="hid-multitouch",
    )
    for place in ("AMDI0010:00", "AMDI0010:01"):
        tree.bus(f"platform/{place}", "platform", MODALIAS="acpi:AMDI0010:", DRIVER="i2c_designware")
    return root


def shop(root: Path) -> Path:
    """The lab, and a touch panel, two disks on PCI, a relay on HID, a meter without a driver, a serial line."""
    tree = Tree(lab(root))
    panel = "platform/i2c/0018:1F00:0078.0002"
    named = "BENCH:ARM-M4 1F00:0078"
    tree.bus(panel, "hid", HID_ID="0018:00001F00:00000078", HID_NAME=named, DRIVER="hid-multitouch")
    tree.member(f"{panel}/input/input7", "input", {"name": named, "capabilities/abs": "260800000000003"})
    for at, product, model in (("1", "5017", {"model": "BE SN740 512GB"}), ("2", "5018", {})):
        disk = f"pci0000:00/0000:0{at}:00.0"
        numbers = {"vendor": "0x1f00", "device": f"0x{product}", "class": "0x010802"}
        tree.bus(disk, "pci", numbers, DRIVER="nvme")
        tree.member(f"{disk}/nvme/nvme{at}", "nvme", model)
    for port, product, text, code, driver in (
        ("4", "00e1", "Bench Relay", "03", "usbhid"),
        ("5", "00f1", "Bench Charmeter", "ff", ""),
        ("6", "00f2", "USB Serial", "ff", "ch341"),
    ):
        (tree.usb(f"{HUB}/1-{port}", "1f00", product) / "product").write_text(f"{text}\n")
        bound = {"DRIVER": driver} if driver else {}
        interface = {"bInterfaceNumber": "00", "bInterfaceClass": code}
        tree.bus(f"{HUB}/1-{port}/1-{port}:1.0", "usb", interface, **bound)
    (root / "sys/devices" / HUB / "1-4/manufacturer").write_text("Bench Works\n")
    report = f"{HUB}/1-4/1-4:1.0/0003:1F00:00E1.0003"
    tree.bus(report, "hid", HID_ID="0003:00001F00:000000E1", HID_NAME="Bench Relay", DRIVER="hid-generic")
    tree.member(f"{report}/hidraw/hidraw0", "hidraw", DEVNAME="hidraw0")
    tree.member(f"{HUB}/1-6/1-6:1.0/ttyUSB0/tty/ttyUSB0", "tty", DEVNAME="ttyUSB0")
    ids = root / "usr/share/misc"
    ids.mkdir(parents=True)
    (ids / "pci.ids").write_text(
        "1f00  Bench Electronics\n\t5017  BE SN560 / SN740 / SN770 NVMe SSD\n\t5018  Desk SN1 / Desk SN2 NVMe SSD\n"
    )
    (ids / "usb.ids").write_text("1f00  Bench Electronics\n\t00e1  Relay Board\n")
    return root


def desk(root: Path) -> Path:
    """The lab, a lamp, two backlights and a row of keys."""
    tree = Tree(lab(root))
    tree.member("platform/leds/leds/bench:green", "leds", {"max_brightness": "255", "brightness": "0"})
    for panel in ("panel", "panel2"):
        tree.member(f"platform/{panel}/backlight/{panel}", "backlight", {"max_brightness": "100", "brightness": "7"})
    tree.bus("platform/keys.0", "platform", {"modalias": "platform:keys"}, DRIVER="gpio-keys")
    tree.member("platform/keys.0/input/input9", "input", {"name": "gpio-keys", "capabilities/key": "1"})
    return root


def outputs(root: Path, probe: dict[str, Any], tools: int) -> Artifacts:
    """What the embedded agent writes of what PROBE says of the host below ``root``, with at most so many tools."""
    found = identify(probe, IdDatabases(root))
    interface = declare(found, tools)
    return Artifacts(probe=probe, identify=found, interface=interface, serve=render(interface))


def smallest_first(roots: Iterable[Path], tools: int) -> list[Artifacts]:
    """What the embedded agent writes of the devices of each class alone, and then of each host as a whole.

    The judgement of a server with two tools takes a third of the time that one with twelve takes.
    """
    parts, whole = [], []
    for root in roots:
        probe = probe_root(root)
        devices = sorted(probe["devices"], key=lambda each: each["id"])
        for _, alike in groupby(devices, key=lambda each: each["id"].partition("-")[0]):
            part = outputs(root, {**probe, "devices": list(alike)}, tools)
            parts += [part] if part.interface and part.interface["tools"] else []
        whole.append(outputs(root, probe, tools))
    return parts + whole


def written(root: Path) -> tuple[dict[str, dict[str, Any]], str]:
    """What the stages before SERVE say of the desk, and the server that the embedded agent writes."""
    host = desk(root)
    probe = probe_root(host)
    found = identify(probe, IdDatabases(host))
    interface = declare(found, 1000)
    return {"probe": probe, "identify": found, "interface": interface}, render(interface)
