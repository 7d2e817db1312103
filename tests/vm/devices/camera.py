"""A UVC webcam whose picture is known: eight upright bars of full colours, and one dark field in the lower right.

The field breaks the symmetry: a picture that was mirrored, turned or read with swapped colours is distinguished from a
right one.
"""

import struct
import threading
import time
from dataclasses import dataclass

from vm.devices.model import BULK, Identity, Model, Request, endpoint, interface

SIZES = ((320, 240), (160, 120), (640, 480))
BARS = (
    (235, 128, 128),
    (210, 16, 146),
    (170, 166, 16),
    (145, 54, 34),
    (106, 202, 222),
    (81, 90, 240),
    (41, 240, 110),
    (16, 128, 128),
)
"""Y, U and V of white, yellow, cyan, green, magenta, red, blue and black."""
COLOURS = (
    (255, 255, 255),
    (255, 255, 0),
    (0, 255, 255),
    (0, 255, 0),
    (255, 0, 255),
    (255, 0, 0),
    (0, 0, 255),
    (0, 0, 0),
)
"""The same bars in red, green and blue."""
_YUYV = bytes.fromhex("5955593200001000800000aa00389b71")
_PAYLOAD = 16384  # the driver takes at most 32 packets of 512 bytes for a request
_SET, _CURRENT, _LOWEST, _HIGHEST, _STEP, _LENGTH, _INFO, _DEFAULT = 1, 0x81, 0x82, 0x83, 0x84, 0x85, 0x86, 0x87
_PROBE, _COMMIT, _BRIGHTNESS = 1, 2, 2
_CONTROL, _STREAM = 0, 1


WEBCAM = Identity(0x045E, 0x0772, "Microsoft", "Microsoft LifeCam Studio(TM)")


