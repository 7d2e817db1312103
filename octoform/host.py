"""Shows whether the hardware of a host is still what it was when PROBE last ran, cheaply enough for every plan.

The kernel announces each device with a modalias line and groups what drivers make of them in classes; the sorted
multiset of those lines and class counts is the fingerprint. Only text files of sysfs are read. What comes and goes
without any hardware (loop devices, virtual networks, pseudo terminals, wake-up sources, devices made by programs,
bluetooth connections, partitions) is omitted, so that a plan does not see changes that are none.

Only Linux announces hardware in files. Elsewhere (macOS) system and architecture are all there is, and a plan sees no
device come or go; under WSL2 the devices count that the Linux kernel has, not those of the Windows side.

On the path of a plan with nothing to do: imports the standard library and the digest only, opens a few hundred small
files on a laptop.
"""

import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from octoform.base.digest import of_bytes
from octoform.records import dataclass

SYSROOT_VARIABLE = "OCTOFORM_SYSROOT"
MODALIAS_BYTES = 1024
# Buses that hold parts of the running system instead of devices.
_SOFTWARE_BUSES = frozenset(
    (
        *("clockevents", "clocksource", "container", "cpu", "edac", "event_source", "faux", "genpd", "logicmodule"),
        *("machinecheck", "memory", "memory_tiering", "node", "nvmem", "pci_express", "snd_seq", "usb-serial"),
        *("workqueue", "auxiliary", "mdio_bus", "serial-base", "media", "cec", "dax"),
    )
)
# On these no device is ever made by a program, so that the place of each need not be looked up.
_PHYSICAL_BUSES = frozenset(("acpi", "pci", "platform", "pnp", "scsi", "serio", "usb", "mmc", "sdio", "spi", "amba"))
# Class -> what the names of its whole devices begin with: a sound card has many parts, a disk its partitions.
_CLASSES: Mapping[str, str] = {
    **{name: "" for name in ("backlight", "hwmon", "leds", "mtd", "net", "power_supply", "powercap", "printer")},
    **{name: "" for name in ("ptp", "rc", "rtc", "thermal", "tpm", "tty", "usbmisc", "video4linux", "watchdog")},
    "bluetooth": "hci",
    "drm": "card",
    "gpio": "gpiochip",
    "input": "input",
    "nvme": "nvme",
    "pwm": "pwmchip",
    "sound": "card",
    "typec": "port",
}
# Without a bus above them and yet hardware: the kernel itself makes these for what the firmware measures.
_PHYSICAL_VIRTUAL = frozenset(("hwmon", "powercap", "thermal"))
_VIRTUAL = "/devices/virtual/"


@dataclass(frozen=True, slots=True)
class Fingerprint:
    """``entries``: sorted modalias lines and ``class:<class>:<count>`` lines; ``digest`` covers all three others."""

    digest: str
    os: str
    arch: str
    entries: tuple[str, ...]


def root_from_environment(environ: Mapping[str, str]) -> Path:
    """The folder that holds the host's sys and proc: ``/`` unless ``OCTOFORM_SYSROOT`` names a recorded host."""
    return Path(environ.get(SYSROOT_VARIABLE) or "/")


def fingerprint(root: Path) -> Fingerprint:
    """The fingerprint of the host below ``root``; a host without sysfs has one with no entries."""
    base = str(root).rstrip("/")
    entries = tuple(sorted([*_modaliases(base), *_class_counts(base)]))
    system, arch = _platform(base)
    digest = of_bytes("\n".join((system, arch, *entries)).encode("utf-8", "surrogateescape"))
    return Fingerprint(digest, system, arch, entries)


