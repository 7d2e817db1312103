"""The runtime library of every generated server: find a device, hold its lock, log the call. Standard library only.

How the kernel, a line and a bus are talked to is here as well, in modules of their own: `channels`, `counting`,
`evdev`, `gpio`, `lines`, `nmea`, `registers`, `units`, `v4l2`; `child` calls what needs a heavy library. What a device
may be asked to do is not: that is knowledge, and is in the server.

Copied beside each server as the package ``runtime``, so it imports nothing of octoform and runs on Python 3.10. Rules
that the core applies too lie in `base`: links to files of octoform's base, of which the copy gets the text. The
environment states where things are, and all of it is optional: OCTOFORM_INSTANCES (which unit each device id is),
OCTOFORM_CALL_LOG (the call log; standard error without it), OCTOFORM_STOPS (the folder that keeps which devices are
stopped; without it a stop ends with its process), OCTOFORM_SYSROOT (the root of /sys, /proc and /dev).
"""

from . import channels, child, counting, evdev, gpio, lines, nmea, registers, units, v4l2
from .calllog import logged
from .devices import Bus, Device, bus, device
from .faults import AmbiguousDevice, BusBusy, DeviceAbsent, DeviceFault, sentence
from .sysfs import (
    files,
    free_bytes,
    mounts,
    read_bits,
    read_bytes,
    read_first,
    read_integer,
    read_number,
    read_text,
    sysroot,
)

__all__ = [
    "AmbiguousDevice",
    "Bus",
    "BusBusy",
    "Device",
    "DeviceAbsent",
    "DeviceFault",
    "bus",
    "channels",
    "child",
    "counting",
    "device",
    "evdev",
    "files",
    "free_bytes",
    "gpio",
    "lines",
    "logged",
    "mounts",
    "nmea",
    "read_bits",
    "read_bytes",
    "read_first",
    "read_integer",
    "read_number",
    "read_text",
    "registers",
    "sentence",
    "sysroot",
    "units",
    "v4l2",
]
