"""Converters set in volts and amperes, a receiver's position, a printer's state: against files and a terminal."""

import errno
import fcntl
import os
import pty
import struct
import termios
import threading
from functools import reduce
from operator import xor
from pathlib import Path

import pytest
from unit.builtin_serve.generated_endpoint import Endpoint
from unit.builtin_serve.invented_host import CONVERTER, PRINTER, RECEIVER

DAC = "sys/devices/spi0/spi0.0/iio:device1"
GGA = "GNGGA,101530.00,4807.0380,N,01131.0000,W,1,08,0.9,545.4,M,46.9,M,,"
RMC = "GNRMC,101530.00,A,4807.0380,N,01131.0000,W,022.4,084.4,230394,003.1,W"
GSA = "GNGSA,A,3,04,05,,09,12,,,24,,,,,2.5,1.3,2.1"


def sentence(body: str, wrong: int = 0) -> bytes:
    return f"${body}*{reduce(xor, body.encode(), wrong):02X}\r\n".encode()


def set_to(channel: str, value: float) -> tuple[str, dict[str, object]]:
    return ("set_output_channel", {"channel": channel, "value": value})


def test_an_output_is_set_in_its_unit_and_read_back(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path, ("read_output_channels", "set_output_channel"))
    volts, amperes, found = endpoint.data(
        [set_to("out_voltage0", 0.25), set_to("out_current0", 0.002), ("read_output_channels", {})]
    )
    assert ((endpoint.root / DAC / "out_voltage0_raw").read_text()) == "1500"  # 250 mV is (1500 - 1000) * 0.5 mV
    assert volts["outputs"] == [
        {
            **{"channel": "out_voltage0", "value": 0.25, "unit": "V", "minimum": -0.5, "maximum": 1.5475},
            "powered_down": True,
        }
    ]
    (current,) = amperes["outputs"]
    assert (current["value"], current["unit"], current["minimum"]) == (0.002, "A", None)
    assert [(one["channel"], one["value"]) for one in found["outputs"]] == [
        *(("out_current0", 0.002), ("out_voltage0", 0.25), ("out_voltage2", None)),
    ]
    assert found["device"] == CONVERTER


def test_an_output_is_never_set_beyond_its_range_or_without_a_scale(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path, ("set_output_channel",))
    high, low, no_scale, absent, limit = endpoint.said(
        *(set_to("out_voltage0", value) for value in (1.549, -0.501)),
        *(set_to("out_voltage2", 1), set_to("out_voltage10", 1), set_to("out_voltage0", 51)),
    )
    assert high == "out_voltage0 takes -0.5 to 1.5475, not 1.549" and low.endswith("not -0.501")
    assert "tells no scale of out_voltage2" in no_scale and absent == f"{CONVERTER} has no output out_voltage10 now"
    assert "less than or equal to 50" in limit
    raws = [(endpoint.root / DAC / f"out_{name}_raw").read_text().strip() for name in ("voltage0", "voltage2")]
    assert raws == ["0", "8"]


@pytest.fixture
def receiver(tmp_path: Path) -> tuple[Endpoint, int]:
    """An endpoint whose receiver is a terminal that echoes, as the kernel hands them out, and its other side."""
    endpoint = Endpoint(tmp_path, ("read_position",))
    ours, theirs = pty.openpty()
    (endpoint.root / "dev/ttyACM0").symlink_to(os.ttyname(theirs))
    return endpoint, ours


def test_a_position_from_a_round_of_sentences(receiver: tuple[Endpoint, int]) -> None:
    endpoint, ours = receiver
    talk = b"rest of a line*\r\n" + sentence(RMC) + sentence(GGA.replace("4807", "1111"), wrong=1)
    stop = threading.Event()

    def speak() -> None:
        while not stop.wait(0.02):
            os.write(ours, talk + sentence(GGA) + sentence(GSA))

    speaker = threading.Thread(target=speak)
    speaker.start()
    try:
        (found,) = endpoint.data([("read_position", {"seconds": 30})])
    finally:
        stop.set()
        speaker.join()
    assert found["device"] == RECEIVER and found["fix"] == "3d" and found["waited_s"] < 30
    assert (found["latitude_deg"], found["longitude_deg"], found["altitude_m"]) == (48.1173, -11.5166667, 545.4)
    assert (found["satellites"], found["hdop"], found["time_utc"]) == (8, 0.9, "2094-03-23T10:15:30Z")


def test_without_a_fix_there_is_no_position_and_nothing_is_sent(receiver: tuple[Endpoint, int]) -> None:
    endpoint, ours = receiver
    assert termios.tcgetattr(ours)[3] & termios.ECHO
    (silent,) = endpoint.data([("read_position", {"seconds": 0.1})])
    assert (silent["fix"], silent["sentences"], silent["time_utc"]) == ("none", 0, None)
    assert termios.tcgetattr(ours)[3] == 0  # what comes now is not sent back
    os.write(ours, sentence("GPGGA,101531.00,,,,,0,00,99.9,,M,,M,,") + sentence("GPRMC,101531.00,V,,,,,,,230394,,,N"))
    (found,) = endpoint.data([("read_position", {"seconds": 0.3})])
    assert (found["fix"], found["latitude_deg"], found["satellites"], found["sentences"]) == ("none", None, 0, 2)
    assert struct.unpack("i", fcntl.ioctl(ours, termios.FIONREAD, bytes(4))) == (0,)


def test_the_printers_state_and_languages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    endpoint = Endpoint(tmp_path, ("read_printer_status",))
    answers = iter((0x18, 0x30))

    def ioctl(file: object, request: int, argument: bytes) -> bytes:
        assert request == 0x060B and len(argument) == 4
        return struct.pack("=i", next(answers))

    monkeypatch.setattr("fcntl.ioctl", ioctl)
    ready, empty = endpoint.data([("read_printer_status", {}), ("read_printer_status", {})])
    assert ready == {
        **{"device": PRINTER, "online": True, "out_of_paper": False, "error": False},
        **{"maker": "Demo Makers", "model": "Inker 9", "languages": ["PCL", "PJL"]},
    }
    assert (empty["online"], empty["out_of_paper"], empty["error"]) == (True, True, True)


def test_what_a_video_processor_takes_and_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    endpoint = Endpoint(tmp_path, ("list_video_codecs",))
    queues = {2: [b"H264", b"MPG2"], 9: [b"NV12"]}

    def ioctl(_: object, request: int, argument: bytes) -> bytes:
        index, kind = struct.unpack_from("=2I", argument)  # struct v4l2_fmtdesc begins so
        assert request == 0xC0405602 and len(argument) == 64
        if index >= len(queues.get(kind, ())):
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        return struct.pack("=3I32s4s16x", index, kind, 1, b"some words", queues[kind][index])

    monkeypatch.setattr("fcntl.ioctl", ioctl)
    (found,) = endpoint.data([("list_video_codecs", {})])
    assert found["codecs"] == [{"name": "vpu-dec", "takes": ["H264", "MPG2"], "gives": ["NV12"]}]


def test_counts_are_read_with_their_direction(tmp_path: Path) -> None:
    (found,) = Endpoint(tmp_path, ("read_counters",)).data([("read_counters", {})])
    wheel, broken = found["counts"]
    assert wheel == {"counter": "encoder", "name": "Wheel", "count": -42, "direction": "backward", "function": None}
    assert (broken["name"], broken["count"]) == ("count1", None)
