"""A light sensor of the HID class: the kernel's industrial I/O shows it on every architecture, without a simulation."""

import struct
from dataclasses import dataclass

from vm.devices.hid import HidDevice
from vm.devices.model import Identity

LIGHT = Identity(0x16D0, 0x0A2B, "Bench Instruments", "Light Sensor", "L-00429")
_NUMBER, _INPUT = 1, 1
_MILLISECONDS = 1000
# HID Usage Tables, sensor page: an ambient light sensor with three properties and one measured field.
_DESCRIPTION = bytes.fromhex(
    "0520" "0941" "a100" "8501"
    # reporting state and power state: one of six choices each
    "0a1603" "1500" "2505" "7508" "9501" "a102" "0a4008" "0a4108" "0a4208" "0a4308" "0a4408" "0a4508" "b100" "c0"
    "0a1903" "1500" "2505" "7508" "9501" "a102" "0a5008" "0a5108" "0a5208" "0a5308" "0a5408" "0a5508" "b100" "c0"
    # report interval in milliseconds
    "0a0e03" "1500" "27ffffff7f" "7520" "9501" "b102"
    # illuminance in lux
    "0ad104" "1500" "27ffff0000" "7510" "9501" "8102"
    "c0"
)  # fmt: skip


@dataclass
class LightSensor(HidDevice):
    """Measures ``lux``."""

    identity: Identity = LIGHT
    description: bytes = _DESCRIPTION
    lux: int = 312

    def report(self, kind: int, number: int) -> bytes | None:
        """The measured value, or its properties: all on, once a second."""
        if number != _NUMBER:
            return None
        if kind == _INPUT:
            return struct.pack("<BH", _NUMBER, self.lux)
        return struct.pack("<BBBI", _NUMBER, 1, 1, _MILLISECONDS)
