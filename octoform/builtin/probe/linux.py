"""PROBE on Linux: sysfs with the udev database, the texts beside it, paired devices, and the other side of WSL2."""

from octoform.builtin.probe import units, wsl
from octoform.builtin.probe.context import Context
from octoform.builtin.probe.paired import Paired
from octoform.builtin.probe.reader import Reader
from octoform.builtin.probe.scans import Scan
from octoform.builtin.probe.sysfs import Sysfs
from octoform.builtin.probe.udev import UdevDatabase
from octoform.builtin.probe.unit import Unit


class Linux:
    """All units of a Linux host; filled by the scans, read when they are over."""

    def __init__(self, reader: Reader) -> None:
        """``reader`` tells which buses and classes there are, and whether this is WSL2."""
        self._reader = reader
        self._udev = UdevDatabase()
        self._sysfs = Sysfs(self._udev)
        self._context, self._paired = Context(self._sysfs.nodes), Paired()
        self._windows = wsl.Windows() if wsl.is_here(reader) else None

    @property
    def platform(self) -> dict[str, str]:
        """System, version, architecture, kernel; on WSL2 marked, since no such system has run this yet."""
        known = self._context.platform
        return {**known, "verified": "recorded-only"} if self._windows else known

    @property
    def hostname(self) -> str:
        """The host's own name."""
        return self._context.hostname

    def scans(self) -> list[Scan]:
        """The udev database first, since devices are looked up in it; tools last."""
        sysfs = [Scan("udev:db", self._udev.scan), *self._sysfs.scans(self._reader.fresh())]
        beside = [*self._context.scans(), *self._paired.scans()]
        return [*sysfs, *beside, *(self._windows.scans() if self._windows else ())]

    def units(self) -> list[Unit]:
        """What the kernel shows, and what is merely near."""
        kernel = units.collect(dict(self._sysfs.nodes))
        near = [*self._context.units(), *self._paired.units()]
        return [*kernel, *near, *(self._windows.units() if self._windows else ())]
