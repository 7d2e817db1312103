"""What every generated server stands on: find a device, hold its lock, log the call. Standard library only.

Copied beside each server as the package ``runtime``, so it imports nothing of octoform and runs on Python 3.10. The
environment says where things are, and all of it is optional: OCTOFORM_INSTANCES (which specimen each device id is),
OCTOFORM_CALL_LOG (the call log; standard error without it), OCTOFORM_SYSROOT (the root of /sys, /proc and /dev).
"""

from .calllog import logged
from .devices import Device, device
from .faults import AmbiguousDevice, BusBusy, DeviceAbsent, DeviceFault, sentence
from .locks import Bus, bus
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
    "device",
    "files",
    "free_bytes",
    "logged",
    "mounts",
    "read_bits",
    "read_bytes",
    "read_first",
    "read_integer",
    "read_number",
    "read_text",
    "sentence",
    "sysroot",
]
