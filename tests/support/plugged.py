"""A tree on disk that stands for a host: devices are plugged in and taken away while something looks at it."""

import json
import shutil
from pathlib import Path

CAMERA, SENSOR = "usb-046d-0825", "hwmon-k10temp"


class Host:
    """A tree with a camera and a sensor, one at a time or both."""

    def __init__(self, root: Path) -> None:
        self.root = root
        for folder in ("sys/bus/usb/devices", "sys/class/hwmon"):
            (root / folder).mkdir(parents=True)

    def plug(self, *which: str) -> None:
        """Plug in CAMERA, SENSOR or both."""
        if CAMERA in which:
            self._add("sys/devices/usb1/1-5", "sys/bus/usb", {"idVendor": "046d", "idProduct": "0825"})
            (self.root / "sys/bus/usb/devices/1-5").symlink_to(self.root / "sys/devices/usb1/1-5")
        if SENSOR in which:
            self._add("sys/devices/hwmon/hwmon0", "sys/class/hwmon", {"name": "k10temp"})
            (self.root / "sys/class/hwmon/hwmon0").symlink_to(self.root / "sys/devices/hwmon/hwmon0")

    def unplug_camera(self) -> None:
        """Take the camera away."""
        (self.root / "sys/bus/usb/devices/1-5").unlink()
        shutil.rmtree(self.root / "sys/devices/usb1/1-5")

    def record(self, place: str | None) -> Path:
        """An instances file that knows the camera, with its place or without."""
        path = self.root / "instances.json"
        devices = {CAMERA: {"strength": "positional", "port": "1-5"} | ({"sysfs": place} if place else {})}
        path.write_text(json.dumps({"format": 1, "devices": devices}))
        return path

    def _add(self, place: str, subsystem: str, attributes: dict[str, str]) -> None:
        folder = self.root / place
        folder.mkdir(parents=True)
        (folder / "subsystem").symlink_to(self.root / subsystem)
        for name, value in attributes.items():
            (folder / name).write_text(value + "\n")
