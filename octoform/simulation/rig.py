"""A rig in a folder: the tree in which PROBE finds its devices, terminals that answer, a file that the camera fills.

``OCTOFORM_SYSROOT`` names that folder; nothing outside of it is touched.
"""

import os
import pty
import re
import select
import termios
import threading
import time
import tty
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Any, Protocol

from octoform.base.clock import Clock
from octoform.simulation.rail_firmware import LineDevice
from octoform.simulation.scene import Camera, Scene
from octoform.simulation.servos import ServoBus
from octoform.simulation.sysfs_tree import Planter

# A tty for a simulated device: a pseudo terminal whose far end feeds it, in a thread of its own.
#
# What a real adapter does is done here: it notifies the device that a host has opened or closed the port, hands nothing
# on at a wrong speed, and forgets what no one read when the port is closed.

_SPEEDS = {getattr(termios, name): int(name[1:]) for name in dir(termios) if re.fullmatch(r"B\d+", name)}
_GLANCE, _SOON, _NEVER = 10, 5, 50
"""Milliseconds between two looks: at a closed port, when the device has something to say later, and else."""


class Device(Protocol):
    """The far end of a line: bytes in, bytes out."""

    @property
    def baud(self) -> int | None:
        """The only speed that it understands; None for any."""

    @property
    def due(self) -> float | None:
        """When ``feed(b"")`` has something to say; None when it has not."""

    def feed(self, data: bytes) -> bytes:
        """The answer to these bytes and to those before; OSError when it goes away."""

    def garbled(self, data: bytes) -> None:
        """Bytes at a speed that it does not understand."""

    def opened(self) -> None:
        """A host has opened the port."""

    def closed(self) -> None:
        """No host has it open any more."""


