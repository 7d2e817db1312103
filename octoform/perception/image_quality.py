"""What a picture says of its camera: whether it shows anything, is a new one, and differs from another.

Pure functions on a few figures and a small grey thumbnail. Every pixel of the thumbnail is the mean of a hundred or
more of the picture's, so noise is small in it, and what moved is not.
"""

from dataclasses import dataclass
from itertools import compress
from operator import mul
from typing import Literal

from octoform.endpoint.client.check_verdict import UNIFORM_SPREAD

Complaint = Literal["black", "uniform"]
WIDTH, HEIGHT = 64, 48
THUMB_BYTES = WIDTH * HEIGHT
BLACK_MEAN = 16.0
"""The level of black in studio video (ITU-R BT.601: 16 of 255): what is darker on average has no light."""
BLACK_SPREAD = 6.0
"""A dark room with one lit lamp has more (1 % of the picture at 100 gives 10), noise of a covered sensor less."""
CHANGED = 3.0
"""A difference from which on something changed: 1 % of the picture by 30 levels. Noise of a camera gives below 1."""
GRAIN = 0.2
"""The part of all pixels with fine structure from which on a picture carries the noise of a sensor.

Drawn patterns, screens of text and bars of colour have less; a sensor's picture has more, also after a JPEG coder.
"""
FROZEN_PICTURES = 4
FROZEN_SECONDS = 5.0
"""So many pictures without a different pixel, over so long at least, prove that the source gives an old one again."""
_FIT_PART = 0.75
_GAINS = (0.5, 2.0)


@dataclass(frozen=True, slots=True)
class Picture:
    """Brightness of a picture (mean and standard deviation, 0..255) and ``thumb``: 48 rows of 64 grey bytes.

    ``pixels`` is a digest of all pixels at full size (empty: not known), ``grain`` the part of them, 0..1, that is off
    the line between its neighbours both across and down.
    """

    mean: float
    spread: float
    thumb: bytes
    pixels: str = ""
    grain: float = 0.0


def complaint(picture: Picture) -> Complaint | None:
    """``black`` or ``uniform`` for a picture that shows nothing, None for one that shows something."""
    if picture.mean < BLACK_MEAN and picture.spread < BLACK_SPREAD:
        return "black"
    return "uniform" if picture.spread < UNIFORM_SPREAD else None


def repeated(a: Picture, b: Picture) -> bool:
    """True when no pixel differs. That alone proves nothing: a drawn pattern or a screen has no noise."""
    return a.pixels == b.pixels != ""


def noisy(picture: Picture) -> bool:
    """True when the picture carries noise as a sensor's does, so that a later one of the same source must differ."""
    return picture.grain >= GRAIN


def frozen(picture: Picture, repeats: int, seconds: float) -> bool | None:
    """Whether the source stands still, when ``repeats`` pictures before this one, over ``seconds``, had its pixels.

    False for a picture with new pixels. None where it cannot be told: too few pictures, too close together, or a
    source without noise, whose scene may just stand still.
    """
    if not repeats:
        return False
    proven = noisy(picture) and repeats + 1 >= FROZEN_PICTURES and seconds >= FROZEN_SECONDS
    return True if proven else None


def difference(a: Picture, b: Picture) -> float:
    """How far two pictures differ, in levels of 0..255 (root mean square over the thumbnails); 0.0 for the same.

    Light that grew or fell over the whole picture (a cloud, the camera's own exposure) is taken out first.
    """
    return round((_residual(a.thumb, b.thumb) + _residual(b.thumb, a.thumb)) / 2, 2)


def _residual(a: bytes, b: bytes) -> float:
    """What remains of ``b`` when ``a``, made brighter or darker as fits best, is taken from it."""
    gain, offset = _fit(a, b)
    # What moved must not pull the fit: it is made once more with the pixels that fit it best.
    gaps = [abs(new - gain * old - offset) for old, new in zip(a, b, strict=True)]
    limit = sorted(gaps)[int(len(gaps) * _FIT_PART)]
    near = [gap <= limit for gap in gaps]
    gain, offset = _fit(bytes(compress(a, near)), bytes(compress(b, near)))
    expected = [min(255.0, max(0.0, gain * level + offset)) for level in range(256)]
    squares = sum((new - expected[old]) ** 2 for old, new in zip(a, b, strict=True))
    return float((squares / len(b)) ** 0.5)


def _fit(a: bytes, b: bytes) -> tuple[float, float]:
    """Gain and offset of the least squares; the gain bounded, since a picture of something else is no brighter one."""
    count, sum_a, sum_b = len(a), sum(a), sum(b)
    variance = count * sum(map(mul, a, a)) - sum_a * sum_a
    together = count * sum(map(mul, a, b)) - sum_a * sum_b
    gain = min(_GAINS[1], max(_GAINS[0], together / variance)) if variance else 1.0
    return gain, (sum_b - gain * sum_a) / count
