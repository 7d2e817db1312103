"""Report what a picture looks like: mean and spread of its brightness, and a grey thumbnail of it.

A camera that is covered, dead or still warming up answers with a valid picture of one colour; no schema sees that. As
a program it reads ``{"pictures": [base64, ...]}`` from its input and prints ``{"pictures": [{"bytes", "width",
"height", "mean", "spread", "thumb", "pixels", "grain"}, ...]}``: brightness in 0..255, ``thumb`` the base64 of 48
rows of 64 grey bytes, ``pixels`` a digest of all grey pixels, ``grain`` the part of them that is off the line between
its neighbours both across and down (the noise of a sensor puts most of them off, a drawn picture only corners); all but
``bytes`` are null for what cannot be read. Runs in the serving environment, with what libraries it has.
"""

import base64
import hashlib
import io
import json
import struct
import sys
import zlib
from typing import Any, NamedTuple

PNG = b"\x89PNG\r\n\x1a\n"
CHANNELS = {0: 1, 2: 3, 4: 2, 6: 4}
COLOURED = (2, 6)
JPEG, JPEG_END = b"\xff\xd8", b"\xff\xd9"
MAX_PIXELS = 1_000_000
WIDTH, HEIGHT = 64, 48
NOT_MIDDLE = [0 if level == 128 else 255 for level in range(256)]


class Seen(NamedTuple):
    """Size in pixels, brightness in 0..255, ``thumb``: HEIGHT rows of WIDTH grey bytes; digest and grain (0..1)."""

    width: int
    height: int
    mean: float
    spread: float
    thumb: bytes
    pixels: str
    grain: float


def figures(data: str) -> dict[str, Any]:
    """``{"bytes", "mean", "spread"}`` of a picture in base64; mean and spread are null for what cannot be read."""
    raw = base64.b64decode(data)
    seen = decoded(raw)
    return {"bytes": len(raw), "mean": seen.mean if seen else None, "spread": seen.spread if seen else None}


def description(data: str) -> dict[str, Any]:
    """All that the module's docstring lists of a picture in base64."""
    raw = base64.b64decode(data)
    seen = decoded(raw)
    if seen is None:
        return {"bytes": len(raw), **dict.fromkeys(Seen._fields)}
    return {"bytes": len(raw), **seen._asdict(), "thumb": base64.b64encode(seen.thumb).decode()}


def decoded(raw: bytes) -> Seen | None:
    """The figures of a picture, by the first way that can read it; None where it is broken or none can."""
    if raw.startswith(JPEG) and not raw.rstrip(b"\0").endswith(JPEG_END):
        return None  # cut off: a library may paint what is missing grey
    return by_pillow(raw) or by_opencv(raw) or by_hand(raw)


def by_pillow(raw: bytes) -> Seen | None:
    """By Pillow, where the serving environment has it."""
    try:
        from PIL import Image, ImageChops, ImageFilter, ImageStat
    except ImportError:
        return None
    try:
        with Image.open(io.BytesIO(raw)) as picture:
            grey = picture.convert("L")
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):  # all that a broken file may give
        return None
    stat = ImageStat.Stat(grey)
    thumb = grey.resize((WIDTH, HEIGHT), Image.Resampling.BOX).tobytes()
    inner = (1, 1, max(2, grey.width - 1), max(2, grey.height - 1))
    across, down = (
        grey.filter(ImageFilter.Kernel((3, 3), kernel, scale=1, offset=128)).crop(inner).point(NOT_MIDDLE)
        for kernel in ((0, 0, 0, -1, 2, -1, 0, 0, 0), (0, -1, 0, 0, 2, 0, 0, -1, 0))
    )
    off = ImageChops.darker(across, down).histogram()
    grain = round(off[255] / sum(off), 3)
    figures = (round(stat.mean[0], 1), round(stat.stddev[0], 1))
    return Seen(grey.width, grey.height, *figures, thumb, digest(grey.tobytes()), grain)


def by_opencv(raw: bytes) -> Seen | None:
    """By OpenCV, where the serving environment has it."""
    try:
        import cv2
        import numpy
    except ImportError:
        return None
    grey = cv2.imdecode(numpy.frombuffer(raw, numpy.uint8), cv2.IMREAD_GRAYSCALE) if raw else None
    if grey is None:
        return None
    height, width = grey.shape
    thumb = cv2.resize(grey, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA).tobytes()
    wide = grey.astype(numpy.int16)
    across = 2 * wide[1:-1, 1:-1] != wide[1:-1, :-2] + wide[1:-1, 2:]
    down = 2 * wide[1:-1, 1:-1] != wide[:-2, 1:-1] + wide[2:, 1:-1]
    grain = round(float((across & down).mean()), 3) if across.size else 0.0
    figures = (round(float(grey.mean()), 1), round(float(grey.std()), 1))
    return Seen(width, height, *figures, thumb, digest(grey.tobytes()), grain)