class Port:
    """``node`` becomes a link to the terminal; ``gone`` is called when the device unplugged itself."""

    def __init__(self, device: Device, node: Path, gone: Callable[[], None] = lambda: None) -> None:
        self._device, self._node, self._gone = device, node, gone
        self._over, self._open = threading.Event(), False
        self._thread = threading.Thread(target=self._run, name=node.name, daemon=True)
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self.terminal = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)

    def start(self) -> None:
        """Make the node; from now on it answers."""
        self._node.parent.mkdir(parents=True, exist_ok=True)
        self._node.unlink(missing_ok=True)
        self._node.symlink_to(self.terminal)
        self._thread.start()

    def stop(self) -> None:
        """Take node and terminal away: anyone who has it open sees the line go dead."""
        self._over.set()
        if self._thread is not threading.current_thread():
            self._thread.join()

    def say(self, data: bytes) -> None:
        """Send what no one asked for; what a host does not read is lost when its buffer is full."""
        while data:
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                return

    @property
    def speed(self) -> int | None:
        """The line's speed as the host has set it; None for one without a name."""
        return _SPEEDS.get(termios.tcgetattr(self._master)[5])

    def _run(self) -> None:
        poller = select.poll()
        poller.register(self._master, select.POLLIN)
        try:
            while not self._over.is_set():
                found = poller.poll(_NEVER if self._device.due is None else _SOON)
                self._look(found[0][1] if found else 0)
        except OSError:
            self._node.unlink(missing_ok=True)
            self._gone()
        finally:
            if self._open:
                self._device.closed()
            self._node.unlink(missing_ok=True)
            os.close(self._master)

    def _look(self, flags: int) -> None:
        data = b""
        if flags & select.POLLIN:
            data = os.read(self._master, 4096)
        elif flags & select.POLLHUP:
            self._closed()
            self._over.wait(_GLANCE / 1000)
            return
        if not self._open:
            self._open = True
            self._device.opened()
        if self._device.baud not in (None, self.speed):
            self._device.garbled(data)
            return
        answer = self._device.feed(data)
        if answer:
            self.say(answer)

    def _closed(self) -> None:
        if not self._open:
            return
        self._open = False
        self._device.closed()
        slave = os.open(self.terminal, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        termios.tcflush(slave, termios.TCIFLUSH)
        os.close(slave)


_NODES = {"servos": (166, "tty"), "line": (166, "tty"), "camera": (81, "video")}


@dataclass
class _Plugged:
    tree: Planter
    end: Port | Camera
    place: tuple[str, str]


class Rig:
    """``servos``, ``line`` and ``scene`` are the first device of their kind; ``devices`` are all by their names."""

    def __init__(self, description: Mapping[str, Any], folder: Path, clock: Clock = time.monotonic) -> None:
        self.description, self.folder = description, folder
        self._given: Mapping[str, Mapping[str, Any]] = description["devices"]
        self.devices: dict[str, ServoBus | LineDevice] = {}
        for name, device in self._given.items():
            if device["kind"] == "servos":
                self.devices[name] = ServoBus(device, clock)
            elif device["kind"] == "line":
                self.devices[name] = LineDevice(device, clock)
        self.servos = next((one for one in self.devices.values() if isinstance(one, ServoBus)), None)
        self.line = next((one for one in self.devices.values() if isinstance(one, LineDevice)), None)
        self.scene = Scene(self.servos, self.line)
        self._host = Planter(folder)
        self._plugged: dict[str, _Plugged] = {}

    @property
    def names(self) -> list[str]:
        """All devices, plugged or not."""
        return list(self._given)

    @property
    def places(self) -> dict[str, tuple[str, str]]:
        """The devices that are plugged: port and node of each."""
        return {name: one.place for name, one in self._plugged.items()}

    @property
    def camera(self) -> Camera | None:
        """The camera, while it is plugged."""
        return next((one.end for one in self._plugged.values() if isinstance(one.end, Camera)), None)

    def start(self) -> None:
        """Plant the host and plug all devices, but for those that the description leaves unplugged."""
        self._host.plant(self.description.get("host", ""))
        for name, device in self._given.items():
            if not device.get("unplugged"):
                self.plug(name)

    def stop(self) -> None:
        """Unplug all and take the host away; the folder itself stays."""
        for name in list(self._plugged):
            self.unplug(name)
        self._host.uproot()

    def plug(self, name: str, *, port: str | None = None, node: str | None = None) -> None:
        """Connect a device: at its own port and under its own node's name, or at others."""
        if name in self._plugged:
            raise ValueError(f"{name} is plugged already")
        given = self._given[name]
        port, node = port or str(given["port"]), node or str(given["node"])
        if taken := {port, node} & {word for place in self.places.values() for word in place}:
            raise ValueError(f"{taken.pop()} is taken by another device")
        planter = Planter(self.folder)
        planter.plant(self._text(given, port, node))
        place = self.folder / "dev" / node
        end: Port | Camera
        if given["kind"] == "camera":
            place.unlink(missing_ok=True)
            end = Camera(self.scene, place, (given["width"], given["height"]), given.get("frames", 16))
        else:
            end = Port(self.devices[name], place, lambda: self._went(name))
        self._plugged[name] = _Plugged(planter, end, (port, node))
        end.start()

    def unplug(self, name: str) -> None:
        """Take a device away; harmless when it is not there. What holds its node open sees the line go dead."""
        gone = self._plugged.pop(name, None)
        if gone is not None:
            gone.end.stop()
            gone.tree.uproot()

    def _went(self, name: str) -> None:
        """A device unplugged itself."""
        gone = self._plugged.pop(name, None)
        if gone is not None:
            gone.tree.uproot()

    @staticmethod
    def _text(given: Mapping[str, Any], port: str, node: str) -> str:
        """The device's descriptors: what the kernel would show of it at this port, under this name."""
        major, kind = _NODES[given["kind"]]
        number = re.sub(r"\D", "", node) or "0"
        says = next((f"{word}_strings" for word in ("anonymous", "described") if given.get(word)), "strings")
        if kind == "tty" and not node.startswith("tty"):
            raise ValueError(f"{node} is no name of a tty")
        return Template(given["descriptors"]).substitute(
            given.get(says, {}), port=port, bus=port.split("-")[0], node=node, number=number, major=major
        )


# Reads the description of a rig: a YAML file with the host around it and each device's numbers.
#
# The one part of the package that needs more than the standard library: a YAML reader. The devices take what it gives
# as plain dicts, from wherever they come.

KINDS = ("servos", "line", "camera")


class RigInvalid(ValueError):
    """No such description, or one that can't be used; the text states which and why."""


def folders() -> tuple[Path, ...]:
    """Where descriptions are shipped: inside the installed package, or at the top of the source tree."""
    here = Path(__file__).parent
    return here / "rigs", here.parents[1] / "profiles" / "rigs"


def names() -> list[str]:
    """The rigs that are shipped."""
    return sorted({path.stem for folder in folders() for path in folder.glob("*.yaml")})


def load(rig: str | Path) -> dict[str, Any]:
    """The description of a shipped rig by its name, or of a file by its path. RigInvalid states what is wrong."""
    from ruamel.yaml import YAML  # heavy, and not needed by the devices
    from ruamel.yaml.error import YAMLError

    path = Path(rig)
    if path.suffix != ".yaml":
        path = next((folder / f"{rig}.yaml" for folder in folders() if (folder / f"{rig}.yaml").is_file()), path)
    try:
        document = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RigInvalid(
            f"there is no rig {rig}; shipped are {', '.join(names())}; of your own, give the .yaml file"
        ) from None
    except (OSError, UnicodeDecodeError, YAMLError) as problem:
        raise RigInvalid(f"{path}: {problem}") from problem
    return _checked(document, path)


def _checked(document: Any, path: Path) -> dict[str, Any]:
    devices = document.get("devices") if isinstance(document, dict) else None
    if not isinstance(devices, dict) or not devices:
        raise RigInvalid(f"{path}: a rig needs `devices`, a mapping from names to devices")
    for name, device in devices.items():
        if not isinstance(device, dict) or device.get("kind") not in KINDS:
            raise RigInvalid(f"{path}: devices.{name}.kind has to be one of {', '.join(KINDS)}")
        missing = [key for key in ("port", "node", "descriptors") if key not in device]
        if missing:
            raise RigInvalid(f"{path}: devices.{name} has no {missing[0]}")
    return dict(document)
