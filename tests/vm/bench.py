"""What is attached to a guest, with which contents, and what the kernel of each architecture has no driver for."""

import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from vm.devices.breakout import Breakout
from vm.devices.camera import Camera
from vm.devices.headset import Headset
from vm.devices.light import LightSensor
from vm.devices.serial import NAMED_CHIP, SHARED_CHIP, CdcAcm, Ch340, Cp2102
from vm.guest import Guest
from vm.rig import identity, rail_firmware

from octoform.simulation.rail_firmware import LineDevice

_USB = ("uvcvideo", "snd-usb-audio", "cdc-acm", "ch341", "cp210x", "usb-storage", "hid-mcp2221", "hid-sensor-als")
EXPECTED: Mapping[str, tuple[str, ...]] = {
    "amd64": (*_USB, "i2c-stub", "lm75", "gpio-sim", "iio_dummy", "industrialio-configfs"),
    "arm64": (*_USB, "nvme"),
}
"""Modules whose lack is a failure."""
LACKING: Mapping[str, Mapping[str, str]] = {
    "amd64": {},
    "arm64": {"i2c-stub": "a simulated sensor bus", "gpio-sim": "simulated lines", "iio_dummy": "a simulated sensor"},
}
"""Modules that this kernel is known not to have, and what cannot be shown without them."""

CAMERA, HEADSET, RAIL_BOARD = "usb-045e-0772", "usb-0d8c-0014", "usb-2341-804f"
CH340_BOARD, CP2102_BOARD = "usb-1a86-7523", "usb-10c4-ea60"
SIMULATED_CHIP, SIMULATED_SENSOR = "i2c-lm75", "iio-slope"
BREAKOUT, LIGHT, SIMULATED_GPIO = "usb-04d8-00dd", "usb-16d0-0a2b", "platform-gpio-sim"
DISK_BYTES = 48 << 20
DISK_SERIAL = "A3B7710042"
_SENSOR_ADDRESS, _OTHER_ADDRESS = "0x48", "0x49"
_GPIO = "/sys/kernel/config/gpio-sim/bench"


@dataclass
class Bench:
    """The hardware of one guest."""

    guest: Guest
    folder: Path
    """For the disk's image."""
    camera: Camera = field(default_factory=Camera)
    headset: Headset = field(default_factory=Headset)
    breakout: Breakout = field(default_factory=Breakout)
    light: LightSensor = field(default_factory=LightSensor)
    firmware: LineDevice = field(default_factory=rail_firmware)

    @property
    def arch(self) -> str:
        """The guest's architecture."""
        return self.guest.places.arch

    def attach(self) -> None:
        """Everything that there is for this architecture, plugged in and bound to its driver."""
        guest = self.guest
        guest.plug("rail", self.rail(), 1)
        guest.plug("ch340", Ch340(SHARED_CHIP, firmware=rail_firmware()), 2)
        guest.plug("cp2102", Cp2102(NAMED_CHIP, firmware=rail_firmware()), 3)
        guest.plug("camera", self.camera, 4)
        guest.plug("headset", self.headset, 5)
        guest.plug("breakout", self.breakout, 7)
        guest.plug("light", self.light, 8)
        image = self.folder / "disk.img"
        subprocess.run(["truncate", "-s", str(DISK_BYTES), str(image)], check=True)
        guest.plug_disk("disk", image, 6, DISK_SERIAL)
        if self.arch == "amd64":
            self._simulate()
        guest.until("test -e /dev/ttyACM0 && test -e /dev/ttyUSB1 && test -e /dev/video0 && test -e /dev/sda")
        guest.until("ls /sys/bus/hid/devices/*/gpiochip* /sys/bus/iio/devices/*/in_illuminance_raw")
        guest.until("grep -q 'USB Audio Device' /proc/asound/cards")
        guest.run("udevadm settle --timeout=300", 400.0)

    def rail(self) -> CdcAcm:
        """The rail's board; its firmware is the same however often it is plugged."""
        return CdcAcm(identity("rail"), firmware=self.firmware)

    def _simulate(self) -> None:
        """A GPIO controller, two sensors: devices that no port carries."""
        run = self.guest.run
        run(f"modprobe gpio-sim && mkdir -p {_GPIO}/bank && echo 8 >{_GPIO}/bank/num_lines && echo 1 >{_GPIO}/live")
        run("modprobe iio_dummy && modprobe industrialio-configfs && mkdir /sys/kernel/config/iio/devices/dummy/slope")
        run(f"modprobe i2c-dev && modprobe i2c-stub chip_addr={_SENSOR_ADDRESS},{_OTHER_ADDRESS}")
        self._bus = run("i2cdetect -l | grep -i stub | cut -f1 | cut -d- -f2")
        self.set_temperature(25.5)
        self._add_sensor(_SENSOR_ADDRESS)
        self.guest.until(
            "test -e /sys/class/hwmon/hwmon0/temp1_input -a -e /sys/bus/iio/devices/iio:device0/in_accel_x_raw"
        )

    # -- the other side of simulated hardware

    def set_temperature(self, degrees: float) -> None:
        """What the chip measures from now on; it counts in halves, its upper byte first."""
        halves = round(degrees * 2) << 7
        word = (halves & 0xFF) << 8 | halves >> 8
        self.guest.run(f"i2cset -f -y {self._bus} {_SENSOR_ADDRESS} 0 {word:#06x} w")

    def line(self, number: int) -> str:
        """The level that a simulated line has, as the controller itself sees it."""
        return self.guest.run(f"cat /sys/devices/platform/gpio-sim.*/gpiochip*/sim_gpio{number}/value")

    def pull(self, number: int, way: str) -> None:
        """Have something outside pull a line: `pull-up` or `pull-down`."""
        self.guest.run(f"echo {way} >$(echo /sys/devices/platform/gpio-sim.*/gpiochip*/sim_gpio{number}/pull)")

    def sensor_volts(self) -> float:
        """What the simulated sensor's driver itself measures at its first input, in volts."""
        files = "in_voltage0_raw in_voltage0_offset in_voltage0_scale"
        found = self.guest.run(f"cd $(dirname /sys/bus/iio/devices/*/in_voltage0_raw) && cat {files}")
        raw, offset, scale = map(float, found.split())
        return (raw + offset) * scale / 1000

    def renumber_sensor(self) -> tuple[str, str]:
        """Take the temperature chip away and bring it back under another number; its names before and after."""
        before = self._sensor_name()
        self._remove_sensor(_SENSOR_ADDRESS)
        self._add_sensor(_OTHER_ADDRESS)  # takes the number that is free now
        self._add_sensor(_SENSOR_ADDRESS)
        after = self._sensor_name()
        self._remove_sensor(_OTHER_ADDRESS)
        return before, after

    def _sensor_name(self) -> str:
        return self.guest.until(f"ls /sys/bus/i2c/devices/{self._bus}-00{_SENSOR_ADDRESS[2:]}/hwmon")

    def _add_sensor(self, address: str) -> None:
        self.guest.run(f"echo lm75 {address} >/sys/bus/i2c/devices/i2c-{self._bus}/new_device")

    def _remove_sensor(self, address: str) -> None:
        self.guest.run(f"echo {address} >/sys/bus/i2c/devices/i2c-{self._bus}/delete_device")