def by_hand(raw: bytes) -> Seen | None:
    """A plain 8-bit PNG with the standard library alone."""
    if not raw.startswith(PNG):
        return None
    try:
        width, height, grey = png_grey(raw)
    except (struct.error, zlib.error, KeyError, IndexError, ValueError):
        return None
    if not grey or len(grey) != width * height:
        return None
    mean = sum(grey) / len(grey)
    variance = sum((value - mean) ** 2 for value in grey) / len(grey)
    figures = (round(mean, 1), round(variance**0.5, 1))
    return Seen(width, height, *figures, shrunk(grey, width, height), digest(grey), grain_of(grey, width))


def digest(grey: bytes) -> str:
    """A digest of all pixels: two pictures with the same one have no different pixel."""
    return hashlib.sha256(grey).hexdigest()


def grain_of(grey: bytes, width: int) -> float:
    """The part of the inner pixels, 0..1, that is off the line between its neighbours both across and down."""
    rows = [grey[start : start + width] for start in range(0, len(grey), width)]
    off = inner = 0
    for above, row, below in zip(rows, rows[1:], rows[2:], strict=False):
        around = zip(row, row[1:], row[2:], above[1:], below[1:], strict=False)
        off += sum(2 * at != left + right and 2 * at != up + down for left, at, right, up, down in around)
        inner += max(0, width - 2)
    return round(off / inner, 3) if inner else 0.0


def shrunk(grey: bytes, width: int, height: int) -> bytes:
    """The thumbnail of a grey picture: each of its pixels is the mean of those that it stands for."""
    columns = [(x * width // WIDTH, max((x + 1) * width // WIDTH, x * width // WIDTH + 1)) for x in range(WIDTH)]
    out = bytearray()
    for y in range(HEIGHT):
        first, last = y * height // HEIGHT, max((y + 1) * height // HEIGHT, y * height // HEIGHT + 1)
        rows = [grey[row * width : (row + 1) * width] for row in range(first, last)]
        for left, right in columns:
            out.append(sum(sum(row[left:right]) for row in rows) // ((right - left) * len(rows)))
    return bytes(out)


def png_grey(raw: bytes) -> tuple[int, int, bytes]:
    """Width, height and the brightness of all pixels; ValueError for depths and layouts that are not read here."""
    width, height, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", raw[16:29])
    if depth != 8 or interlaced or width * height > MAX_PIXELS:
        raise ValueError("not a plain 8-bit picture")
    size = CHANNELS[colour]
    packed, at = b"", 8
    while at < len(raw):
        (length,) = struct.unpack(">I", raw[at : at + 4])
        if raw[at + 4 : at + 8] == b"IDAT":
            packed += raw[at + 8 : at + 8 + length]
        at += 12 + length
    stride = width * size
    lines = zlib.decompressobj().decompress(packed, height * (stride + 1))
    above, out = bytes(stride), bytearray()
    for start in range(0, height * (stride + 1), stride + 1):
        above = unfiltered(lines[start], lines[start + 1 : start + 1 + stride], above, size)
        out += brightness(above, size) if colour in COLOURED else above[::size]
    return width, height, bytes(out)


def brightness(line: bytes, size: int) -> bytes:
    """The luma of a line of coloured pixels (weights of ITU-R BT.601)."""
    pixels = zip(line[::size], line[1::size], line[2::size], strict=True)
    return bytes((299 * red + 587 * green + 114 * blue + 500) // 1000 for red, green, blue in pixels)


def unfiltered(kind: int, line: bytes, above: bytes, size: int) -> bytes:
    """A line with its PNG filter undone."""
    out = bytearray(line)
    for index, value in enumerate(line):
        left = out[index - size] if index >= size else 0
        up = above[index]
        corner = above[index - size] if index >= size else 0
        guess = (0, left, up, (left + up) // 2, nearest(left, up, corner))[kind]
        out[index] = (value + guess) & 255
    return bytes(out)


def nearest(left: int, up: int, corner: int) -> int:
    """The PNG predictor of Paeth."""
    guess = left + up - corner
    return min((left, up, corner), key=lambda value: abs(guess - value))


def main() -> None:
    """Read the pictures, print what they look like."""
    given = json.load(sys.stdin)["pictures"]
    json.dump({"pictures": [description(data) for data in given]}, sys.stdout)


if __name__ == "__main__":
    main()
