"""The generated server, started as clients start it, against a host that exists nowhere: values, units and errors."""

import ctypes.util
import json
import os
import shutil
import socket
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from unit.builtin_serve.generated_endpoint import Call, Endpoint
from unit.builtin_serve.invented_host import (
    BATTERY,
    CAMERA,
    CHIP,
    CLOCK,
    DEVICES,
    DISK,
    EPOCH,
    IMU,
    LAMP,
    PANEL,
    PINS,
    SCREEN,
    SOUND,
    ZONE,
    key_event,
)

MODES = ("auto", "legacy")
SENSORS = (*DEVICES[CHIP], *DEVICES[IMU])
OTHERS = tuple(name for device in (BATTERY, PANEL, LAMP, CLOCK, DISK, SCREEN) for name in DEVICES[device])
FAKE_CV2 = '''
"""Stands where OpenCV would: says what was done to it, and gives a small picture."""
import os
CAP_ANY, CAP_V4L2, CAP_PROP_FRAME_WIDTH, CAP_PROP_FRAME_HEIGHT, COLOR_BGR2GRAY = 0, 200, 3, 4, 6
def note(text):
    with open(os.environ["CV2_NOTES"], "a") as notes: notes.write(text + "\\n")
class Bytes:
    def tobytes(self): return b"\\xff\\xd8 picture"
class Grey:
    def mean(self): return 101.255
    def var(self): return 912.5
class Frame: shape = (720, 1280, 3)
class VideoCapture:
    def __init__(self, node, backend): note(f"open {os.path.basename(node)} {backend}")
    def set(self, name, value): note(f"set {name} {value}")
    def grab(self): note("grab")
    def read(self): note("read"); return "CV2_DARK" not in os.environ, Frame()
    def release(self): note("release")
def imencode(form, frame): return True, Bytes()
def cvtColor(frame, code): return Grey()
print("a library that prints on the protocol's stream")
'''


