"""Three serial boards as real ones present themselves: a CDC-ACM port and two adapter chips of their makers' own kind.

Each hands what it receives to a program, such as those of `octoform.simulation`, and sends back what that answers.
"""

import struct
import threading
import time
from dataclasses import dataclass
from typing import Protocol

from vm.devices.model import BULK, IN, INTERRUPT, Identity, Model, Request, endpoint, interface


class Program(Protocol):
    """What runs behind the port."""

    @property
    def baud(self) -> int | None:
        """The rate at which it understands; None for any."""
        ...

    @property
    def due(self) -> float | None:
        """When it has something to say unasked, by ``time.monotonic``; None for never."""
        ...

    def opened(self) -> None:
        """A host has the port open."""
        ...

    def closed(self) -> None:
        """No host has it open any more."""
        ...

    def garbled(self, data: bytes) -> None:
        """Bytes that came at a wrong rate."""
        ...

    def feed(self, data: bytes) -> bytes:
        """Bytes of the host in, all answers that are ready out."""
        ...


@dataclass(kw_only=True)
class SerialBoard(Model):
    """A board whose program speaks through endpoint ``reply_to`` in packets of ``packet_size``."""

    firmware: Program
    reply_to: int = 0x81
    packet_size: int = 64

    @property
    def baud(self) -> int | None:
        """The rate that the host set; None where it is not followed."""
        return None

    def receive(self, address: int, data: bytes) -> None:
        """What the host wrote goes to the program, its answer back in packets."""
        if self.baud is not None and self.firmware.baud not in (None, self.baud):
            self.firmware.garbled(data)
            return
        self._say(self.firmware.feed(data))

    def _say(self, answer: bytes) -> None:
        for start in range(0, len(answer), self.packet_size):
            self.send(self.reply_to, answer[start : start + self.packet_size])
        if (due := self.firmware.due) is not None:
            later = threading.Timer(max(0.0, due - time.monotonic()), self._unasked, (self.plugs,))
            later.daemon = True
            later.start()

    def _unasked(self, plugs: int) -> None:
        """The moment came to which the program's next words belong, unless the board was reset since."""
        with self.lock:
            if plugs == self.plugs:
                self._say(self.firmware.feed(b""))

    def reset(self) -> None:
        """With the bus, a port is closed and what was about to be said is lost."""
        super().reset()
        self.plugs = getattr(self, "plugs", 0) + 1
        self.firmware.closed()


@dataclass(kw_only=True)
class CdcAcm(SerialBoard):
    """A port of the communication class (`ttyACM`)."""

    kind: tuple[int, int, int] = (2, 0, 0)
    packet_size: int = 512

    def __post_init__(self) -> None:
        """9600 baud until the host sets another."""
        super().__post_init__()
        self.coding = struct.pack("<IBBB", 9600, 0, 0, 8)

    @property
    def baud(self) -> int | None:
        """The rate that the host set."""
        return int(struct.unpack_from("<I", self.coding)[0])

    def body(self) -> bytes:
        """A control and a data interface."""
        functional = bytes.fromhex("05240010010524010001042402020524060001")
        control = interface(0, 0, 1, (2, 2, 1)) + functional + endpoint(0x83, INTERRUPT, 16, 9)
        return control + interface(1, 0, 2, (10, 0, 0)) + endpoint(0x81, BULK, 512) + endpoint(0x02, BULK, 512)

    def request(self, request: Request) -> bytes | None:
        """Line coding is kept, the line that signals an open port is passed on, breaks are accepted."""
        if request.code == 0x20:
            self.coding = request.data
        elif request.code == 0x21:
            return self.coding
        elif request.code == 0x22:
            (self.firmware.opened if request.value & 1 else self.firmware.closed)()
        elif request.code != 0x23:
            return None
        return b""


@dataclass(kw_only=True)
class Ch340(SerialBoard):
    """An adapter chip without a serial number (`ttyUSB`), as on most development boards."""

    speed: str = "full"
    usb: int = 0x0110
    kind: tuple[int, int, int] = (0xFF, 0, 0)
    reply_to: int = 0x82
    packet_size: int = 32

    def __post_init__(self) -> None:
        """Registers hold nothing yet."""
        super().__post_init__()
        self.registers: dict[int, int] = {}

    def body(self) -> bytes:
        """One interface of the maker's own."""
        ends = endpoint(0x82, BULK, 32) + endpoint(0x02, BULK, 32) + endpoint(0x81, INTERRUPT, 8, 1)
        return interface(0, 0, 3, (0xFF, 1, 2)) + ends

    def request(self, request: Request) -> bytes | None:
        """Version, two registers at a time read or written, start and modem lines."""
        low, high = request.value & 255, request.value >> 8
        if request.code == 0x5F:
            return b"\x31\x00"
        if request.code == 0x95:
            return bytes([self.registers.get(low, 0xEE if low == 6 else 0), self.registers.get(high, 0)])
        if request.code == 0x9A:
            self.registers |= {low: request.index & 255, high: request.index >> 8}
        elif request.code not in (0xA1, 0xA4):
            return None
        return b""


@dataclass(kw_only=True)
class Cp2102(SerialBoard):
    """An adapter chip that reports its own name and a serial number (`ttyUSB`)."""

    speed: str = "full"
    usb: int = 0x0110

    def body(self) -> bytes:
        """One interface of the maker's own."""
        return interface(0, 0, 2, (0xFF, 0, 0)) + endpoint(0x81, BULK, 64) + endpoint(0x01, BULK, 64)

    def request(self, request: Request) -> bytes | None:
        """Its part number and plausible settings."""
        if not request.kind & IN:
            return b""
        if request.code == 0xFF:
            return b"\x02" if request.value == 0x370B else None
        baud = struct.pack("<I", 9600)
        fields = {0x04: b"\x00\x08", 0x08: b"\x00", 0x10: bytes(19), 0x14: bytes(16), 0x1D: baud}
        return fields.get(request.code, bytes(request.length))


SHARED_CHIP = Identity(0x1A86, 0x7523, "", "USB Serial", release=0x0264)
NAMED_CHIP = Identity(0x10C4, 0xEA60, "Silicon Labs", "CP2102 USB to UART Bridge Controller", "0071C1A9")
