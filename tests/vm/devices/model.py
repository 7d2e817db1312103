"""A USB device as a program: its descriptors, its answers to control requests, and the data of its endpoints.

A model knows nothing of how it is attached; `vm.usb_redir` carries it to a port of the emulated host, where the
kernel's own drivers bind to it. What all devices share is here; `serial`, `camera` and `headset` hold the classes.
"""

import struct
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

CONTROL, ISOCHRONOUS, BULK, INTERRUPT = range(4)
IN = 0x80
DEVICE, CONFIGURATION, STRING, INTERFACE, ENDPOINT, QUALIFIER = range(1, 7)
_GET_STATUS, _CLEAR_FEATURE, _SET_FEATURE = 0, 1, 3
_GET_DESCRIPTOR, _GET_CONFIGURATION, _SET_CONFIGURATION, _GET_INTERFACE, _SET_INTERFACE = 6, 8, 9, 10, 11
_STANDARD, _TO_ENDPOINT = 0x60, 31


@dataclass(frozen=True)
class Request:
    """A control request as the host sends it; ``data`` is what it brings along."""

    kind: int
    code: int
    value: int
    index: int
    length: int
    data: bytes = b""

    @property
    def reads(self) -> bool:
        """True when the host wants bytes."""
        return bool(self.kind & IN)


@dataclass(frozen=True)
class EndpointFacts:
    """One endpoint of the settings in force."""

    address: int
    kind: int
    packet: int
    interval: int
    interface: int


@dataclass(frozen=True)
class Identity:
    """The strings of a device; an empty string is not sent at all."""

    vendor: int
    product: int
    maker: str = ""
    name: str = ""
    serial: str = ""
    release: int = 0x0100


def endpoint(address: int, kind: int, packet: int, interval: int = 0, extra: bytes = b"") -> bytes:
    """An endpoint descriptor."""
    return bytes([7 + len(extra), ENDPOINT, address, kind]) + struct.pack("<HB", packet, interval) + extra


def interface(number: int, setting: int, endpoints: int, kind: tuple[int, int, int]) -> bytes:
    """An interface descriptor; ``kind`` is class, subclass and protocol."""
    return bytes([9, INTERFACE, number, setting, endpoints, *kind, 0])


