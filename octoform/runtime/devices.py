"""Finds a device by identity at the moment of a call, wherever it is plugged in now.

Generated code holds ids of kinds, never a node or a port. The instances file states which unit an id is: where it
was seen (`sysfs`, `port`), its serial number where it has one, and how strong that identity is. Without the file the
id alone decides, by kind and ordinal (`binding` has the rules).
"""

import hashlib
import io
import os
import stat
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

from . import binding, calllog
from .base.files import read_json
from .base.locks import acquire, lock_file
from .base.shape import INSTANCES, fits
from .binding import bind, in_place
from .faults import AmbiguousDevice, BusBusy, DeviceAbsent
from .sysfs import members, read_text, subsystem, sysroot, uevent

# One lock for each bus, across the threads of a server and across processes.
#
# Two servers of one host, or two clients that each started one, must not talk over each other on one device. The lock
# is a file lock (flock), which the kernel releases when a process dies, below a folder that only this user can write;
# its place depends on the user alone, because servers are started with very different environments.
#
# Each holder opens the file for itself, which keeps threads of one process apart as well. The lock lives and dies with
# the file object: a tool that is stopped by an exception at any place, also while it takes the lock, leaves none.

DEFAULT_TIMEOUT = 10.0
_STEP = 0.005
_MAX_STEP = 0.05


class Bus:
    """A lock to hold over a whole exchange: ``with bus("..."):``, or ``async with`` in an async tool.

    Not re-entrant: who holds it and asks again waits for itself, and gets BusBusy. Raises BusBusy after ``timeout``
    seconds, OSError when the lock's folder cannot be made.
    """

    def __init__(self, name: str, timeout: float = DEFAULT_TIMEOUT, confirm: Callable[[], None] | None = None) -> None:
        """``name`` states what is shared: a bus's name, or a device's folder in sysfs.

        ``confirm`` is called once the lock is held; when it raises, the lock is released.
        """
        self.name = name
        self.timeout = timeout
        self._confirm = confirm
        self._file: io.FileIO | None = None

    def __enter__(self) -> "Bus":
        """Wait for the lock."""
        end, step = time.monotonic() + self.timeout, _STEP
        while not self._try():
            self._give_up_after(end)
            time.sleep(step)
            step = min(step * 2, _MAX_STEP)
        return self._confirmed()

    async def __aenter__(self) -> "Bus":
        """Wait for the lock while other tasks go on."""
        import asyncio  # here, so that a question where a device is does not load it

        end, step = time.monotonic() + self.timeout, _STEP
        while not self._try():
            self._give_up_after(end)
            await asyncio.sleep(step)
            step = min(step * 2, _MAX_STEP)
        return self._confirmed()

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        """Release it."""
        held, self._file = self._file, None
        if held is not None:
            held.close()

    async def __aexit__(self, *problem: type[BaseException] | BaseException | TracebackType | None) -> None:
        """Release it."""
        self.__exit__(*problem)

    def _confirmed(self) -> "Bus":
        try:
            if self._confirm is not None:
                self._confirm()
        except BaseException:
            self.__exit__()
            raise
        return self

    def _try(self) -> bool:
        self._file = _locked(_file(self.name))
        return self._file is not None

    def _give_up_after(self, end: float) -> None:
        if time.monotonic() >= end:
            holder = read_text(_file(self.name), 40) or "?"
            raise BusBusy(self.name, f"{self.name} was in use for {self.timeout:g} s (by process {holder})")


class Located(Protocol):
    """A device with a place in sysfs."""

    @property
    def folder(self) -> Path:
        """Its folder now."""
        ...

    def confirm(self) -> None:
        """Raise when it is no longer the device that a tool which acts asked for."""
        ...


def bus(shared: str | Located, timeout: float = DEFAULT_TIMEOUT) -> Bus:
    """The lock of a bus by its name, or of one device wherever it is attached."""
    return Bus(shared, timeout) if isinstance(shared, str) else Bus(str(shared.folder), timeout, shared.confirm)


def _file(name: str) -> Path:
    return _folder() / (hashlib.sha256(name.encode("utf-8", "surrogateescape")).hexdigest()[:24] + ".lock")


def _locked(path: Path) -> io.FileIO | None:
    """The file with its lock, or None when another one holds it."""
    file = io.FileIO(path, "r+", opener=lambda _, __: lock_file(path))
    if not acquire(file.fileno()):
        file.close()
        return None
    os.pwrite(file.fileno(), f"{os.getpid()}\n".ljust(12).encode(), 0)
    return file


def _folder() -> Path:
    """The private folder of this user's locks; PermissionError when another user got to its name first."""
    user = os.getuid()
    session = Path(f"/run/user/{user}")
    folder = session / "octoform" if session.is_dir() and os.access(session, os.W_OK) else Path(f"/tmp/octoform-{user}")
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != user or status.st_mode & 0o022:
        raise PermissionError(f"{folder} is not a private folder of this user")
    return folder


