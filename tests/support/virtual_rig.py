"""The reference rig behind a generated server in this process, all in virtual time: the firmware is simulated, the
libraries that speak to it are the real ones, and what lies between them is memory in place of a terminal.
"""

import functools
import importlib.util
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import scservo_sdk.port_handler
import serial
from ruamel.yaml import YAML

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe import probe_root
from octoform.builtin.serve.stage import render
from octoform.policy.resolve import Policy, resolve
from octoform.profiles import Profile, devices_of, for_task
from octoform.profiles.profile_parser import load
from octoform.simulation.rail_firmware import LineDevice
from octoform.simulation.rig import Rig
from octoform.simulation.servos import ServoBus

TOP = Path(__file__).parents[2]
PROFILES = [TOP / "profiles" / f"{name}.md" for name in ("so-arm101", "camera-rail")]
ARM, RAIL, CAMERA = "usb-1a86-55d3", "usb-2341-804f", "usb-045e-0772"
ANSWERS = {RAIL: "the camera rail of the bench"}
MOMENT = 0.01
"""Seconds that pass while somebody looks for a byte that is not there."""


class Time:
    """Stands where a module has `time`; a pause is over at once."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now

    monotonic = time = perf_counter = __call__

    def sleep(self, seconds: float) -> None:
        """Later."""
        self.now += seconds


class Line:
    """What pyserial's ``Serial`` is to its users, with the firmware at the other end of it."""

    def __init__(self, device: ServoBus | LineDevice, node: str, time: Time, timeout: float) -> None:
        self.device, self._time, self._timeout = device, time, timeout
        self.fd = os.open(node, os.O_RDWR | os.O_NOCTTY)
        self._text = b""
        device.opened()

    def __enter__(self) -> "Line":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def fileno(self) -> int:
        return self.fd

    def close(self) -> None:
        if self.fd >= 0:
            os.close(self.fd)
        self.fd = -1

    def write(self, data: bytes) -> int:
        self._text += self.device.feed(bytes(data))
        return len(data)

    def read(self, size: int = 1) -> bytes:
        self._text += self.device.feed(b"")
        if not self._text:
            due = self.device.due
            waited = self._timeout or MOMENT
            self._time.sleep(waited if due is None else max(0.0, min(waited, due - self._time.now)))
            self._text += self.device.feed(b"")
        found, self._text = self._text[:size], self._text[size:]
        return found

    @property
    def in_waiting(self) -> int:
        return len(self._text)

    def reset_input_buffer(self) -> None:
        self._text = b""

    def flush(self) -> None:
        """Everything is sent at once."""


@dataclass
class VirtualRig:
    """``tools`` are the server's functions by name, ``policy`` what the endpoint would enforce of them.

    ``identified`` and ``interface`` are the artifacts that came before the server, ``profiles`` those that were read.
    """

    rig: Rig
    time: Time
    tools: dict[str, Any]
    policy: dict[str, Any]
    identified: dict[str, Any]
    interface: dict[str, Any]
    profiles: tuple[Profile, ...]

    @property
    def arm(self) -> ServoBus:
        assert self.rig.servos is not None
        return self.rig.servos

    @property
    def rail(self) -> LineDevice:
        assert self.rig.line is not None
        return self.rig.line


def described(**changes: dict[str, Any]) -> dict[str, Any]:
    """The reference rig, some of its devices described otherwise."""
    text = (TOP / "profiles" / "rigs" / "reference.yaml").read_text()
    rig: dict[str, Any] = YAML(typ="safe").load(text)
    for name, more in changes.items():
        rig["devices"][name] |= more
    return rig


@contextmanager
def virtual_rig(folder: Path, description: dict[str, Any], patch: pytest.MonkeyPatch) -> Iterator[VirtualRig]:
    """All of it below a folder; ``patch`` takes what it changes in the libraries back again."""
    time, tree = Time(), folder / "tree"
    rig = Rig(description, tree, time)
    rig.start()
    try:
        profiles, found = load(PROFILES)
        assert not found
        identified, interface, server = _generated(tree, profiles, folder)
        tools = interface["tools"]
        policy = resolve(
            Policy(actuate="allow"), tools, [(one, devices_of(one, probe_root(tree), ANSWERS)) for one in profiles]
        )
        patch.setenv("OCTOFORM_SYSROOT", str(tree))
        patch.setenv("HOME", str(folder))
        with _loaded(server, rig, time, patch) as module:
            functions = {one["name"]: getattr(module, one["name"]) for one in tools}
            yield VirtualRig(rig, time, functions, policy, identified, interface, profiles)
    finally:
        rig.stop()


def _generated(tree: Path, profiles: tuple[Profile, ...], folder: Path) -> tuple[dict[str, Any], dict[str, Any], Path]:
    """The artifacts of IDENTIFY and INTERFACE, and the file of SERVE."""
    probe = probe_root(tree)
    known = [for_task(one, devices_of(one, probe, ANSWERS)) for one in profiles]
    annotated = identify(probe, IdDatabases(tree), known, ANSWERS)
    interface = declare(annotated, 30, known)
    server = folder / "server" / "server.py"
    server.parent.mkdir()
    server.write_text(render(interface, known))
    (server.parent / "runtime").symlink_to(TOP / "octoform" / "runtime")
    return annotated, interface, server


@contextmanager
def _loaded(server: Path, rig: Rig, time: Time, patch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    others = {name: module for name, module in sys.modules.items() if name.partition(".")[0] == "runtime"}
    for name in others:
        del sys.modules[name]
    patch.syspath_prepend(str(server.parent))
    spec = importlib.util.spec_from_file_location("virtual_rig_server", server)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    _slowed(module.runtime, rig, time, patch)
    try:
        yield module
    finally:
        for name in [name for name in sys.modules if name.partition(".")[0] == "runtime"]:
            del sys.modules[name]
        sys.modules.update(others)


def _slowed(runtime: ModuleType, rig: Rig, time: Time, patch: pytest.MonkeyPatch) -> None:
    """Virtual time for each wait, and the firmware for each opened line."""
    patch.setattr(runtime.units, "Units", functools.partial(runtime.units.Units, clock=time, sleep=time.sleep))
    patch.setattr(runtime.lines, "time", time)
    found = functools.cache(
        runtime.devices.device
    )  # nothing is plugged elsewhere here, and looking takes most of the time
    patch.setattr(runtime.devices, "device", found)
    patch.setattr(runtime, "device", found)
    patch.setattr(scservo_sdk.port_handler, "time", time)
    ends = {
        str(rig.folder / "dev" / rig.description["devices"][name]["node"]): one for name, one in rig.devices.items()
    }

    def opened(port: str, *_: object, timeout: float = 0, **__: object) -> Line:
        return Line(ends[port], port, time, timeout)

    patch.setattr(serial, "Serial", opened)
    patch.setattr(scservo_sdk.port_handler, "serial", SimpleNamespace(Serial=opened, EIGHTBITS=8))
