"""octoform on a real kernel: hardware that real drivers are bound to is onboarded, called, unplugged and plugged again.

Tests stand in the order of the story: what is there, what apply makes of it, what the tools give, what one sentence
adds, and what remains right when devices come back under other names.
"""

from collections.abc import Callable
from typing import Any

import pytest
from vm import bench as benches
from vm.bench import (
    BREAKOUT,
    CAMERA,
    CH340_BOARD,
    CP2102_BOARD,
    HEADSET,
    LIGHT,
    RAIL_BOARD,
    SIMULATED_CHIP,
    SIMULATED_GPIO,
    SIMULATED_SENSOR,
    Bench,
)
from vm.contents import Picture, picture, pitch
from vm.devices.camera import COLOURS
from vm.devices.headset import TONE
from vm.user import SMALL, Octoform

pytestmark = pytest.mark.vm
See = Callable[[str, str], None]


def shows_the_pattern(seen: Picture) -> str:
    """The bars of the emulated camera stand where they should; else an assertion names the one that does not."""
    found = [seen.at((2 * number + 1) / 16, 0.25) for number in range(8)]
    for colour, wanted in zip(found, COLOURS, strict=True):
        assert max(abs(a - b) for a, b in zip(colour, wanted, strict=True)) <= 20, (found, COLOURS)
    assert max(seen.at(0.85, 0.75)) <= 20, "the dark field in the lower right is not there"
    return f"{seen.width}x{seen.height}, all eight bars"


def where(module: str) -> pytest.MarkDecorator:
    """The test is for the architectures whose kernel has the module; the table shows which one lacks it."""
    having = [arch for arch in benches.LACKING if module not in benches.LACKING[arch]]
    return pytest.mark.parametrize("arch", having, indirect=True, scope="session")


def test_the_kernel_has_what_is_expected_of_it(bench: Bench, see: See) -> None:
    present = {
        name: not bench.guest.run(f"modinfo -n {name} >/dev/null 2>&1 || echo missing")
        for name in (*benches.EXPECTED[bench.arch], *benches.LACKING[bench.arch])
    }
    for name, purpose in benches.LACKING[bench.arch].items():
        see("not in this kernel", f"{name}: {purpose}")
    assert [name for name in benches.EXPECTED[bench.arch] if not present[name]] == []
    assert [name for name in benches.LACKING[bench.arch] if present[name]] == [], "this kernel has more than we say"
    see("kernel", bench.guest.run("uname -r"))


def test_a_plan_comes_before_anything(first_plan: str) -> None:
    assert "Plan: 6 to add, 0 to change, 0 to destroy." in first_plan


def test_every_device_is_named_or_honestly_unknown(octoform: Octoform, see: See) -> None:
    named = {device["id"]: device for device in octoform.artifact("identify")["devices"]}
    assert [named[device]["class"] for device in (CAMERA, HEADSET)] == ["camera", "audio"]
    for board in (CH340_BOARD, CP2102_BOARD):
        assert named[board]["category"] == "unknown", named[board]
        assert named[board]["missing"], "no question"
    # The board identifies itself; what its firmware does cannot be known.
    assert RAIL_BOARD not in {device for tool in octoform.artifact("interface")["tools"] for device in tool["devices"]}
    see("serial boards", "CH340 and CP2102 unknown, one question each; CDC-ACM named by itself, without a tool")


def test_the_second_plan_has_nothing_to_do(octoform: Octoform, see: See) -> None:
    assert octoform.status("plan", "-detailed-exitcode") == 0
    see("plan", "no changes after apply")


def test_a_picture_shows_what_the_camera_sees(octoform: Octoform, see: See) -> None:
    answer = octoform.call("capture_image", device=CAMERA, **SMALL)
    see("camera", shows_the_pattern(picture(octoform.guest.read(answer["files"][0]))))


def test_a_recording_sounds_as_what_is_to_be_heard(octoform: Octoform, see: See) -> None:
    answer = octoform.call("record_audio", device=HEADSET, seconds=2)
    hertz, peak = pitch(octoform.guest.read(answer["files"][0]))
    assert abs(hertz - TONE) < 4, hertz
    assert 0.3 < peak < 0.4, peak
    see("microphone", f"{hertz:.1f} Hz of {TONE}")


