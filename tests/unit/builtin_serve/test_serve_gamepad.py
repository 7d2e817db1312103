"""A game pad: its sticks with their ranges, its buttons by name, and the motors that let it rumble."""

import ctypes
import errno
import os
import struct
from pathlib import Path

import pytest
from unit.builtin_serve.generated_endpoint import Endpoint
from unit.builtin_serve.invented_host import KEYS

U16, S16 = ctypes.c_uint16, ctypes.c_int16


class Envelope(ctypes.Structure):
    """struct ff_envelope of linux/input.h."""

    _fields_ = [("values", U16 * 4)]


class Periodic(ctypes.Structure):
    """struct ff_periodic_effect, the largest of the union."""

    _fields_ = [
        *(("waveform", U16), ("period", U16), ("magnitude", S16), ("offset", S16), ("phase", U16)),
        *(("envelope", Envelope), ("custom_len", ctypes.c_uint32), ("custom_data", ctypes.c_void_p)),
    ]


class Rumble(ctypes.Structure):
    """struct ff_rumble_effect."""

    _fields_ = [("strong", U16), ("weak", U16)]


class Union(ctypes.Union):
    """The effects."""

    _fields_ = [("rumble", Rumble), ("periodic", Periodic)]


class Effect(ctypes.Structure):
    """struct ff_effect."""

    _fields_ = [
        *(("type", U16), ("id", S16), ("direction", U16), ("button", U16), ("interval", U16), ("length", U16)),
        *(("delay", U16), ("u", Union)),
    ]


@pytest.fixture
def endpoint(tmp_path: Path) -> Endpoint:
    made = Endpoint(tmp_path, ("describe_input", "play_rumble"))
    folder = made.root / "sys/devices/pci0/usb1/1-3/input/input3/capabilities"
    (folder / "key").write_text("7cdb000000000000 0 0 0 0")
    (folder / "abs").write_text("30003f")
    (folder / "ff").write_text("107030000 0")
    (made.root / "dev/input/event3").unlink()
    (made.root / "dev/input/event3").touch()
    return made


def test_axes_have_ranges_and_buttons_have_names(endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch) -> None:
    def ioctl(_: object, request: int, argument: bytes) -> bytes:
        way, size, letter, code = request >> 30, request >> 16 & 0x3FFF, request >> 8 & 0xFF, request & 0xFF
        assert (way, size, letter, len(argument)) == (2, struct.calcsize("6i"), ord("E"), 24)  # struct input_absinfo
        if code == 0x40 + 21:
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        return struct.pack("=6i", code - 0x40, -32768, 32767, 16, 128, 0)

    monkeypatch.setattr("fcntl.ioctl", ioctl)
    (found,) = endpoint.data([("describe_input", {})])[0]["inputs"]
    named = {axis["name"]: axis for axis in found["axes"]}
    assert list(named) == ["x", "y", "z", "rx", "ry", "rz", "20", "21"]
    assert named["ry"] == {"code": 4, "name": "ry", "minimum": -32768, "maximum": 32767, "position": 4}
    assert named["21"]["maximum"] is None
    wanted = "south east north west tl tr select start mode thumb_l thumb_r"
    assert found["buttons"] == wanted.split() and found["keys"] == 11


def test_a_pad_rumbles_for_a_bounded_time(endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def ioctl(_: object, request: int, argument: bytes) -> bytes:
        effect = Effect.from_buffer_copy(argument)
        assert request == 1 << 30 | ctypes.sizeof(Effect) << 16 | ord("E") << 8 | 0x80  # EVIOCSFF
        asked.append((effect.type, effect.id, effect.length, effect.u.rumble.strong, effect.u.rumble.weak))
        effect.id = 5
        return bytes(effect)

    monkeypatch.setattr("fcntl.ioctl", ioctl)
    (done,) = endpoint.data([("play_rumble", {"seconds": 0.05, "strength": 0.5})])
    assert done == {"device": KEYS, "seconds": 0.05, "strength": 0.5}
    assert asked == [(0x50, -1, 50, 32768, 32768)]
    event = struct.unpack("llHHi", (endpoint.root / "dev/input/event3").read_bytes())
    assert event == (0, 0, 0x15, 5, 1)


def test_a_pad_without_motors_says_so(endpoint: Endpoint) -> None:
    (endpoint.root / "sys/devices/pci0/usb1/1-3/input/input3/capabilities/ff").write_text("1 0 0")
    assert (
        endpoint.said(("play_rumble", {}), ("play_rumble", {"seconds": 6}))[0]
        == f"{KEYS} has no motor that rumbles now"
    )
