"""Serial lines for the tests: pseudo terminals whose other end a test reads, and a host that has them as devices."""

import json
import os
import pty
import select
import time
import tty
from pathlib import Path

STOP = "fffffe0403280fd2"


class Line:
    """A pseudo terminal: ``node`` is what a program opens, the device end stays with the test."""

    def __init__(self) -> None:
        self.device, self._slave = pty.openpty()
        self.node = os.ttyname(self._slave)
        self.links: list[Path] = []
        tty.setraw(self._slave)

    def received(self, count: int, seconds: float = 5.0) -> bytes:
        """What came to the device: waits for ``count`` bytes, then takes all that is there."""
        data, deadline = b"", time.monotonic() + seconds
        while select.select([self.device], [], [], 0.0 if len(data) >= count else deadline - time.monotonic())[0]:
            data += os.read(self.device, 65536)
        return data

    def fill(self) -> int:
        """Write until the line takes no more, as of a device that reads nothing; the number of bytes."""
        line, count = os.open(self.node, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY), 0
        try:
            for size in (4096, 1):
                # The kernel moves bytes on by itself for a while: it is full when nothing more went for some time.
                while select.select([], [line], [], 0.1)[1]:
                    try:
                        count += os.write(line, b"x" * size)
                    except BlockingIOError:
                        break
            return count
        finally:
            os.close(line)

    def unplug(self) -> None:
        """Take the device end away; its nodes go with it, or the next pseudo terminal of anybody would stand there."""
        for link in self.links:
            link.unlink()
        os.close(self.device)
        os.close(self._slave)
        self.device = -1

    def close(self) -> None:
        if self.device >= 0:
            self.unplug()


def plant(root: Path, lines: dict[str, Line]) -> tuple[Path, Path]:
    """The system root of a host that has these lines as USB serial devices (ids ``usb-<vid>-<pid>``), and its
    instances file."""
    system, instances = root / "system", {}
    for number, (name, line) in enumerate(lines.items(), 1):
        unit = system / f"sys/devices/usb1/1-{number}"
        member = unit / f"tty/ttyACM{number}"
        member.mkdir(parents=True)
        for path, kind, listing in ((unit, "bus/usb", "bus/usb/devices"), (member, "class/tty", "class/tty")):
            (system / "sys" / listing).mkdir(parents=True, exist_ok=True)
            (path / "subsystem").symlink_to(system / "sys" / kind)
            (system / "sys" / listing / path.name).symlink_to(path)
        _, vendor, product = name.split("-")
        (unit / "idVendor").write_text(f"{vendor}\n")
        (unit / "idProduct").write_text(f"{product}\n")
        (member / "uevent").write_text(f"DEVNAME=ttyACM{number}\n")
        (system / "dev").mkdir(exist_ok=True)
        line.links.append(system / f"dev/ttyACM{number}")
        line.links[-1].symlink_to(line.node)
        instances[name] = {"sysfs": f"/sys/devices/usb1/1-{number}", "port": f"1-{number}", "strength": "positional"}
    (root / "instances.json").write_text(json.dumps({"format": 1, "devices": instances}))
    return system, root / "instances.json"


def host(root: Path, lines: dict[str, Line]) -> Path:
    """An endpoint's folder on such a host, with a stop action for every line."""
    system, _ = plant(root, lines)
    folder = root / "endpoint"
    folder.mkdir()
    stop = [{"device": name, "class": "tty", "baud": 115200, "write": STOP, "source": "profile arm"} for name in lines]
    policy = {"format": 1, "mode": "enforce", "tools": {}, "stop": stop}
    (folder / "policy.json").write_text(json.dumps(policy))
    connection = {"environment": {"OCTOFORM_SYSROOT": str(system)}, "server": {"path": "/nowhere/server.py"}}
    (folder / "connection.json").write_text(json.dumps(connection))
    return folder
