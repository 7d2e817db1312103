"""Hot-plug: the kernel's own announcements, or what replaces them. (Light.)

The kernel announces each device over netlink before any program of the system has looked at it. Where that is not to
be had (a container), the names in sysfs are listed every two seconds. A tree on disk that stands for a host
(OCTOFORM_SYSROOT) announces nothing: there the folders are watched, and a changed name counts as the announcement.
"""

import errno
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from octoform.daemon.model import Cause
from octoform.daemon.observe.file_events import Ear, FolderEar, Watch
from octoform.host import root_from_environment

GLANCE_SECONDS = 2.0
_HEARD, _NOTHING = frozenset((Cause.HARDWARE,)), frozenset[Cause]()
_TELLING = frozenset(("add", "remove", "bind", "unbind", "move", "online", "offline"))
"""``change`` is omitted: a battery that discharges is no hot-plug."""
_DEVICES, _VIRTUAL = "/devices/", "/devices/virtual/"
_MAX_AT_ONCE = 4096
_MAX_FOLDERS = 400


def hardware(environ: Mapping[str, str]) -> Ear:
    """The best ear that this host allows."""
    root = root_from_environment(environ)
    if root != Path("/"):
        return tree(root)
    try:
        return Netlink()
    except (OSError, ImportError):  # no netlink for this user or container, or no libudev
        return Glance(root)


class Netlink:
    """The kernel's announcements. OSError or ImportError when they may not be had."""

    hold = 0.0
    every = None

    def __init__(self) -> None:
        import pyudev  # here, since libudev is loaded with it

        self._monitor: Any = pyudev.Monitor.from_netlink(pyudev.Context(), source="kernel")
        self._monitor.start()

    def fileno(self) -> int | None:
        """Readable when something was announced."""
        return int(self._monitor.fileno())

    def hear(self) -> frozenset[Cause]:
        """Whether a device came or went; what programs make and take away is passed over."""
        found = False
        for _ in range(_MAX_AT_ONCE):
            try:
                device = self._monitor.poll(0)
            except OSError as problem:
                if problem.errno != errno.ENOBUFS:
                    raise
                found = True  # more than could be kept: something came or went
                continue
            if device is None:
                break
            found = found or telling(str(device.action), str(device.device_path))
        return _HEARD if found else _NOTHING

    def close(self) -> None:
        """Let go of the connection, which ends with its last reference."""
        self._monitor = None


def telling(action: str, path: str) -> bool:
    """Whether an announcement is of hardware that came or went: ``add`` of ``/devices/pci0000:00/...``."""
    return action in _TELLING and path.startswith(_DEVICES) and not path.startswith(_VIRTUAL)


class Glance:
    """Looks at the names in sysfs again and again."""

    hold = 0.0
    every = GLANCE_SECONDS

    def __init__(self, root: Path) -> None:
        self._root = root
        self._names = names(root)

    def fileno(self) -> int | None:
        """None: nothing wakes it."""
        return None

    def hear(self) -> frozenset[Cause]:
        """Whether a name came or went since the last look."""
        before, self._names = self._names, names(self._root)
        return _HEARD if self._names != before else _NOTHING

    def close(self) -> None:
        """There is nothing to let go of."""


def names(root: Path) -> frozenset[tuple[str, str]]:
    """Every device's name on every bus, (bus, name); no file is opened."""
    return frozenset((bus.name, name) for bus in _listed(root / "sys/bus") for name in _names(bus / "devices"))


def tree(root: Path) -> FolderEar:
    """An ear for the folders of a tree on disk that stands for a host."""

    def watches() -> Iterator[Watch]:
        folders = [root / "sys/bus", root / "sys/class", root / "sys/block"]
        folders += [folder for bus in _listed(root / "sys/bus") for folder in (bus, bus / "devices")]
        folders += _listed(root / "sys/class")
        for folder in folders[:_MAX_FOLDERS]:
            yield Watch(folder, Cause.HARDWARE)

    return FolderEar(lambda: tuple(watches()), resync=True)


def _listed(folder: Path) -> list[Path]:
    return [folder / name for name in sorted(_names(folder))]


def _names(folder: Path) -> list[str]:
    try:
        with os.scandir(folder) as entries:
            return [entry.name for entry in entries]
    except OSError:  # a bus without devices, or a host without sysfs
        return []
