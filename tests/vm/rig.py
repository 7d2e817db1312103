"""The reference rig at a guest: arm, rail and camera of the simulation, each as a USB device that a driver binds to."""

import contextlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from string import Template
from typing import Any

from vm.devices.model import Identity, Model
from vm.devices.scene import SceneCamera
from vm.devices.serial import CdcAcm
from vm.guest import Guest

from octoform.simulation.rail_firmware import LineDevice
from octoform.simulation.rig import load
from octoform.simulation.scene import Scene
from octoform.simulation.servos import ServoBus

ARM, RAIL, CAMERA = "usb-1a86-55d3", "usb-2341-804f", "usb-045e-0772"
_GIVEN: Mapping[str, Any] = load("reference")["devices"]


def rail_firmware() -> LineDevice:
    """What runs on the board of a camera rail."""
    return LineDevice(_GIVEN["rail"])


def identity(name: str) -> Identity:
    """The strings of this device in the rig's description."""
    given = _GIVEN[name]
    text = Template(given["descriptors"]).safe_substitute(given["strings"])
    fields = dict(re.findall(r"^ +(\w+)=(.+)$", text, re.MULTILINE))
    vendor, product = int(fields["idVendor"], 16), int(fields["idProduct"], 16)
    return Identity(vendor, product, fields["manufacturer"], fields["product"], fields.get("serial", ""))


@dataclass
class RigBench:
    """Each board keeps its program however often it is plugged: the motors have a supply of their own."""

    guest: Guest
    servos: ServoBus = field(default_factory=lambda: ServoBus(_GIVEN["arm"]))
    line: LineDevice = field(default_factory=rail_firmware)

    def __post_init__(self) -> None:
        """Nothing is plugged yet."""
        self.scene = Scene(self.servos, self.line)

    def attach(self) -> None:
        """All three, one after the other: the arm is the first serial port."""
        for port, (name, node) in enumerate(
            (("arm", "/dev/ttyACM0"), ("rail", "/dev/ttyACM1"), ("camera", "/dev/video0")), 1
        ):
            self.guest.plug(name, self.model(name), port)
            self.guest.until(f"test -e {node}")
        self.guest.run("udevadm settle --timeout=300", 400.0)

    def model(self, name: str) -> Model:
        """The device as it is plugged: its driver begins anew, its program goes on."""
        if name == "camera":
            return SceneCamera(identity(name), scene=self.scene)
        return CdcAcm(identity(name), firmware=self.servos if name == "arm" else self.line)

    @contextlib.contextmanager
    def pulled(self, name: str, node: str, expected: str, port: int) -> Iterator[None]:
        """Pull a device while a program has its node open; at the end it comes back at another port and name."""
        with self.guest.held_open(node):
            self.guest.unplug(name)
            self.guest.until(f"! test -e {node}")
            try:
                yield
            finally:  # what the next test needs must not depend on this one
                self.guest.plug(name, self.model(name), port)
            self.guest.until(f"test -e {expected}")
        self.guest.run("udevadm settle --timeout=300", 400.0)