_cache: dict[str, tuple[tuple[int, int, int], dict[str, Any] | None]] = {}


@dataclass(frozen=True)
class Device:
    """A device as it was found: its id, its folder in sysfs, and how surely it is the one that was meant."""

    id: str
    folder: Path
    strength: str
    actuate: bool = False

    def paths(self, kind: str) -> list[Path]:
        """Folders of its class devices (``hwmon``, ``block``, ``iio`` ...) in the order of its parts; may be empty.

        A part keeps its place in the order whatever number the kernel gives it: the first of two lines is the first.
        """
        with calllog.asking(self.id):
            return [calllog.Folder(path) for path in members(kind) if self._owns(path)]

    def path(self, kind: str) -> Path:
        """The first folder of a class; DeviceAbsent when the device has none now."""
        found = self.paths(kind)
        if not found:
            raise DeviceAbsent(self.id, f"{self.id} is there but has no {kind} device now; its driver may be missing")
        return found[0]

    def nodes(self, kind: str, prefix: str = "") -> list[str]:
        """Device nodes of a class whose names start with ``prefix``, below the system root: ``/dev/video0``."""
        found = [_node(path) for path in self.paths(kind) if path.name.startswith(prefix)]
        return [node for node in found if node]

    def node(self, kind: str, prefix: str = "") -> str:
        """The first of them; DeviceAbsent when there is none."""
        found = self.nodes(kind, prefix)
        if not found:
            raise DeviceAbsent(self.id, f"{self.id} is there but has no {kind} node now; its driver may be missing")
        return found[0]

    @contextmanager
    def bus(self, timeout: float = DEFAULT_TIMEOUT) -> Iterator["Device"]:
        """The device with its lock held: ``with runtime.device(id).bus() as unit:``. BusBusy after ``timeout`` s."""
        with bus(self, timeout):
            yield self

    def confirm(self) -> None:
        """For a tool that acts: DeviceAbsent when the device was plugged in elsewhere while the call waited."""
        if self.actuate and device(self.id, actuate=True).folder != self.folder:
            raise DeviceAbsent(self.id, f"{self.id} was plugged in elsewhere while the call waited; call again")

    def _owns(self, path: Path) -> bool:
        if path != self.folder and self.folder not in path.parents:
            return False
        while path != self.folder:
            if binding.is_unit(path) and not self._is_cell(path) and not self._same_product(path):
                return False
            path = path.parent
        return True

    def _is_cell(self, path: Path) -> bool:
        """A platform device below a USB or HID one serves a function of it."""
        return subsystem(path)[1] == "platform" and subsystem(self.folder)[1] in ("usb", "hid")

    def _same_product(self, path: Path) -> bool:
        """A HID device belongs to its transport unless it states that it is another product behind a receiver."""
        if subsystem(path)[1] != "hid" or subsystem(self.folder)[1] == "hid":
            return False
        return binding.vid_pid(self.folder) in ("", binding.vid_pid(path))


def device(device_id: str, actuate: bool = False) -> Device:
    """The device of this id as it is attached now.

    DeviceAbsent when it is not there; AmbiguousDevice when ``actuate`` is true and neither a serial number nor a place
    shows which unit is meant.
    """
    with calllog.asking(device_id):
        known = _instances()
        if known is None and actuate:
            raise AmbiguousDevice(device_id, _unknown_unit(device_id))
        found = None if actuate else in_place(device_id, known or {})
        found = found or bind(device_id, known or {}, actuate)
    return Device(device_id, calllog.Folder(found.folder), found.strength, actuate)


def _unknown_unit(device_id: str) -> str:
    return (
        f"which unit {device_id} is cannot be read on this machine, and what moves something is not guessed; "
        "run `octoform apply -replace probe`"
    )


def _node(path: Path) -> str:
    """The node of a class device; empty for one that has none, as most have."""
    name = uevent(path).get("DEVNAME", "").removeprefix("/dev/")
    node = sysroot() / "dev" / (name or path.name.replace("!", "/"))
    return str(node) if name or node.exists() else ""


def _instances() -> Mapping[str, Any] | None:
    """The instances file's devices, read again when it changed; empty where none is named, None for one without use."""
    place = os.environ.get("OCTOFORM_INSTANCES")
    if not place:
        return {}
    try:
        status = Path(place).stat()
        stamp = (status.st_mtime_ns, status.st_size, status.st_ino)
        before = _cache.get(place)
        if before is None or before[0] != stamp:
            found = read_json(Path(place))
            _cache[place] = before = (stamp, found["devices"] if fits(found, INSTANCES) else None)
        return before[1]
    except (OSError, ValueError):
        # A reader goes on by kind, which is right for most hosts; refusing every call would be worse.
        return None