def values(data: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
    return {item["channel"]: (item["value"], item["unit"]) for item in data["readings"]}


@pytest.mark.parametrize("mode", MODES)
def test_measurements_in_plain_units(tmp_path: Path, mode: str) -> None:
    endpoint = Endpoint(tmp_path, SENSORS, process=True)
    names = ("fan_speed", "voltage", "current", "power", "energy")
    inertial = ("acceleration", "angular_velocity", "magnetic_field", "illuminance", "pressure", "proximity")
    chip = [("read_temperature", {"device": CHIP}), ("read_humidity", {"device": CHIP})]
    heat = [("read_temperature", {"device": ZONE}), ("read_temperature", {"device": IMU})]
    all_calls: list[Call] = [*chip, *heat, ("read_humidity", {"device": IMU})]
    all_calls += [(f"read_{name}", {}) for name in (*names, *inertial, "sensor_channels")]
    found = endpoint.data(all_calls, mode)
    assert found[0]["unreadable"] == ["temp2"]
    assert found[0]["readings"][0]["label"] == "Core"
    assert [values(data) for data in found[:5]] == [
        {"temp1": (41.25, "degC")},
        {"humidity1": (51.2, "%")},
        {"temp": (39.0, "degC")},
        {"in_temp": (24.0, "degC")},
        {"in_humidityrelative": (45.5, "%")},
    ]
    assert values(found[5]) == {"fan2": (1310.0, "rpm")}
    assert [values(data) for data in found[6:10]] == [
        {"in0": (0.998, "V")},
        {"curr1": (2.5, "A")},
        {"power1": (15.5, "W")},
        {"energy1": (90.0, "J")},
    ]
    assert values(found[10]) == {"in_accel_x": (9.81, "m/s^2"), "in_accel_y": (-9.81, "m/s^2")}
    assert values(found[11]) == {"in_anglvel_z": (0.01, "rad/s")}
    assert values(found[12]) == {"in_magn_x": (1.0, "gauss")}
    assert values(found[13]) == {"in_illuminance": (120.5, "lux")}
    assert values(found[14]) == {"in_pressure": (101.325, "kPa")}
    assert values(found[15]) == {"in_proximity": (7.0, "")}
    assert values(found[16])["in_voltage0"] == (1.0, "V")
    assert len(endpoint.logged()) == 2 * len(all_calls)


@pytest.mark.parametrize("mode", MODES)
def test_power_light_storage_display_and_clock(tmp_path: Path, mode: str) -> None:
    endpoint = Endpoint(tmp_path, OTHERS)
    names = ("read_battery", "read_power_supply", "read_brightness", "read_led", "read_storage", "read_display")
    before = time.time()
    battery, mains, panel, lamp, storage, display, clock = endpoint.data(
        [*((name, {}) for name in names), ("read_clock", {})], mode
    )
    (cell,) = battery["supplies"]
    lines = (cell["capacity_percent"], cell["voltage_v"], cell["temperature_degc"], cell["cycles"], cell["energy_wh"])
    assert lines == (83.0, 12.1, 30.5, 212, 41.0)
    assert (cell["online"], cell["charge_ah"], cell["health"]) == (None, None, None)
    assert [(one["name"], one["online"]) for one in mains["supplies"]] == [("AC", 1)]
    assert panel["lights"] == [{"name": "panel0", "percent": 25.0, "level": 100, "maximum": 400}]
    assert lamp["lights"][0]["name"] == "status:green"
    (disk,) = storage["disks"]
    assert (disk["size_bytes"], disk["rotational"], disk["removable"], disk["io_errors"]) == (1048576, True, False, 2)
    (part,) = disk["volumes"]
    assert (part["name"], part["size_bytes"], part["mounted_at"], part["file_system"]) == (
        "sda1",
        524288,
        "/dev",
        "ext4",
    )
    assert part["free_bytes"] > 0
    (screen,) = display["connectors"]
    assert (screen["name"], screen["manufacturer"], screen["product"]) == ("DP-1", "DMO", "Demo Screen")
    assert (screen["width_mm"], screen["height_mm"], screen["modes"]) == (600, 340, ["1920x1080", "640x480"])
    (one,) = clock["clocks"]
    assert one["time"] == "2023-11-14T22:13:20Z"
    assert EPOCH - time.time() - 1 <= one["drift_s"] <= EPOCH - before + 1


def test_lights_are_set_and_read_back(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path, ("set_brightness", "set_led"))
    lamp, panel = endpoint.data(
        [("set_led", {"led": "status:green", "percent": 50}), ("set_brightness", {"percent": 0})]
    )
    assert lamp["lights"][0]["level"] == 200 and panel["lights"][0]["level"] == 0
    leds = endpoint.root / "sys/class/leds/status:green"
    assert ((leds / "brightness").read_text(), (leds / "trigger").read_text()) == ("200", "none")
    range_text, absent = endpoint.said(
        ("set_brightness", {"percent": 101}), ("set_led", {"led": "status:red", "percent": 1})
    )
    assert "less than or equal to 100" in range_text
    assert absent == f"{LAMP} has no such light now"


def test_input_devices_are_described_and_listened_to(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path, ("describe_input", "read_input_events"))
    pipe = os.open(endpoint.root / "dev/input/event3", os.O_RDWR)
    try:
        os.write(pipe, key_event(30, 1) + key_event(30, 0))
        found, events, none = endpoint.data(
            [
                ("describe_input", {}),
                ("read_input_events", {"seconds": 30, "events": 2}),
                ("read_input_events", {"seconds": 0.1}),
            ]
        )
    finally:
        os.close(pipe)
    (keys,) = found["inputs"]
    wanted = {"name": "Demo Keys", "event": "event3", "sends": ["key", "abs"], "keys": 3, "buttons": []}
    assert keys.items() >= wanted.items()
    assert [(axis["code"], axis["name"], axis["maximum"]) for axis in keys["axes"]] == [(0, "x", None), (1, "y", None)]
    assert [(one["type"], one["code"], one["value"]) for one in events["events"]] == [("key", 30, 1), ("key", 30, 0)]
    assert events["events"][0]["time_s"] == EPOCH + 0.25 and events["waited_s"] < 30
    assert none["events"] == []


def test_a_picture_with_data_beside_it(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path, ("capture_image",), process=True)
    (endpoint.folder / "cv2.py").write_text(FAKE_CV2)
    (result,) = endpoint.calls([("capture_image", {"flush": 2, "format": "png"})])
    assert result.structured_content["width"] == 1280 and result.structured_content["variance"] == 912.5
    assert [(item.type, item.mime_type) for item in result.content] == [("image", "image/png")]
    notes = Path(endpoint.environment["CV2_NOTES"]).read_text().splitlines()
    assert notes == ["open video0 0", "set 3 1280", "set 4 720", "grab", "grab", "read", "release"]
    endpoint.environment["CV2_DARK"] = "1"
    assert endpoint.said(("capture_image", {})) == [
        f"{CAMERA} gave no picture, twice; another program may be using it, or it sends nothing"
    ]
    assert Path(endpoint.environment["CV2_NOTES"]).read_text().endswith("read\nrelease\n")


def test_a_missing_library_breaks_only_its_tool(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path, ("capture_image", "read_clock"))
    (endpoint.folder / "cv2.py").write_text("raise ModuleNotFoundError('cv2', name='cv2')")
    camera, clock = endpoint.calls([("capture_image", {}), ("read_clock", {})])
    assert camera.is_error and not clock.is_error
    assert camera.content[0].text == "a library that this tool needs is missing on this host: cv2"
    assert [line["error"] for line in endpoint.logged() if "error" in line] == ["ModuleNotFoundError"]


def test_sound_through_the_alsa_library(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path, DEVICES[SOUND], process=True)
    configuration = tmp_path / "asound.conf"
    # A sound device that swallows and gives silence, under the name of the card that the host shows.
    slots = "@args [ CARD DEV ] @args.CARD { type string } @args.DEV { type string }"
    configuration.write_text(f"pcm.plughw {{ {slots} type null }}\n")
    endpoint.environment["ALSA_CONFIG_PATH"] = str(configuration)
    recorded, played = endpoint.calls(
        [("record_audio", {"seconds": 0.5, "rate_hz": 8000, "channels": 2}), ("play_audio", {"seconds": 0.2})]
    )
    if ctypes.util.find_library("asound") is None:
        assert "libasound" in recorded.content[0].text and "libasound" in played.content[0].text
        return
    assert recorded.structured_content == {"seconds": 0.5, "rate_hz": 8000, "channels": 2, "peak": 0, "rms": 0}
    assert [(item.type, item.mime_type) for item in recorded.content] == [("audio", "audio/wav")]
    assert played.structured_content["frequency_hz"] == 440


def test_a_node_that_is_no_device_gives_a_clear_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    endpoint = Endpoint(tmp_path, ("list_camera_formats", "read_gpio_lines", "read_clock"))
    (endpoint.root / "dev/video0").unlink()
    monkeypatch.chdir(endpoint.root / "dev")  # the name of a socket may not be long
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("video0")
        (endpoint.root / "sys/class/rtc/rtc0/since_epoch").unlink()
        camera, pins, clock = endpoint.said(("list_camera_formats", {}), ("read_gpio_lines", {}), ("read_clock", {}))
    assert camera.endswith("dev/video0: the device went away")
    assert pins.endswith("dev/gpiochip0: it is not there")
    assert clock.endswith("since_epoch: it is not there")
    kinds = [line["error"] for line in endpoint.logged() if line["event"] == "result"]
    assert kinds == ["OSError", "FileNotFoundError", "FileNotFoundError"]


def test_unknown_absent_and_driverless_devices(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path, ("read_temperature", "read_battery", "read_brightness"))
    endpoint.tree.unplug("virtual/thermal/thermal_zone0")
    endpoint.tree.unplug("virtual/backlight/panel0")
    shutil.rmtree(endpoint.root / "sys/devices/acpi0/BATT01/power_supply")
    unknown, absent, gone = endpoint.said(
        ("read_temperature", {"device": "usb-dead-beef"}),
        ("read_temperature", {"device": ZONE}),
        ("read_brightness", {}),
    )
    assert "Input should be" in unknown
    assert absent == f"{ZONE} is not attached, or its driver does not see it"
    assert gone.startswith(PANEL)
    assert endpoint.data([("read_battery", {"device": BATTERY})]) == [{"device": BATTERY, "supplies": []}]


def test_a_device_that_moved_is_found_by_the_instances_file(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path, ("read_clock", "read_storage", "read_display", "read_gpio_lines"))
    place = tmp_path / "instances.json"
    place.write_text(
        json.dumps({"format": 1, "devices": {CLOCK: {"sysfs": "/sys/devices/platform/old", "strength": "positional"}}})
    )
    endpoint.environment["OCTOFORM_INSTANCES"] = str(place)
    clock, disk, screen = endpoint.data(
        [("read_clock", {}), ("read_storage", {"device": DISK}), ("read_display", {"device": SCREEN})]
    )
    assert (clock["device"], disk["device"], screen["device"]) == (CLOCK, DISK, SCREEN)
    assert endpoint.said(("read_gpio_lines", {"device": PINS}))