def test_a_tone_reaches_the_speaker(bench: Bench, octoform: Octoform, see: See) -> None:
    bench.headset.played.clear()
    octoform.call("play_audio", device=HEADSET, seconds=1, frequency_hz=TONE, volume=0.5)
    assert any(bench.headset.played)
    see("speaker", f"{len(bench.headset.played)} bytes played")


@where("gpio-sim")
def test_a_set_line_is_seen_from_the_other_side(bench: Bench, octoform: Octoform, see: See) -> None:
    assert bench.line(3) == "0"
    octoform.call("set_gpio_line", device=SIMULATED_GPIO, line=3, state="high")
    assert bench.line(3) == "1"
    octoform.call("set_gpio_line", device=SIMULATED_GPIO, line=3, state="low")
    assert bench.line(3) == "0"
    for way, level in (("pull-up", 1), ("pull-down", 0)):
        bench.pull(5, way)
        assert octoform.call("read_gpio_line", device=SIMULATED_GPIO, line=5)["structured"]["level"] == level
    see("gpio, simulated", "line 3 driven high and low, line 5 read as it was pulled")


def test_a_line_of_a_usb_breakout_is_set(bench: Bench, octoform: Octoform, see: See) -> None:
    # No level is compared: the driver of this kernel takes the chip's direction for the level of an input.
    for state, level in (("high", 1), ("low", 0)):
        octoform.call("set_gpio_line", device=BREAKOUT, line=2, state=state)
        assert bench.breakout.driven == {2: level}, "another line was driven too"
    octoform.call("read_gpio_line", device=BREAKOUT, line=1)
    assert bench.breakout.driven == {2: 0}, "reading drove a line"
    octoform.call("set_gpio_line", device=BREAKOUT, line=2, state="input")
    assert bench.breakout.driven == {}
    see("gpio, USB breakout", "line 2 driven high and low and let go; no other line touched")


def test_lines_of_the_processor_are_not_driven(bench: Bench, octoform: Octoform, see: See) -> None:
    tools = {tool["name"]: tool["devices"] for tool in octoform.artifact("interface")["tools"]}
    # Asking for a processor's pin, even to read it, may take it from its function.
    meant = {BREAKOUT} if "gpio-sim" in benches.LACKING[bench.arch] else {BREAKOUT, SIMULATED_GPIO}
    assert set(tools["set_gpio_line"]) == set(tools["read_gpio_line"]) == meant
    see("gpio, processor's", "left alone")


def readings(answer: dict[str, Any]) -> dict[str, float]:
    """Value by channel."""
    return {item["channel"]: item["value"] for item in answer["structured"]["readings"]}


def test_a_temperature_is_what_the_chip_measures(bench: Bench, octoform: Octoform, see: See) -> None:
    if bench.arch == "arm64":  # this kernel can simulate no chip; QEMU's NVMe disk has a sensor
        disk = next(tool for tool in octoform.artifact("interface")["tools"] if tool["name"] == "read_temperature")
        celsius = next(iter(readings(octoform.call("read_temperature", device=disk["devices"][0])).values()))
        found = int(bench.guest.run("cat /sys/class/nvme/nvme0/hwmon*/temp1_input")) / 1000
        assert celsius == pytest.approx(found)
        see("hwmon", f"{celsius} degC, as the kernel tells")
        return
    for degrees in (25.5, 61.0):
        bench.set_temperature(degrees)
        bench.guest.until(f"grep -qx {round(degrees * 1000)} /sys/class/hwmon/hwmon*/temp1_input")
        assert readings(octoform.call("read_temperature", device=SIMULATED_CHIP))["temp1"] == degrees
    see("hwmon", "25.5 and then 61.0 degC")


@where("iio_dummy")
def test_a_sensor_gives_the_values_of_its_driver(bench: Bench, octoform: Octoform, see: See) -> None:
    found = readings(octoform.call("read_sensor_channels", device=SIMULATED_SENSOR))
    assert found["in_voltage0"] == pytest.approx(bench.sensor_volts(), rel=0.001)
    assert readings(octoform.call("read_acceleration", device=SIMULATED_SENSOR))["in_accel_x"] == found["in_accel_x"]
    see("iio, simulated", f"in_voltage0 is {1000 * found['in_voltage0']:.5f} mV, as its driver has it")


