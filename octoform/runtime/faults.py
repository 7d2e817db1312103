"""The faults of the room rather than of the code: a device that is gone, in doubt, or in use by another.

They have classes of their own because a watcher decides by the class what to do: an absent device is waited for,
a busy one is tried again, and only what is left over is a defect of the server.
"""

import errno
import grp
import stat
from pathlib import Path

_SAID = {
    errno.EACCES: "this user may not open it",
    errno.EPERM: "this user may not do that",
    errno.EBUSY: "another program is using it",
    errno.ENOENT: "it is not there",
    errno.ENODEV: "the device went away",
    errno.ENXIO: "the device went away",
    errno.ENOTTY: "it is no device of the expected kind",
    errno.EIO: "the device did not answer",
}


def sentence(problem: OSError) -> str:
    """An error of the operating system in words for a client: what it was about, and what a person can do."""
    text = _SAID.get(problem.errno or 0) or problem.strerror or str(problem)
    if not isinstance(problem.filename, str):
        return text
    if problem.errno == errno.EACCES:
        text += f"{_rights(problem.filename)}; `octoform doctor` shows what grants the use"
    return f"{problem.filename}: {text}"


def _rights(path: str) -> str:
    """Mode and group of a file, in parentheses; empty where the user cannot even see these."""
    try:
        status = Path(path).stat()
    except OSError:
        return ""
    try:
        group = grp.getgrgid(status.st_gid).gr_name
    except KeyError:
        group = str(status.st_gid)
    return f" (mode {stat.S_IMODE(status.st_mode):04o}, group {group})"


class DeviceFault(Exception):
    """Something about a device that a person or a client can act on; its text is meant for them."""

    def __init__(self, device: str, text: str) -> None:
        """``device`` is the id of the device or the name of the bus, ``text`` one sentence."""
        super().__init__(text)
        self.device = device


class DeviceAbsent(DeviceFault):
    """No device of this identity is there now, or it has no such part."""


class AmbiguousDevice(DeviceFault):
    """Two units could be meant and nothing distinguishes them; an actuator is never moved on a guess."""


class BusBusy(DeviceFault):
    """Another call, in this process or in another one, kept the bus for too long."""
