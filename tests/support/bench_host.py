"""The host that the scripted agent's good output is about: a thermometer of the board and a serial adapter on USB."""

from pathlib import Path

from sysfs_tree import Tree

ADAPTER = "pci0000:00/0000:00:14.0/usb1/1-1"
SENSOR = "platform/benchtemp.0/hwmon/hwmon0"


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
