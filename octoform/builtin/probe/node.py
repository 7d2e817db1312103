"""One kernel device as a scan found it, before units are made of them."""

from dataclasses import dataclass, field


@dataclass(slots=True)
class Node:
    """A device folder of sysfs.

    ``path`` is absolute (``/sys/devices/...``), ``subsystem`` its bus or class. ``member`` says that it belongs to
    the nearest device above it (a class device, a USB interface) instead of being a unit. ``lines`` are the
    ``key, value`` facts about its kind; ``kind`` is the part of an id that tells this kind from others, ``title``
    what a person would call it. ``serial``, ``address``, ``size`` and ``attached``
    (``fixed`` or ``removable``, as the firmware says of the port) are facts of this one instance.
    """

    path: str
    subsystem: str
    member: bool
    lines: list[tuple[str, str]] = field(default_factory=list)
    kind: str = ""
    title: str = ""
    driver: str = ""
    modalias: str = ""
    devname: str = ""
    vid: str = ""
    pid: str = ""
    serial: str = ""
    address: str = ""
    size: int | None = None
    attached: str = ""

    @property
    def name(self) -> str:
        """The last part of the path, as the kernel calls it."""
        return self.path.rpartition("/")[2]

    def add(self, key: str, text: str) -> None:
        """One fact, left out when there is nothing to say."""
        if text:
            self.lines.append((key, text))
