"""Which devices are plugged in now, so that a client hears of it when one comes or goes, and not at the next call.

The generated server's own `runtime` states whether a device is there. The kernel announces hot-plug to anyone who
listens on a netlink socket; where no one may listen, or a tree on disk replaces the system, looking again now and then
does it. All of this happens in a thread of its own: a read of sysfs can take seconds when a driver is ill.

Absent is only what is known to have been there: seen before, or recorded with its place. Everything else is unknown.
"""

import importlib
import os
import select
import socket
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from octoform.base.files import read_json

from .stderr_log import write_line

KOBJECT_UEVENT = 15  # linux/netlink.h: NETLINK_KOBJECT_UEVENT, whose first group carries the kernel's own events
BUFFER = 1 << 16
PLUGGING = frozenset({b"add", b"remove", b"bind", b"unbind", b"move"})
"""Events of a device that comes or goes; `change` is a battery that counts down, or a fan."""
QUIET = 0.3
"""Seconds without an event after which a burst of them is over."""
BURST = 2.0
"""Seconds after which a burst is looked into although it goes on."""
WITH_EVENTS, WITHOUT_EVENTS, ON_DISK = 30.0, 2.0, 1.0
"""Seconds between two looks: as a fallback, where there are no events, and for a tree on disk."""


class Presence:
    """Watches ``devices`` (id, name) from `start` to `stop`; ``tools`` have name and devices (the ids).

    ``on_change`` is called in the watching thread with the ids of devices that came or went.
    """

    def __init__(
        self,
        devices: Iterable[Mapping[str, Any]],
        tools: Iterable[Mapping[str, Any]],
        on_change: Callable[[frozenset[str]], None],
        events: Callable[[], socket.socket | None] | None = None,
    ) -> None:
        self._names = {device["id"]: str(device.get("name") or device["id"]) for device in devices}
        self._tools = {tool["name"]: tuple(tool.get("devices") or ()) for tool in tools}
        self._on_change = on_change
        self._events = events or kernel_events
        self._there: dict[str, bool] = {}
        self._closed: frozenset[str] = frozenset()
        self._stopping, self._wake = socket.socketpair()
        self._thread: threading.Thread | None = None

    def present(self, device: str) -> bool | None:
        """Whether a device is there; None when that is not known."""
        return self._there.get(device)

    def lacks(self) -> bool:
        """Whether a device was absent at the last look, or has a node that the user of this process may not use."""
        return bool(self._closed) or False in self._there.values()

    def absent(self, tool: str) -> list[str]:
        """The names of a tool's devices that are absent now, in the order of its devices."""
        return [self._names.get(each, each) for each in self._tools.get(tool, ()) if self._there.get(each) is False]

    def missing(self, tool: str, device: object) -> list[str]:
        """The same for a call: only the device that it names, if it names one, and none that has come back since.

        A call in the second after a re-plug must not hear of the second before it.
        """
        devices = self._tools.get(tool, ())
        asked = [each for each in devices if each == device] or devices
        gone = [each for each in asked if self._there.get(each) is False]
        if gone and (runtime := _runtime()) is not None:
            gone = [each for each in gone if _there(runtime, each) is False]
        return [self._names.get(each, each) for each in gone]

    def start(self) -> None:
        """Look, and go on looking."""
        runtime = _runtime()
        if runtime is not None and self._thread is None:
            self._thread = threading.Thread(target=self._watch, args=(runtime,), name="presence", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Look no more; does not wait for a look that hangs."""
        self._wake.close()
        if self._thread is None:
            self._stopping.close()

    def _watch(self, runtime: ModuleType) -> None:
        on_disk = bool(os.environ.get("OCTOFORM_SYSROOT"))
        events = None if on_disk else self._events()
        seconds = ON_DISK if on_disk else WITH_EVENTS if events is not None else WITHOUT_EVENTS
        try:
            changed = self._look(runtime)
            # What is there at the start is no news; what is missing may have been listed as if it were there.
            changed = frozenset(device for device in changed if not self._there[device])
            while True:
                if changed:
                    self._on_change(changed)
                if not _wait(self._stopping, events, seconds):
                    return
                changed = self._look(runtime)
        finally:
            self._stopping.close()
            if events is not None:
                events.close()

    def _look(self, runtime: ModuleType) -> frozenset[str]:
        """See which devices are there; the ids of those that came or went."""
        placed, changed = _placed(), set()
        for device in self._names:
            there = _there(runtime, device)
            before = self._there.get(device)
            if there is None or (there is False and before is None and device not in placed):
                continue
            self._there[device] = there
            if there is not before:
                changed.add(device)
        self._closed = frozenset(each for each, there in self._there.items() if there and _is_closed(runtime, each))
        return frozenset(changed)


def _there(runtime: ModuleType, device: str) -> bool | None:
    try:
        runtime.device(device)
    except runtime.DeviceAbsent:
        return False
    except (runtime.DeviceFault, OSError) as problem:
        write_line(f"whether {device} is there is unknown: {problem}")
        return None
    return True


def _is_closed(runtime: ModuleType, device: str) -> bool:
    """True when this user may not use a node of the device; False as well where that cannot be determined."""
    try:
        where = importlib.import_module("runtime.where")
        kinds = {str(node["class"]) for node in _instances()[device]["nodes"]}
        found = runtime.device(device)
        return bool(where.refused([(kind, node) for kind in kinds for node in found.nodes(kind)]))
    except (ImportError, OSError, ValueError, LookupError, AttributeError, TypeError, runtime.DeviceFault):
        return False


def _runtime() -> ModuleType | None:
    """The package beside the generated server; None where a server brings none."""
    try:
        found = importlib.import_module("runtime")
    except ImportError:
        return None
    return found if hasattr(found, "device") and hasattr(found, "DeviceAbsent") else None


def _instances() -> Mapping[str, Any]:
    """The devices of the instances file; OSError, ValueError, LookupError or TypeError where it is none."""
    found: Mapping[str, Any] = read_json(Path(os.environ["OCTOFORM_INSTANCES"]))["devices"]
    return found


def _placed() -> frozenset[str]:
    """The devices whose place in sysfs is recorded in the instances file."""
    try:
        return frozenset(name for name, each in _instances().items() if each.get("sysfs"))
    except (OSError, ValueError, LookupError, AttributeError, TypeError):
        return frozenset()  # without the file nothing is known, which marks nothing as absent


def kernel_events() -> socket.socket | None:
    """A socket that receives the kernel's hot-plug events; None where this process may not have one."""
    try:
        events = socket.socket(socket.AF_NETLINK, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC, KOBJECT_UEVENT)
    except OSError:
        return None
    try:
        events.bind((0, 1))
    except OSError:
        events.close()
        return None
    return events


def _wait(stopping: socket.socket, events: socket.socket | None, seconds: float) -> bool:
    """Wait for hot-plug to begin and to be over, or for ``seconds``; False when the watching is to end."""
    watched = select.poll()  # `select` takes no descriptor above 1023
    for each in (stopping,) if events is None else (stopping, events):
        watched.register(each, select.POLLIN)
    deadline, plugged = time.monotonic() + seconds, None
    while True:
        left = deadline - time.monotonic()
        ready = [descriptor for descriptor, _ in watched.poll(max(left, 0.0) * 1000)]
        if stopping.fileno() in ready:
            return False
        if events is None or not ready:
            return True
        if _is_plugging(events):
            now = time.monotonic()
            plugged = now if plugged is None else plugged
            deadline = min(now + QUIET, plugged + BURST)


def _is_plugging(events: socket.socket) -> bool:
    """Take one event; True for one of the kernel's that states that a device came or went, or that some were lost."""
    try:
        data, sender = events.recvfrom(BUFFER)
    except OSError:  # ENOBUFS: more came than the kernel keeps
        return True
    # A program may send here too; only the kernel's own port is 0.
    return (not isinstance(sender, tuple) or sender[0] == 0) and data.partition(b"@")[0] in PLUGGING
