"""A USB bridge with four GPIO lines, spoken to through reports of the HID class as the real chip is."""

from dataclasses import dataclass

from vm.devices.hid import SPEAKS, HidDevice
from vm.devices.model import Identity

LINES = 4
BREAKOUT = Identity(0x04D8, 0x00DD, "Microchip Technology Inc.", "MCP2221 USB-I2C/UART Combo", "0001834429")
_SET_LINES, _GET_LINES = 0x50, 0x51
_SIZE = 64
# Sixty-four bytes of the maker's own in each direction.
_DESCRIPTION = bytes.fromhex("0600ff0901a1010901150026ff007508954081020902150026ff00750895409102c0")


@dataclass
class Breakout(HidDevice):
    """Lines that are inputs at first; ``outside`` is the level that something else gives to a line."""

    identity: Identity = BREAKOUT
    description: bytes = _DESCRIPTION

    def reset(self) -> None:
        """All lines are let go."""
        super().reset()
        self.driven: dict[int, int] = {}
        self.outside = dict.fromkeys(range(LINES), 0)
        self._latched = dict.fromkeys(range(LINES), 0)

    def level(self, line: int) -> int:
        """What a probe at the line would show."""
        return self.driven.get(line, self.outside[line])

    def receive(self, address: int, data: bytes) -> None:
        """A command, and its answer at once."""
        if data[:1] == bytes([_SET_LINES]):
            for line in range(LINES):
                self._set(line, *data[2 + 4 * line : 6 + 4 * line])
            answer = bytes([_SET_LINES, 0]) + data[2 : 2 + 4 * LINES]
        elif data[:1] == bytes([_GET_LINES]):
            answer = bytes([_GET_LINES, 0])
            for line in range(LINES):
                answer += bytes([self.level(line), line not in self.driven])
        else:
            answer = data[:1] + b"\0"
        self.send(SPEAKS, answer.ljust(_SIZE, b"\0"))

    def _set(self, line: int, with_level: int, level: int, with_direction: int, is_input: int) -> None:
        if with_level:
            self._latched[line] = level
        if with_direction and is_input:
            self.driven.pop(line, None)
        elif with_direction or line in self.driven:
            self.driven[line] = self._latched[line]
