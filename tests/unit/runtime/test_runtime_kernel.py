"""The kernel's interfaces in the runtime: the numbers of the requests, and what the modules say of a node."""

import struct
from pathlib import Path

import pytest

from octoform.runtime import evdev, gpio, v4l2

BOTH, READ, WRITE = 3, 2, 1


@pytest.mark.parametrize(
    ("request_number", "way", "size", "letter", "number"),
    [
        (v4l2._ENUM_FMT, BOTH, struct.calcsize("=3I32s2I3I"), ord("V"), 2),
        (v4l2._ENUM_FRAMESIZES, BOTH, struct.calcsize("=3I6I2I"), ord("V"), 74),
        (v4l2._QUERY_CTRL, BOTH, struct.calcsize("=2I32s3iiI2I"), ord("V"), 36),
        (v4l2._GET_CTRL, BOTH, struct.calcsize("=Ii"), ord("V"), 27),
        (v4l2._SET_CTRL, BOTH, struct.calcsize("=Ii"), ord("V"), 28),
        (gpio._CHIPINFO, READ, struct.calcsize("=32s32sI"), 0xB4, 1),
        (gpio._LINEINFO, BOTH, struct.calcsize("=32s32s2IQ160s4I"), 0xB4, 5),
        (gpio._GET_LINE, BOTH, struct.calcsize("=64I32s") + len(gpio._AS_IT_IS) + struct.calcsize("=2I5Ii"), 0xB4, 7),
        (gpio._SET_CONFIG, BOTH, len(gpio._AS_IT_IS), 0xB4, 0x0D),
        (gpio._GET_VALUES, BOTH, struct.calcsize("=QQ"), 0xB4, 0x0E),
        (evdev._EVIOCGABS, READ, struct.calcsize("=6i"), ord("E"), 0x40),
        (evdev._EVIOCSFF, WRITE, 0, ord("E"), 0x80),
    ],
)
def test_numbers_follow_from_the_structures(request_number: int, way: int, size: int, letter: int, number: int) -> None:
    """The kernel's _IOC: direction, size of the structure, letter of the subsystem, number (asm-generic/ioctl.h)."""
    assert request_number == way << 30 | size << 16 | letter << 8 | number


@pytest.mark.parametrize("state", ["high", "low", "input"])
def test_a_configuration_has_the_size_of_its_structure(state: str) -> None:
    assert len(gpio._config(state)) == len(gpio._AS_IT_IS)


def test_a_node_that_is_no_such_device_is_an_error_and_not_an_empty_answer(tmp_path: Path) -> None:
    (node := tmp_path / "video0").write_bytes(b"")
    for ask in (v4l2.formats, lambda node: v4l2.codes(node, v4l2.TAKEN), lambda node: evdev.events([node], 1, 0.1)):
        with pytest.raises(OSError, match="Inappropriate ioctl") as problem:
            ask(str(node))
        assert problem.value.filename == str(node)
    assert evdev.axis(node, 0) == evdev.axis(tmp_path / "none", 0) == dict.fromkeys(("position", "minimum", "maximum"))
    with pytest.raises(OSError, match="ioctl"):
        gpio.lines(str(node))


def test_a_node_of_the_kernel_is_told_from_a_file_of_pictures(tmp_path: Path) -> None:
    (film := tmp_path / "video0").write_bytes(b"YUV4MPEG2 C420jpeg W640 H480 F30:1\nFRAME\n")
    assert v4l2.is_node(str(film)) is False and v4l2.is_node("/dev/null") is True
    assert v4l2.formats(str(film))[0]["sizes"] == ["640x480"]
    with pytest.raises(FileNotFoundError) as problem:
        v4l2.is_node(str(tmp_path / "video1"))
    assert problem.value.filename.endswith("video1")