def difference(before: Sequence[str], after: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """(appeared, gone) between two fingerprints' entries, as sorted multisets: two of a kind count twice."""
    old, new = Counter(before), Counter(after)
    return tuple(sorted((new - old).elements())), tuple(sorted((old - new).elements()))


def _modaliases(base: str) -> Iterator[str]:
    for bus in _names(f"{base}/sys/bus"):
        if bus in _SOFTWARE_BUSES:
            continue
        with _folder(f"{base}/sys/bus/{bus}/devices") as (folder, names):
            for name in names:
                if bus in _PHYSICAL_BUSES or not _is_virtual(name, folder):
                    text = _text(f"{name}/modalias", folder)
                    if text:
                        yield text


def _class_counts(base: str) -> Iterator[str]:
    counted = [(name, f"{base}/sys/class/{name}", start) for name, start in _CLASSES.items()]
    counted += [("block", f"{base}/sys/block", ""), ("iio", f"{base}/sys/bus/iio/devices", "iio:device")]
    for name, path, start in counted:
        with _folder(path) as (folder, names):
            # A bluetooth connection is called hci0:12, beside its adapter.
            whole = [entry for entry in names if entry.startswith(start) and not (name == "bluetooth" and ":" in entry)]
            count = sum(name in _PHYSICAL_VIRTUAL or not _is_virtual(entry, folder) for entry in whole)
        if count:
            yield f"class:{name}:{count}"


@contextmanager
def _folder(path: str) -> Iterator[tuple[int, list[str]]]:
    """A folder held open and its names, so that what is in it is found without walking down to it each time."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError:  # a bus or class that this host does not have announces nothing
        yield -1, []
        return
    try:
        yield descriptor, _names(descriptor)
    finally:
        os.close(descriptor)


def _is_virtual(name: str, folder: int) -> bool:
    try:
        return _VIRTUAL in os.readlink(name, dir_fd=folder)
    except OSError:  # no link (a control file of the class) or gone since it was listed: no device either way
        return True


def _names(folder: str | int) -> list[str]:
    try:
        with os.scandir(folder) as entries:
            return [entry.name for entry in entries]
    except OSError:  # gone or closed to this user: announces nothing
        return []


def _text(path: str, folder: int | None = None) -> str:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK, dir_fd=folder)
    except OSError:  # most devices of some buses have no modalias
        return ""
    try:
        found = os.read(descriptor, MODALIAS_BYTES)
    except OSError:  # an attribute that cannot be read announces nothing
        return ""
    finally:
        os.close(descriptor)
    return found.decode("utf-8", "backslashreplace").partition("\n")[0].strip()


def _platform(base: str) -> tuple[str, str]:
    """(os, architecture): of the running kernel, or of the recorded tree; ``unknown`` where it does not."""
    if not base:
        name = os.uname()
        return name.sysname.lower(), name.machine
    version = _text(f"{base}/proc/version")
    system = version.split(" ", 1)[0].lower() if version else "linux" if _names(f"{base}/sys") else "unknown"
    return system, _text(f"{base}/proc/sys/kernel/arch") or "unknown"


# Whether the system still takes in what was plugged: drivers are loaded after the kernel announced a device. (Light.)
#
# A look at the hardware in between sees half of it, and then another change. udev shows by a
# file whether it has something to do (libudev, udev_queue_get_udev_is_active). While a driver speaks with its new
# device udev has nothing to do either, so only a second without work counts.

UDEV, QUEUE = "run/udev", "run/udev/queue"
SETTLE_SECONDS, QUIET_SECONDS = 10.0, 1.0
_PAUSE = 0.1


def settle(root: Path, pause: Callable[[float], object] = time.sleep) -> bool:
    """Wait until udev has had nothing to do for QUIET_SECONDS, at most SETTLE_SECONDS; whether that is so.

    Where there is no udev nothing is waited for.
    """
    quiet = 0
    for _ in range(round(SETTLE_SECONDS / _PAUSE)):
        quiet = 0 if (root / QUEUE).exists() else quiet + 1
        if quiet > QUIET_SECONDS / _PAUSE or not (root / UDEV).is_dir():
            return True
        pause(_PAUSE)
    return False
