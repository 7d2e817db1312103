"""The noise of a camera's sensor: no two pictures of a real one are the same, whatever stands still before it.

Standard library alone, and well below a millisecond a picture: the noise is one long random text of small numbers, and
it is added to a picture from another place each time, as one big integer.
"""

import random
from statistics import NormalDist

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