@dataclass
class Camera(Model):
    """A UVC 1.0 camera with a bulk endpoint and a brightness control."""

    identity: Identity = WEBCAM
    kind: tuple[int, int, int] = (0xEF, 2, 1)
    rate: int = 10

    def __post_init__(self) -> None:
        """Nothing streams yet."""
        super().__post_init__()
        self.brightness, self._pictures, self._due = 128, 0, 0.0
        self._timer: threading.Timer | None = None
        self._negotiated = self._settle(1)

    def body(self) -> bytes:
        """A control interface with camera, processing unit and output, and a stream of uncompressed frames."""
        units = _CAMERA_TERMINAL + _PROCESSING_UNIT + _OUTPUT_TERMINAL
        head = struct.pack("<BBBHHIBB", 13, 0x24, 1, 0x0100, 13 + len(units), 48_000_000, 1, 1)
        formats = self._formats()
        stream = struct.pack("<BBBBHBBBBBBBB", 14, 0x24, 1, 1, 14 + len(formats), 0x81, 0, 3, 0, 0, 0, 1, 0)
        control = interface(0, 0, 0, (0x0E, 1, 0)) + head + units
        streaming = interface(1, 0, 1, (0x0E, 2, 0)) + stream + formats + endpoint(0x81, BULK, 512)
        return _TOGETHER + control + streaming

    def _formats(self) -> bytes:
        interval, frames = 10_000_000 // self.rate, b""
        for number, (width, height) in enumerate(SIZES, 1):
            bits = width * height * 16 * self.rate
            sizes = struct.pack("<HHIII", width, height, bits, bits, width * height * 2)
            frames += bytes([30, 0x24, 5, number, 0]) + sizes + struct.pack("<IBI", interval, 1, interval)
        head = bytes([27, 0x24, 4, 1, len(SIZES)]) + _YUYV + bytes([16, 1, 0, 0, 0, 0])
        return head + frames + b"\x06\x24\x0d\x01\x01\x04"

    def _settle(self, frame: int, interval: int = 0) -> bytes:
        """The stream's settings for a wished frame size."""
        frame = frame if 1 <= frame <= len(SIZES) else 1
        self.width, self.height = SIZES[frame - 1]
        size = self.width * self.height * 2
        chosen = struct.pack("<HBBI", 1, 1, frame, interval or 10_000_000 // self.rate)
        return chosen + bytes(10) + struct.pack("<II", size, _PAYLOAD)

    def request(self, request: Request) -> bytes | None:
        """Negotiation of the stream, and brightness."""
        part, unit, selector = request.index & 255, request.index >> 8, request.value >> 8
        if part == _STREAM and selector in (_PROBE, _COMMIT):
            return self._stream(request, selector)
        if part == _CONTROL and unit == 2 and selector == _BRIGHTNESS:
            return self._bright(request)
        if (part, unit, selector, request.code) == (_CONTROL, 0, 2, _CURRENT):
            return b"\x00"  # no error to report
        return None

    def _stream(self, request: Request, selector: int) -> bytes:
        if request.code == _SET:
            self._negotiated = self._settle(request.data[3], struct.unpack_from("<I", request.data, 4)[0])
            if selector == _COMMIT:
                self.cleared(0x81)
            return b""
        return {_LENGTH: b"\x1a\x00", _INFO: b"\x03"}.get(request.code, self._negotiated)

    def _bright(self, request: Request) -> bytes | None:
        if request.code == _SET:
            self.brightness = struct.unpack("<h", request.data[:2])[0]
            return b""
        fields = {_CURRENT: self.brightness, _LOWEST: 0, _HIGHEST: 255, _STEP: 1, _DEFAULT: 128}
        if request.code in fields:
            return struct.pack("<h", fields[request.code])
        return {_LENGTH: b"\x02\x00", _INFO: b"\x03"}.get(request.code)

    def picture(self) -> bytes:
        """One frame in YUYV."""
        half = self.width // 2
        bars = [self._pixel_pair(BARS[position * 8 // half]) for position in range(half)]
        dark = self._pixel_pair(BARS[7])
        lower = [*bars[: half * 3 // 4], *[dark] * (half - half * 3 // 4)]
        top = self.height // 2
        # The dark field hides the last two bars in the lower half.
        return b"".join(bars) * top + b"".join(lower) * (self.height - top)

    def _pixel_pair(self, colour: tuple[int, int, int]) -> bytes:
        light, blue, red = colour
        shown = max(0, min(255, light + self.brightness - 128))
        return bytes([shown, blue, shown, red])

    def take(self, address: int, length: int) -> bytes | None:
        """Bytes of the present frame; the next begins when its time has come."""
        if not self.waiting.get(address):
            now = time.monotonic()
            if now < self._due:
                self._wake(address, self._due - now)
                return None
            self._due = max(self._due + 1 / self.rate, now)
            self.waiting[address] = self._payloads()
        return super().take(address, length)

    def _wake(self, address: int, seconds: float) -> None:
        if self._timer is None or not self._timer.is_alive():
            self._timer = threading.Timer(seconds, lambda: self.ready(address))
            self._timer.daemon = True
            self._timer.start()

    def _payloads(self) -> list[bytes]:
        """A frame cut into payloads, each with its header: the frame's parity, and which one is the last."""
        self._pictures += 1
        picture, step = self.picture(), _PAYLOAD - 2
        starts = range(0, len(picture), step)
        flags = 0x80 | self._pictures & 1
        return [
            bytes([2, flags | (2 if start == starts[-1] else 0)]) + picture[start : start + step] for start in starts
        ]

    def cleared(self, address: int) -> None:
        """The stream begins anew."""
        self.waiting, self._due = {}, 0.0


_TOGETHER = bytes.fromhex("080b00020e030000")
_CAMERA_TERMINAL = bytes.fromhex("1124020101020000000000000000020000")
_PROCESSING_UNIT = bytes.fromhex("0b24050201000002010000")
_OUTPUT_TERMINAL = bytes.fromhex("092403030101000200")
