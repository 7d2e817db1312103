"""A camera rail without a rail: its firmware on the far end of a pseudo terminal that stands for the board's tty.

It keeps its own count of steps and its own bounds, and remembers each line that reached it, so that a test sees what
the hardware would have done and not what a server said. ``manner`` decides how it answers the next lines.
"""

import os
import pty
import re
import select
import threading
import tty
from pathlib import Path

HOST = "../rig/rail"
"""The board's text for ``plant``."""
DEVICE = "usb-2341-804f"
ANSWER = "the camera rail of the bench"
MOST, FARTHEST = 2000, 10000
HOT = 13
"""A move of so many steps is refused by the firmware."""
_MOVE = re.compile(r"MOVE_([XY]) (-?\d+)")


class Rail:
    """The firmware. ``manner``: well, mute (never answers), odd (answers nonsense), gone (unplugged by a line).

    ``jammed``: it refuses every move, and does not move.
    """

    def __init__(self) -> None:
        self.position = {"X": 0, "Y": 0}
        self.farthest = self.longest = 0
        self.lines: list[str] = []
        self.manner, self.jammed = "well", False

    def obey(self, line: str) -> str | None:
        """What it answers to a line; None for nothing. OSError when it is unplugged by it."""
        self.lines.append(line)
        if self.manner == "gone":
            raise OSError("unplugged")
        if self.manner == "mute":
            return None
        return "boot v3 \x1b[31m" if self.manner == "odd" else self._moved(line)

    def _moved(self, line: str) -> str:
        if line == "HOME":
            self.position = {"X": 0, "Y": 0}
            return "OK"
        found = _MOVE.fullmatch(line)
        if found is None:
            return "ERR unknown command"
        axis, steps = found[1], int(found[2])
        if steps == HOT or self.jammed:
            return "ERR motor driver is hot"
        self.position[axis] += steps
        self.farthest, self.longest = max(self.farthest, abs(self.position[axis])), max(self.longest, abs(steps))
        return "OK"


class Board:
    """The rail's board in a planted tree: ``plug`` makes its node, ``unplug`` takes the line away."""

    def __init__(self, tree: Path, rail: Rail) -> None:
        self.rail, self._node = rail, tree / "dev" / "ttyACM0"
        self._master = self._slave = -1
        self._thread = threading.Thread()
        self._over = threading.Event()

    def plug(self) -> None:
        """Connect it."""
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self._node.unlink(missing_ok=True)
        self._node.symlink_to(os.ttyname(self._slave))
        self._over.clear()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def say(self, line: str) -> None:
        """Send a line that nobody asked for."""
        os.write(self._master, f"{line}\n".encode())

    def unplug(self) -> None:
        """Take it away; harmless when it is gone."""
        self._over.set()
        self._thread.join()
        self._node.unlink(missing_ok=True)

    def _run(self) -> None:
        text = b""
        try:
            while not self._over.is_set():
                if not select.select([self._master], [], [], 0.05)[0]:
                    continue
                text += os.read(self._master, 1024)
                while b"\n" in text:
                    line, _, text = text.partition(b"\n")
                    if answer := self.rail.obey(line.decode("ascii")):
                        os.write(self._master, f"{answer}\n".encode())
        except OSError:
            self._node.unlink(missing_ok=True)  # it was unplugged by the line
        finally:
            os.close(self._slave)
            os.close(self._master)
