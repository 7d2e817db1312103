"""The capabilities that a Video4Linux2 node reports (linux/videodev2.h). Every call belongs under the device's lock."""

import errno
import fcntl
import os
import re
import stat
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_ENUM_FMT, _ENUM_FRAMESIZES = 0xC0405602, 0xC02C564A
_MAX_ENTRIES = 64
CAPTURED = (1, 9)
"""Queues that give pictures: as a whole, in planes."""
TAKEN = (2, 10)
"""Queues that take pictures."""
_QUERY_CTRL, _GET_CTRL, _SET_CTRL = 0xC0445624, 0xC008561B, 0xC008561C
FOCUS = 0x009A090A
"""The control for the way of a lens (V4L2_CID_FOCUS_ABSOLUTE)."""


def is_node(node: str) -> bool:
    """Whether it is a node of the kernel, which could be opened; OSError gives the reason where a library is silent.

    False for a file of pictures in the place of a camera: that one is read like any other video.
    """
    if not stat.S_ISCHR(Path(node).stat().st_mode):
        return False
    os.close(os.open(node, os.O_RDWR | os.O_NONBLOCK))
    return True


def formats(node: str) -> list[dict[str, Any]]:
    """The formats that a camera gives: ``pixel_format``, ``description``, ``compressed``, ``sizes``.

    Of a file of pictures in the place of a camera it is the one of the file; OSError for what is no camera.
    """
    found: list[dict[str, Any]] = []
    with Path(node).open("rb", 0) as camera:
        for flags, words, code in _formats(camera, CAPTURED):
            answers = _answers(camera, _ENUM_FRAMESIZES, code)
            sizes = [_size(*struct.unpack_from("=8x6I", answer)) for answer in answers]
            names = {"pixel_format": _text(code), "description": _text(words)}
            found.append({**names, "compressed": bool(flags & 1), "sizes": sizes})
    return found or _film(node)


def codes(node: str, queues: tuple[int, ...]) -> list[str]:
    """The pixel formats of a node's queues of these kinds."""
    with Path(node).open("rb", 0) as codec:
        return [_text(code) for _, _, code in _formats(codec, queues)] or _nothing(node)


def control(node: str, number: int) -> tuple[int, int, int]:
    """(lowest, highest, present) value of a control of a node or of a part of a camera; OSError where it has none."""
    with Path(node).open("rb", 0) as part:
        found = fcntl.ioctl(part, _QUERY_CTRL, _whole(_QUERY_CTRL, struct.pack("=I", number)))
        _, value = struct.unpack("=Ii", fcntl.ioctl(part, _GET_CTRL, struct.pack("=Ii", number, 0)))
    low, high = struct.unpack_from("=40x2i", found)
    return low, high, value


def set_control(node: str, number: int, value: int) -> None:
    """Set a control; OSError where the node has none or takes no such value."""
    with Path(node).open("r+b", 0) as part:
        fcntl.ioctl(part, _SET_CTRL, struct.pack("=Ii", number, value))


def _film(node: str) -> list[dict[str, Any]]:
    """The format of a file of the kind YUV4MPEG2 by its first line, such as ``YUV4MPEG2 W640 H480 F30:1``."""
    if stat.S_ISREG(Path(node).stat().st_mode):
        with Path(node).open("rb", 0) as film:
            if head := re.match(rb"YUV4MPEG2 (?:\S+ )*?W(\d+) H(\d+)", film.read(128)):
                size = f"{int(head[1])}x{int(head[2])}"
                names = {"pixel_format": "I420", "description": "pictures of a file"}
                return [{**names, "compressed": False, "sizes": [size]}]
    return _nothing(node)


def _nothing(node: str) -> list[Any]:
    """No answer is one of a node of the kernel; of any other file it is an OSError."""
    if not stat.S_ISCHR(Path(node).stat().st_mode):
        raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY), node)
    return []


def _formats(file: Any, queues: tuple[int, ...]) -> Iterator[tuple[int, bytes, bytes]]:
    """Flags, words and code of each format of these queues."""
    for kind in queues:
        for answer in _answers(file, _ENUM_FMT, struct.pack("=I", kind)):
            yield struct.unpack_from("=8xI32s4s", answer)


def _answers(file: Any, request: int, start: bytes) -> Iterator[bytes]:
    """The answers of an enumeration, up to the driver's error that ends it."""
    for index in range(_MAX_ENTRIES):
        try:
            yield fcntl.ioctl(file, request, _whole(request, struct.pack("=I", index) + start))
        except OSError:
            return


def _whole(request: int, start: bytes) -> bytes:
    """The structure of a request that begins so; its number holds the size (asm-generic/ioctl.h)."""
    return start.ljust(request >> 16 & 0x3FFF, b"\0")


def _size(kind: int, width: int, widest: int, _step: int, low: int, high: int) -> str:
    """Kind 1 is one size (width, height), the others are a range: the smallest and the largest."""
    return f"{width}x{widest}" if kind == 1 else f"{width}x{low} to {widest}x{high}"


def _text(padded: bytes) -> str:
    return padded.split(b"\0")[0].decode("utf-8", "replace").strip()
