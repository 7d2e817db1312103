"""The scene of the camera: the bench, the arm on it, and a clock; the camera rides on the rail, so all shifts with it.

The bench is a pattern that repeats nowhere: each place of the rail has a picture of its own. Standard library alone,
and a frame in a few milliseconds: rows are slices of one big picture, and a stroke is a row of discs.
"""

import math
import random
import threading
import time
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from statistics import NormalDist

from octoform.base.clock import Clock
from octoform.base.files import publish
from octoform.simulation.rail_firmware import LineDevice
from octoform.simulation.servos import ServoBus

Planes = tuple[bytes, bytes, bytes]
Colour = tuple[int, int, int]
"""Luma, blue and red difference."""
_STEPS_A_WIDTH = 12800
"""So many steps of the rail shift the picture by its own width."""
_FARTHEST = 10000
_ARM: tuple[Colour, ...] = ((60, 128, 128), (200, 60, 160), (225, 70, 140), (190, 90, 170))
_JAW: Colour = (235, 128, 128)
_DARK: Colour = (25, 128, 128)
_DIGITS = {
    letter: tuple(int(row) for row in rows)
    for letter, rows in zip(
        "0123456789:.",
        ["75557", "26227", "71747", "71717", "55711", "74717", "74757", "71111", "75757", "75717", "02020", "00002"],
        strict=True,
    )
}
"""Five rows of three dots, each row an octal digit."""


class Scene:
    """``now`` gives the time of day that the clock shows, in seconds since 1970."""

    def __init__(self, arm: ServoBus | None, rail: LineDevice | None, now: Clock = time.time) -> None:
        self._arm, self._rail, self._now = arm, rail, now

    def state(self) -> tuple[object, ...]:
        """The content of a frame without the clock: equal when nothing has moved."""
        arm = () if self._arm is None else tuple(round(place) for place in self._arm.positions().values())
        return (arm, None if self._rail is None else tuple(self._rail.position.values()))

    def frame(self, width: int, height: int) -> Planes:
        """Luma and the two colour planes of half its size, row by row; width and height are even."""
        right, up = self._carriage(width)
        canvas = _Canvas.of(_bench(width, height), (right, -up))
        if self._arm is not None:
            self._draw_arm(canvas, self._arm, right, up)
        _draw_clock(canvas, self._now())
        return bytes(canvas.luma), bytes(canvas.blue), bytes(canvas.red)

    def _carriage(self, width: int) -> tuple[int, int]:
        """How far the camera has gone to the right and up, in pixels; even, as the colours have half the size."""
        if self._rail is None:
            return 0, 0
        place = self._rail.position
        right, up = (
            round(max(-_FARTHEST, min(_FARTHEST, place[axis])) * width / _STEPS_A_WIDTH / 2) * 2 for axis in ("X", "Y")
        )
        return right, up

    @staticmethod
    def _draw_arm(canvas: "_Canvas", arm: ServoBus, right: int, up: int) -> None:
        places, scale = arm.positions(), canvas.width * 1.1
        base = (canvas.width * 0.42 - right, canvas.height * 0.8 + up)
        seen = [
            (base[0] + scale * (x + 0.45 * y), base[1] - scale * (z + 0.3 * y))
            for x, y, z in arm.linkage.points(places)
        ]
        thick = canvas.width / 45
        canvas.disc(base, thick * 2.5, _ARM[0])
        for number, (start, end) in enumerate(pairwise(seen)):
            canvas.stroke(start, end, thick, _ARM[min(number, len(_ARM) - 1)])
        for place in seen[1:]:
            canvas.disc(place, thick * 0.7, _DARK)
        given = arm.linkage.given
        if "grip" in given and len(seen) > 2:
            roll = arm.linkage.angle(places[given["roll"]])
            open_by = math.radians(30) + arm.linkage.angle(places[given["grip"]]) / 4
            _draw_jaws(canvas, (seen[-2], seen[-1]), roll, open_by)


