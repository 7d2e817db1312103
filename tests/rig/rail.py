"""A camera rail without a rail: the simulated firmware behind a pseudo terminal that stands for the board's tty.

This one takes no time to move and refuses nothing for being too far: limits are the business of those in front of it.
It remembers each line that reached it, so that a test sees what the hardware would have done and not what a server
said.
"""

from pathlib import Path

from octoform.simulation.rail_firmware import LineDevice
from octoform.simulation.rig import Port

HOST = "../rig/rail"
"""The board's text for ``plant``."""
DEVICE = "usb-2341-804f"
ANSWER = "the camera rail of the bench"
MOST, FARTHEST = 2000, 10000
HOT = 13
"""A move of so many steps is refused by the firmware."""
_FIRMWARE = {
    "half_period": 0.0008,
    "speedup": float("inf"),
    "moves": {"MOVE_X": "X", "MOVE_Y": "Y"},
    "home": "HOME",
    "refuse": [HOT],
}


class Rail(LineDevice):
    """The firmware. ``manner``: well, mute (never answers), odd (answers nonsense), gone (unplugged by a line).

    ``jammed``: it refuses every move, and does not move.
    """

    def __init__(self) -> None:
        super().__init__(_FIRMWARE)

    @property
    def manner(self) -> str:
        return self.fault or "well"

    @manner.setter
    def manner(self, manner: str) -> None:
        self.fault = None if manner == "well" else manner

    @property
    def jammed(self) -> bool:
        return self.fault == "hot"

    @jammed.setter
    def jammed(self, jammed: bool) -> None:
        self.fault = "hot" if jammed else None

    def obey(self, line: str) -> str | None:
        """What it answers to a line; None for nothing. OSError when it is unplugged by it."""
        return self.feed(f"{line}\n".encode()).decode().rstrip("\n") or None


class Board:
    """The rail's board in a planted tree: ``plug`` makes its node, ``unplug`` takes the line away."""

    def __init__(self, tree: Path, rail: Rail) -> None:
        self.rail, self._node = rail, tree / "dev" / "ttyACM0"
        self._port: Port | None = None

    def plug(self) -> None:
        """Connect it."""
        self._port = Port(self.rail, self._node)
        self._port.start()

    def say(self, line: str) -> None:
        """Send an unsolicited line."""
        assert self._port is not None
        self._port.say(f"{line}\n".encode())

    def unplug(self) -> None:
        """Take it away; harmless when it is gone."""
        if self._port is not None:
            self._port.stop()
