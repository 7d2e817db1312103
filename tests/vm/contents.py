"""What a picture shows and what a recording sounds like, found out without the libraries that made them."""

import io
import itertools
import struct
import wave
import zlib
from dataclasses import dataclass
from operator import sub

_CLEARLY = 32
_SIGNATURE = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True)
class Picture:
    """A decoded picture; ``rows`` hold red, green and blue, one byte each."""

    width: int
    height: int
    rows: list[bytes]

    def at(self, across: float, down: float) -> tuple[int, int, int]:
        """The colour at a place, as parts of the width and the height."""
        start = 3 * int(across * self.width)
        red, green, blue = self.rows[int(down * self.height)][start : start + 3]
        return red, green, blue


def picture(data: bytes) -> Picture:
    """Decode a PNG of 8 bits and three colours."""
    assert data[:8] == _SIGNATURE, "not a PNG"
    chunks, place = [], 8
    while place < len(data):
        length, kind = struct.unpack_from(">I4s", data, place)
        chunks.append((kind, data[place + 8 : place + 8 + length]))
        place += 12 + length
    width, height, depth, colours = struct.unpack_from(">IIBB", dict(chunks)[b"IHDR"])
    assert (depth, colours) == (8, 2), "not three colours of 8 bits"
    packed = zlib.decompress(b"".join(part for kind, part in chunks if kind == b"IDAT"))
    rows, above = [], bytes(3 * width)
    for start in range(0, len(packed), 3 * width + 1):
        above = _unfiltered(packed[start], bytearray(packed[start + 1 : start + 1 + 3 * width]), above)
        rows.append(above)
    return Picture(width, height, rows)


def difference(one: Picture, other: Picture, rows: tuple[float, float] = (0.0, 1.0)) -> float:
    """How many points have clearly another colour, of those in ``rows``: parts of the height, from above."""
    assert (one.width, one.height) == (other.width, other.height)
    meant = slice(*(int(part * one.height) for part in rows))
    changed: int = sum(
        max(map(abs, map(sub, before[place : place + 3], after[place : place + 3]))) > _CLEARLY
        for before, after in zip(one.rows[meant], other.rows[meant], strict=True)
        for place in range(0, 3 * one.width, 3)
    )
    return changed / (one.width * len(one.rows[meant]))


def _unfiltered(kind: int, row: bytearray, above: bytes) -> bytes:
    """A row of a PNG as it was before its filter (the PNG specification, section 9)."""
    for place in range(len(row)):
        left, corner = (row[place - 3], above[place - 3]) if place >= 3 else (0, 0)
        guesses = (0, left, above[place], (left + above[place]) // 2)
        guess = guesses[kind] if kind < 4 else _nearest(left, above[place], corner)
        row[place] = (row[place] + guess) & 255
    return bytes(row)


def _nearest(left: int, above: int, corner: int) -> int:
    estimate = left + above - corner
    return min((left, above, corner), key=lambda value: abs(estimate - value))


def pitch(data: bytes) -> tuple[float, float]:
    """Frequency in Hz by the times at which the sound crosses zero, and its peak as a part of full scale."""
    with wave.open(io.BytesIO(data)) as file:
        rate, count = file.getframerate(), file.getnframes()
        samples = struct.unpack(f"<{count * file.getnchannels()}h", file.readframes(count))[:: file.getnchannels()]
    rising = [
        number - after / (after - before)
        for number, (before, after) in enumerate(itertools.pairwise(samples), 1)
        if before < 0 <= after
    ]
    assert len(rising) > 10, "hardly any sound"
    return rate * (len(rising) - 1) / (rising[-1] - rising[0]), max(map(abs, samples)) / 32768
