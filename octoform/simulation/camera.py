"""A camera without a camera: a file that always holds a moment of moving pictures of the scene.

The file is YUV4MPEG2, which every video library opens, and is replaced as a whole: a reader sees the old one to its
end. A real camera's node can't be imitated without a kernel module, so this is a regular file where the node would be.

The noise of a camera's sensor: no two pictures of a real one are the same, whatever stands still before it.

Standard library alone, and well below a millisecond a picture: the noise is one long random text of small numbers, and
it is added to a picture from another place each time, as one big integer.
"""

import random
import threading
from pathlib import Path
from statistics import NormalDist

from octoform.simulation.scene import Planes, Scene

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
_LONGEST = 0.2
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
            new.replace(self._node)
            self.written += 1

    def _seen(self) -> Planes:
        wide, high = self._size
        if self.fault in ("black", "uniform"):
            level, quarter = 16 if self.fault == "black" else 120, bytes([128]) * (wide * high // 4)
            return bytes([level]) * (wide * high), quarter, quarter
        return self.scene.frame(wide, high)

    def _run(self) -> None:
        shown = self.scene.state()
        while not self._over.wait(_LONGEST / 2):
            state = self.scene.state()
            if state != shown or self._over.wait(_LONGEST / 2) is False:
                self.write()
            shown = state
