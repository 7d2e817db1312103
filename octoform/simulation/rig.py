"""A rig in a folder: the tree in which PROBE finds its devices, terminals that answer, a file that the camera fills.

``OCTOFORM_SYSROOT`` names that folder; nothing outside of it is touched.
"""

import re
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Any

from octoform.base.clock import Clock
from octoform.simulation.ports import Port
from octoform.simulation.rail_firmware import LineDevice
from octoform.simulation.scene import Camera, Scene
from octoform.simulation.servos import ServoBus
from octoform.simulation.sysfs_tree import Planter

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