@dataclass
class Model:
    """A device on a port. Subclasses give ``body``, answer class requests in ``request`` and move data."""

    identity: Identity
    speed: str = "high"
    kind: tuple[int, int, int] = (0, 0, 0)
    usb: int = 0x0200
    lock: threading.RLock = field(default_factory=threading.RLock)
    ready: Callable[[int], None] = lambda address: None
    """Called with an IN endpoint that may have something to say; the carrier sets it."""

    def __post_init__(self) -> None:
        """A device that was just given power."""
        self.reset()

    def reset(self) -> None:
        """What a bus reset does."""
        self.configuration = 0
        self.settings: dict[int, int] = {}
        self.halted: set[int] = set()
        self.waiting: dict[int, list[bytes]] = {}

    # -- descriptors

    def body(self) -> bytes:
        """All descriptors below the configuration."""
        raise NotImplementedError

    def strings(self) -> dict[int, str]:
        """The device's strings by their number."""
        named = self.identity
        return {number: text for number, text in enumerate((named.maker, named.name, named.serial), 1) if text}

    def descriptors(self) -> Iterator[bytes]:
        """The body's descriptors one by one."""
        rest = self.body()
        while rest:
            yield rest[: rest[0]]
            rest = rest[rest[0] :]

    def interfaces(self) -> tuple[list[tuple[int, int, int, int]], list[EndpointFacts]]:
        """Number, class, subclass and protocol of the interfaces in their present settings, and their endpoints."""
        found, endpoints, current = [], [], None
        for item in self.descriptors():
            if item[1] == INTERFACE:
                current = item[2] if item[3] == self.settings.get(item[2], 0) else None
                if current is not None:
                    found.append((item[2], item[5], item[6], item[7]))
            elif item[1] == ENDPOINT and current is not None:
                packet = struct.unpack_from("<H", item, 4)[0]
                endpoints.append(EndpointFacts(item[2], item[3] & 3, packet, item[6], current))
        return found, endpoints

    def _device(self) -> bytes:
        named, found = self.identity, self.strings()
        numbers = [number if number in found else 0 for number in (1, 2, 3)]
        head = struct.pack("<BBHBBBB", 18, DEVICE, self.usb, *self.kind, 64)
        return head + struct.pack("<HHHBBBB", named.vendor, named.product, named.release, *numbers, 1)

    def _configuration(self) -> bytes:
        body = self.body()
        count = len({item[2] for item in self.descriptors() if item[1] == INTERFACE})
        return struct.pack("<BBHBBBBB", 9, CONFIGURATION, 9 + len(body), count, 1, 0, 0x80, 50) + body

    def _string(self, number: int) -> bytes | None:
        if number == 0:
            return b"\x04\x03\x09\x04"  # American English is all that it speaks
        text = self.strings().get(number)
        return None if text is None else bytes([2 + 2 * len(text), STRING]) + text.encode("utf-16-le")

    def _descriptor(self, request: Request) -> bytes | None:
        kind, number = request.value >> 8, request.value & 255
        if kind == DEVICE:
            return self._device()
        if kind == CONFIGURATION:
            return self._configuration()
        if kind == STRING:
            return self._string(number)
        if kind == QUALIFIER and self.speed == "high":
            return struct.pack("<BBHBBBBBB", 10, QUALIFIER, self.usb, *self.kind, 64, 1, 0)
        return self.descriptor(kind, request)

    # -- control requests

    def control(self, request: Request) -> bytes | None:
        """The bytes of the answer; None refuses the request."""
        answer = self.request(request) if request.kind & _STANDARD else self._standard(request)
        return answer[: request.length] if answer is not None and request.reads else answer

    def _standard(self, request: Request) -> bytes | None:
        if request.code == _GET_DESCRIPTOR:
            return self._descriptor(request)
        if request.code == _GET_STATUS:
            return struct.pack("<H", request.kind & _TO_ENDPOINT == 2 and request.index in self.halted)
        if request.code == _GET_CONFIGURATION:
            return bytes([self.configuration])
        if request.code == _GET_INTERFACE:
            return bytes([self.settings.get(request.index, 0)])
        if request.code == _SET_CONFIGURATION:
            self.configure(request.value)
        elif request.code == _SET_INTERFACE:
            self.settings[request.index] = request.value
        elif request.code == _CLEAR_FEATURE and request.kind & _TO_ENDPOINT == 2:
            self.halted.discard(request.index)
            self.cleared(request.index)
        elif request.code not in (_CLEAR_FEATURE, _SET_FEATURE):
            return None
        return b""

    def configure(self, number: int) -> None:
        """The host chose a configuration."""
        self.configuration, self.settings = number, {}

    def descriptor(self, kind: int, request: Request) -> bytes | None:
        """A descriptor of the device's own class."""
        return None

    def request(self, request: Request) -> bytes | None:
        """A request of the device's class or maker."""
        return None

    def cleared(self, address: int) -> None:
        """The host cleared an endpoint's halt."""

    # -- data

    def receive(self, address: int, data: bytes) -> None:
        """Bytes of the host to an OUT endpoint."""

    def send(self, address: int, data: bytes) -> None:
        """Queue bytes for an IN endpoint."""
        with self.lock:
            self.waiting.setdefault(address, []).append(data)
        self.ready(address)

    def take(self, address: int, length: int) -> bytes | None:
        """Bytes for one IN transfer, or None while there are none."""
        queue = self.waiting.get(address)
        if not queue:
            return None
        head, rest = queue[0][:length], queue[0][length:]
        queue[:1] = [rest] if rest else []
        return head

    def packet(self, address: int) -> bytes:
        """The next packet of an isochronous IN endpoint, one each millisecond."""
        return b""