def test_light_is_measured_through_a_usb_sensor(bench: Bench, octoform: Octoform, see: See) -> None:
    for lux in (312, 47):
        bench.light.lux = lux
        assert list(readings(octoform.call("read_illuminance", device=LIGHT)).values()) == [lux]
    see("iio, USB sensor", "312 and then 47 lux")


def test_the_disk_is_in_the_inventory(octoform: Octoform, see: See) -> None:
    tool = next(tool for tool in octoform.artifact("interface")["tools"] if tool["name"] == "read_storage")
    sizes = {
        device: octoform.call("read_storage", device=device)["structured"]
        for device in tool["devices"]
        if device.startswith(("scsi-", "usb-"))
    }
    assert f"{benches.DISK_BYTES}" in str(sizes), sizes
    assert benches.DISK_SERIAL not in octoform.guest.run("cat /root/bench/state/bench/*/output.json")
    see("storage", f"the USB disk of {benches.DISK_BYTES} bytes")


def test_an_mcp_client_speaks_to_it_over_a_pipe(octoform: Octoform, see: See) -> None:
    with octoform.connected() as client:
        names, seen = client.tools(), client.picture(CAMERA)
    assert {"capture_image", "record_audio", "read_storage"} <= set(names)
    see("MCP client", f"{len(names)} tools over ssh; {shows_the_pattern(seen)}")


def test_one_sentence_makes_a_board_usable(bench: Bench, answered: Octoform, see: See) -> None:
    named = {device["id"]: device for device in answered.artifact("identify")["devices"]}
    assert named[RAIL_BOARD]["category"] != "unknown"
    assert named[CH340_BOARD]["category"] == "unknown", "the sentence was about another board"
    answered.call("rail_home", device=RAIL_BOARD)
    answered.call("rail_move_x", device=RAIL_BOARD, steps=42)
    assert bench.firmware.position == {"X": 42, "Y": 0}
    see("serial board, answered", f"the firmware heard {', '.join(bench.firmware.lines)}")


def test_everything_comes_back_under_other_names(bench: Bench, answered: Octoform, see: See) -> None:
    guest, before = bench.guest, answered.attempts()
    replugged(bench, "camera", "/dev/video0", "/dev/video2", 10)
    replugged(bench, "rail", "/dev/ttyACM0", "/dev/ttyACM1", 9)
    moved = "camera at video2, board at ttyACM1"
    if bench.arch == "amd64":
        old, new = bench.renumber_sensor()
        assert old != new
        bench.set_temperature(33.5)
        moved += f", sensor from {old} to {new}"
    guest.run("udevadm settle --timeout=300", 400.0)
    shows_the_pattern(picture(guest.read(answered.call("capture_image", device=CAMERA, **SMALL)["files"][0])))
    answered.call("rail_home", device=RAIL_BOARD)
    answered.call("rail_move_y", device=RAIL_BOARD, steps=-7)
    assert bench.firmware.position == {"X": 0, "Y": -7}
    if bench.arch == "amd64":
        bench.guest.until("grep -qx 33500 /sys/class/hwmon/hwmon*/temp1_input")
        assert readings(answered.call("read_temperature", device=SIMULATED_CHIP))["temp1"] == 33.5
    assert answered.status("plan", "-detailed-exitcode") == 0, answered.run("plan")
    assert answered.attempts() == before, "an agent ran"
    see("plugged again", f"{moved}; calls work, no changes, no agent ran")


def replugged(bench: Bench, name: str, node: str, expected: str, port: int) -> None:
    """Pull a device while a program still has its node open, and put it into another port."""
    with bench.guest.held_open(node):
        bench.guest.unplug(name)
        bench.guest.until(f"! test -e {node}")
        bench.guest.plug(name, bench.rail() if name == "rail" else bench.camera, port)
        bench.guest.until(f"test -e {expected}")


def test_the_endpoint_ends_when_it_is_told(answered: Octoform) -> None:
    running = "pgrep -f '[e]ndpoint/serve.py' || true"
    assert answered.asked("status")["health"] == "healthy", answered.run("status")
    assert answered.guest.run(running)
    answered.run("stop")
    assert answered.guest.run(running) == ""
