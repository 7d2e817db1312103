"""A USB headset of the audio class 1: its microphone hears one steady tone, its speaker keeps what was played."""

import math
import struct
from dataclasses import dataclass

from vm.devices.model import ENDPOINT, IN, Identity, Model, Request, interface

RATE = 16_000
TONE = 440
_MICROPHONE, _SPEAKER = 0x81, 0x02
_MUTE = 1
_CURRENT, _LOWEST, _HIGHEST, _STEP = 0x81, 0x82, 0x83, 0x84
_UNITS = (
    *("0c2402010102000100000000", "092403020101000500"),  # microphone 1, to the host 2 by way of volume 5
    *("0c2402030101000100000000", "092403040103000600"),  # from the host 3, to the speaker 4 by way of volume 6
    *("092406050101030000", "092406060301030000"),  # the volumes: mute and loudness
)


HEADSET = Identity(0x0D8C, 0x0014, "C-Media Electronics Inc.", "USB Audio Device")


@dataclass
class Headset(Model):
    """16-bit mono at 16 kHz in both directions."""

    identity: Identity = HEADSET
    speed: str = "full"
    usb: int = 0x0110

    def __post_init__(self) -> None:
        """Nothing was played yet."""
        super().__post_init__()
        self.played = bytearray()
        self._heard = 0

    def body(self) -> bytes:
        """A control interface and a stream in each direction."""
        units = b"".join(bytes.fromhex(unit) for unit in _UNITS)
        head = struct.pack("<BBBHHBBB", 10, 0x24, 1, 0x0100, 10 + len(units), 2, 1, 2)
        control = interface(0, 0, 0, (1, 1, 0)) + head + units
        return control + _stream(1, 2, _MICROPHONE) + _stream(2, 3, _SPEAKER)

    def request(self, request: Request) -> bytes | None:
        """Mute and volume of both units."""
        if not request.kind & IN:
            return b""
        if request.kind & 31 != 1 or request.index >> 8 not in (5, 6):
            return None
        if request.value >> 8 == _MUTE:
            return b"\x00"
        fields = {_CURRENT: 0, _LOWEST: -0x1900, _HIGHEST: 0, _STEP: 0x0100}
        return struct.pack("<h", fields[request.code]) if request.code in fields else None

    def packet(self, address: int) -> bytes:
        """A millisecond of the tone."""
        count = RATE // 1000
        turn = 2 * math.pi * TONE / RATE
        samples = [int(12_000 * math.sin(turn * (self._heard + number))) for number in range(count)]
        self._heard += count
        return struct.pack(f"<{count}h", *samples)

    def receive(self, address: int, data: bytes) -> None:
        """What the host plays is kept."""
        self.played += data


def _stream(number: int, terminal: int, address: int) -> bytes:
    """An interface that is silent in its first setting and streams in its second."""
    silent, streaming = interface(number, 0, 0, (1, 2, 0)), interface(number, 1, 1, (1, 2, 0))
    form = bytes([7, 0x24, 1, terminal, 1, 1, 0]) + bytes.fromhex("0b24020101021001") + RATE.to_bytes(3, "little")
    kind = 0x05 if address & IN else 0x09
    end = bytes([9, ENDPOINT, address, kind]) + struct.pack("<HBBB", RATE // 1000 * 2, 1, 0, 0)
    return silent + streaming + form + end + bytes.fromhex("07250100000000")