@dataclass
class _Canvas:
    width: int
    height: int
    luma: bytearray
    blue: bytearray
    red: bytearray

    @classmethod
    def of(cls, bench: "_Bench", shift: tuple[int, int]) -> "_Canvas":
        """The bench as it is seen by a camera that has gone so many pixels to the right and down."""
        planes = [bench.cut(number, shift) for number in range(3)]
        return cls(bench.width, bench.height, *planes)

    def disc(self, centre: tuple[float, float], radius: float, colour: Colour) -> None:
        """A filled disc; what lies outside of the picture is omitted."""
        self._spans(self.luma, (centre[0], centre[1], radius), self.width, colour[0])
        half = (centre[0] / 2, centre[1] / 2, radius / 2)
        self._spans(self.blue, half, self.width // 2, colour[1])
        self._spans(self.red, half, self.width // 2, colour[2])

    def stroke(self, start: tuple[float, float], end: tuple[float, float], radius: float, colour: Colour) -> None:
        """A thick line with round ends."""
        way = math.dist(start, end)
        parts = max(1, math.ceil(way / max(1.0, radius * 0.6)))
        for part in range(parts + 1):
            at = part / parts
            self.disc((start[0] + (end[0] - start[0]) * at, start[1] + (end[1] - start[1]) * at), radius, colour)

    def box(self, left: int, top: int, size: tuple[int, int], colour: Colour) -> None:
        """A filled rectangle, all even."""
        for plane, part, level in ((self.luma, 1, colour[0]), (self.blue, 2, colour[1]), (self.red, 2, colour[2])):
            line, wide = bytes([level]) * (size[0] // part), self.width // part
            for y in range(top // part, (top + size[1]) // part):
                plane[y * wide + left // part : y * wide + left // part + len(line)] = line

    @staticmethod
    def _spans(plane: bytearray, disc: tuple[float, float, float], wide: int, level: int) -> None:
        x, y, high = int(disc[0]), int(disc[1]), len(plane) // wide
        for row, half in enumerate(_halves(disc[2]), y - int(disc[2])):
            left, right = x - half, x + half + 1
            if 0 <= row < high and right > 0 and left < wide:
                left, right = (left if left > 0 else 0), (right if right < wide else wide)
                plane[row * wide + left : row * wide + right] = bytes((level,)) * (right - left)


@lru_cache(maxsize=64)
def _halves(radius: float) -> list[int]:
    """Half the width of a disc, row by row."""
    whole = int(radius)
    return [int(math.sqrt(radius * radius - row * row)) for row in range(-whole, whole + 1)]


@dataclass(frozen=True)
class _Bench:
    width: int
    height: int
    margin: int
    planes: Planes

    def cut(self, number: int, shift: tuple[int, int]) -> bytearray:
        """One plane of the picture that is seen with the camera shifted to the right and down."""
        part = 2 if number else 1
        wide, plane = (self.width + 2 * self.margin) // part, self.planes[number]
        left, top = (self.margin + shift[0]) // part, (self.margin + shift[1]) // part
        first, count = top * wide + left, self.width // part
        rows = range(first, first + self.height // part * wide, wide)
        return bytearray(b"".join([plane[row : row + count] for row in rows]))


@lru_cache(maxsize=4)
def _bench(width: int, height: int) -> _Bench:
    """All that the camera could see of the bench, made once for a size."""
    dice, margin = random.Random(7), math.ceil(_FARTHEST * width / _STEPS_A_WIDTH / 2) * 2 + 2
    wide, high = width + 2 * margin, height + 2 * margin
    cell = max(2, width // 40 * 2)
    planes = [bytearray(), bytearray(), bytearray()]
    for top in range(0, high, cell):
        rows = min(cell, high - top)
        levels = [
            (dice.randint(70, 170), dice.randint(120, 132), dice.randint(126, 138)) for _ in range(wide // cell + 1)
        ]
        for number, plane in enumerate(planes):
            part = 2 if number else 1
            line = b"".join(bytes([level[number]]) * (cell // part) for level in levels)[: wide // part]
            plane += line * (rows // part)
    return _Bench(width, height, margin, (bytes(planes[0]), bytes(planes[1]), bytes(planes[2])))


def _draw_jaws(
    canvas: _Canvas, hand: tuple[tuple[float, float], tuple[float, float]], roll: float, open_by: float
) -> None:
    """Two fingers at the end of the hand, as far apart as the grip is open and turned with the wrist."""
    (x, y), (end_x, end_y) = hand
    way = math.dist(*hand) or 1.0
    along = ((end_x - x) / way, (end_y - y) / way)
    across = (-along[1] * math.cos(roll) + 0.5 * math.sin(roll), along[0] * math.cos(roll) - 0.4 * math.sin(roll))
    long, thick = canvas.width / 13, canvas.width / 110
    for side in (-1, 1):
        spread, ahead = side * math.sin(open_by), math.cos(open_by)
        tip = tuple(at + long * (ahead * along[i] + spread * across[i]) for i, at in enumerate((end_x, end_y)))
        canvas.stroke((end_x, end_y), (tip[0], tip[1]), thick, _JAW)


def _draw_clock(canvas: _Canvas, now: float) -> None:
    """Hours to tenths of a second in the upper left corner, so that no two pictures are the same."""
    dot = max(2, canvas.width // 320)
    text = f"{time.strftime('%H:%M:%S', time.gmtime(now))}.{int(now * 10) % 10}"
    top = dot
    canvas.box(dot, top, ((4 * len(text) + 1) * dot, 7 * dot), _DARK)
    for number, letter in enumerate(text):
        for row, bits in enumerate(_DIGITS[letter]):
            for column in range(3):
                if bits >> (2 - column) & 1:
                    left = dot + (4 * number + column + 1) * dot
                    canvas.box(left, top + (row + 1) * dot, (dot, dot), _JAW)


# A camera without a camera: a file that always holds a moment of moving pictures of the scene.
#
# The file is YUV4MPEG2, which every video library opens, and is replaced as a whole: a reader sees the old one to its
# end. A real camera's node can't be imitated without a kernel module, so this is a regular file where the node would
# be.
#
# The noise of a camera's sensor: no two pictures of a real one are the same, whatever stands still before it.
#
# Standard library alone, and well below a millisecond a picture: the noise is one long random text of small numbers,
# and it is added to a picture from another place each time, as one big integer.

SIGMA = 2.5
"""Standard deviation of the noise in levels, as of a webcam in a room."""
_BIAS = 6
"""The noise is 0 to twice this, so that it never goes below black; a sensor's black level does the same."""
_SPARE = 65536
_QUANTILES = bytes(
    round(min(2.0 * _BIAS, max(0.0, NormalDist(_BIAS, SIGMA).inv_cdf((byte + 0.5) / 256)))) for byte in range(256)
)


class Sensor:
    """Noise for pictures of any size; ``seed`` makes it the same in every run."""

    def __init__(self, seed: int = 1) -> None:
        self._dice = random.Random(seed)
        self._noise = b""

    def exposed(self, luma: bytes) -> bytes:
        """The picture with new noise on it, brighter by six levels; what would be above 255 is 255."""
        if len(self._noise) < len(luma) + _SPARE:
            self._noise = self._dice.randbytes(len(luma) + _SPARE).translate(_QUANTILES)
        place = self._dice.randrange(len(self._noise) - len(luma))
        noise = self._noise[place : place + len(luma)]
        # Bytes are added as digits of one number: none of them may carry into the next.
        bounded = luma.translate(_BELOW)
        total = int.from_bytes(bounded, "big") + int.from_bytes(noise, "big")
        return total.to_bytes(len(luma), "big")


_BELOW = bytes(min(level, 255 - 2 * _BIAS) for level in range(256))


FAULTS = ("black", "uniform", "frozen")
_MAX_SECONDS = 0.2
"""Seconds that a picture is kept although nothing moves: the clock in it goes on."""


class Camera:
    """``fault`` is None or one of FAULTS; ``written`` counts how often the file was replaced."""

    def __init__(self, scene: Scene, node: Path, size: tuple[int, int], frames: int = 16) -> None:
        self.scene, self._node, self._size, self._frames = scene, node, size, frames
        self.fault: str | None = None
        self.written = 0
        self._sensor = Sensor()
        self._writing = threading.Lock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name=node.name, daemon=True)

    def start(self) -> None:
        """The file is there when this returns."""
        self._node.parent.mkdir(parents=True, exist_ok=True)
        self.write()
        self._thread.start()

    def stop(self) -> None:
        """Take the file away."""
        self._over.set()
        self._thread.join()
        self._node.unlink(missing_ok=True)

    def write(self) -> None:
        """Replace the file by what is seen now."""
        if self.fault == "frozen" and self.written:
            return
        with self._writing:  # a fault is shown at once, beside the camera's own rhythm
            wide, high = self._size
            luma, blue, red = self._seen()
            dead = self.fault in ("black", "uniform")
            new = self._node.with_name(f".{self._node.name}.new")
            with new.open("wb") as out:
                out.write(f"YUV4MPEG2 W{wide} H{high} F30:1 Ip A1:1 C420jpeg\n".encode())
                for _ in range(self._frames):
                    out.writelines((b"FRAME\n", luma if dead else self._sensor.exposed(luma), blue, red))
            publish(new, self._node)
            self.written += 1

    def _seen(self) -> Planes:
        wide, high = self._size
        if self.fault in ("black", "uniform"):
            level, quarter = 16 if self.fault == "black" else 120, bytes([128]) * (wide * high // 4)
            return bytes([level]) * (wide * high), quarter, quarter
        return self.scene.frame(wide, high)

    def _run(self) -> None:
        shown = self.scene.state()
        while not self._over.wait(_MAX_SECONDS / 2):
            state = self.scene.state()
            if state != shown or self._over.wait(_MAX_SECONDS / 2) is False:
                self.write()
            shown = state
