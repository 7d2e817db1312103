"""The packets of a half-duplex servo bus: what is a whole one, what is broken, and how an answer is written.

``FF FF id length instruction parameters... checksum``; length counts the parameters and two more, the checksum is the
inverted sum of all after the header. An answer has the error bits in place of the instruction.
"""

from dataclasses import dataclass

PING, READ, WRITE, LATER, ACTION, SYNC_READ, SYNC_WRITE = 0x01, 0x02, 0x03, 0x04, 0x05, 0x82, 0x83
EVERYBODY = 0xFE
VOLTAGE, ANGLE, OVERHEAT, OVERCURRENT, OVERLOAD = 0x01, 0x02, 0x04, 0x08, 0x20
"""Error bits of an answer."""
_HEADER = b"\xff\xff"


@dataclass(frozen=True)
class Packet:
    """A whole packet whose checksum is right."""

    number: int
    instruction: int
    parameters: bytes


def checksum(body: bytes) -> int:
    """Of all bytes between header and checksum."""
    return ~sum(body) & 0xFF


def packet(number: int, instruction: int, parameters: bytes = b"") -> bytes:
    """An instruction to a servo, or with error bits as the instruction its answer."""
    body = bytes([number, len(parameters) + 2, instruction]) + parameters
    return _HEADER + body + bytes([checksum(body)])


class Reader:
    """Finds the packets in what arrives, however it was cut.

    ``broken`` counts what was no packet: a wrong checksum, bytes before a header, a packet whose end did not come
    within ``patience`` seconds.
    """

    def __init__(self, patience: float) -> None:
        self.broken = 0
        self._patience, self._text, self._since = patience, b"", 0.0
        self._lost = False

    @property
    def waiting(self) -> bool:
        """Whether a packet has begun and not ended."""
        return bool(self._text)

    def clear(self) -> None:
        """Forget what has begun."""
        self._text = b""

    def read(self, data: bytes, now: float) -> list[Packet]:
        """The packets that are whole with ``data``, which arrived at ``now``."""
        if self._text and now - self._since > self._patience:
            self._lose(len(self._text))
        if data:
            self._text, self._since = self._text + data, now
        found = []
        while (one := self._next()) is not None:
            found.append(one)
        return found

    def _next(self) -> Packet | None:
        while self._text:
            start = self._text.find(_HEADER)
            if start < 0:
                start = len(self._text) - self._text.endswith(b"\xff")
            if start:
                self._lose(start)
                continue
            if len(self._text) < 4:
                return None
            number, length = self._text[2], self._text[3]
            if number == 0xFF or length < 2:
                self._lose(1)
                continue
            if len(self._text) < length + 4:
                return None
            body, given = self._text[2 : length + 3], self._text[length + 3]
            if checksum(body) != given:
                self._lose(2)
                continue
            self._text, self._lost = self._text[length + 4 :], False
            return Packet(number, body[2], body[3:])
        return None

    def _lose(self, count: int) -> None:
        """Drop bytes; what is lost in one go, up to the next good packet, counts once."""
        self._text = self._text[count:]
        self.broken += not self._lost
        self._lost = True
