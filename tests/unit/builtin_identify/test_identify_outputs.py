"""Receivers, printers and converters: which of them get tools, and what PROBE must say for that."""

from pathlib import Path
from typing import Any

import pytest
from sysfs_tree import Tree
from unit.builtin_identify.probes import answer, capabilities, device, usb

from octoform.builtin.probe import probe_root

CDC = ("interface 00: class 02/02/01 driver=cdc_acm", "interface 01: class 0a/00/ff driver=cdc_acm")
PORT = (("tty", "ttyACM0"),)


def test_a_receiver_that_names_itself_behind_a_serial_line_of_the_usb_class_is_read() -> None:
    found = answer(usb("manufacturer: Demo", "product: Demo GNSS receiver", *CDC, nodes=PORT))
    assert (found["category"], found["class"]) == ("sensor", "gnss")
    assert {name: one["effect"] for name, one in capabilities(found).items()} == {"read_position": "read"}


def test_a_receiver_of_the_kernels_class_is_read() -> None:
    found = answer(device("serial-demo", "serial", "bus: serial", "gnss[0].type: NMEA", nodes=(("gnss", "gnss0"),)))
    assert (found["class"], set(capabilities(found))) == ("gnss", {"read_position"})


@pytest.mark.parametrize(
    ("lines", "more"),
    [
        (("product: Demo board", *CDC), {"nodes": PORT}),  # nothing shows that it is a receiver
        (("product: Demo GPS", "interface 00: class ff/00/00 driver=cp210x"), {"nodes": (("tty", "ttyUSB0"),)}),
        (("product: Demo GNSS receiver", *CDC), {}),  # no driver has made a port of it
        (("product: Demo LTE GNSS modem", *CDC), {"nodes": (*PORT, ("net", "wwan0"))}),
    ],
)
def test_no_other_serial_line_is_read(lines: tuple[str, ...], more: dict[str, Any]) -> None:
    assert "read_position" not in capabilities(answer(usb(*lines, **more)))


def test_a_printer_is_read_where_the_kernel_has_a_node_for_it() -> None:
    lines = ("interface 00: class 07/01/02 driver=usblp", "usbmisc[0].ieee1284_id: MFG:Demo;MDL:Inker 9;CMD:PCL")
    found = answer(usb(*lines, nodes=(("usbmisc", "lp0"),)))
    assert found["identified_as"] == "Demo Inker 9" and set(capabilities(found)) == {"read_printer_status"}
    assert not capabilities(answer(usb("interface 00: class 07/01/02 driver=usbfs")))


def test_only_whole_outputs_of_a_converter_are_set() -> None:
    lines = (
        "iio[0].out_voltage0: raw,scale,offset",
        "iio[0].out_voltage0_dither: raw,offset",
        "iio[0].out_voltage1: raw",
    )
    node = (("iio", "iio:device0"),)
    found = capabilities(answer(device("spi-dac", "spi", "bus: spi", "iio[0].name: dac", *lines, nodes=node)))
    assert found["set_output_channel"]["parameters"] == {"outputs": ["out_voltage0"]}
    mixed = device("spi-mixed", "spi", "bus: spi", *lines, "iio[0].in_voltage0: raw,scale", nodes=node)
    annotation = answer(mixed)
    assert (annotation["class"], annotation["category"]) == ("converter", "bidirectional")
    assert {"read_voltage", "set_output_channel"} <= set(capabilities(annotation))
    light = device("i2c-light", "i2c", "bus: i2c", *lines, "iio[0].in_proximity: raw", nodes=node)
    assert "set_output_channel" not in capabilities(answer(light))


def test_a_vibration_motor_is_no_game_controller_and_rumbles() -> None:
    lines = ('input[0].name: "demo-vibrator"', "input[0].events: force")
    found = answer(device("platform-vibrator", "platform", "bus: platform", *lines, nodes=(("input", "input3"),)))
    assert (found["class"], found["category"]) == ("haptic", "actuator") and set(capabilities(found)) == {"play_rumble"}


def test_a_printers_id_is_told_without_its_serial_number(tmp_path: Path) -> None:
    tree = Tree(tmp_path)
    tree.usb("pci0/usb1/1-5", "1f00", "00e1")
    tree.bus(
        "pci0/usb1/1-5/1-5:1.0", "usb", {"ieee1284_id": "MFG:Demo;MDL:Inker 9;CMD:PCL,PJL;SN:SECRET77;CLS:PRINTER;"}
    )
    tree.member("pci0/usb1/1-5/1-5:1.0/usbmisc/lp0", "usbmisc", DEVNAME="usb/lp0")
    tree.member("serial0/gnss/gnss0", "gnss", {"type": "NMEA"}, DEVNAME="gnss0")
    devices = probe_root(tmp_path)["devices"]
    text = "\n".join(one["raw_descriptor"] for one in devices)
    assert "usbmisc[0].ieee1284_id: MFG:Demo;MDL:Inker 9;CMD:PCL,PJL;CLS:PRINTER" in text
    assert "gnss[0].type: NMEA" in text and "SECRET77" not in text


@pytest.mark.parametrize(
    ("events", "kinds", "rumbles"),
    [("key,abs,force", "gamepad", True), ("key,abs", "gamepad", False), ("key,abs,force", "joystick", False)],
)
def test_only_a_game_pad_with_force_feedback_rumbles(events: str, kinds: str, rumbles: bool) -> None:
    lines = ('input[0].name: "Demo Pad"', f"input[0].events: {events}", f"input[0].kinds: {kinds}")
    found = answer(usb(*lines, nodes=(("input", "input3"), ("input", "event3"))))
    assert found["class"] == "gamepad" and ("play_rumble" in capabilities(found)) == rumbles


def video(bus: str, name: str, node: str, *classes: str, driver: str = "") -> set[str]:
    """The capabilities of a Video4Linux device."""
    nodes = [("video4linux", node), *((kind, f"{kind}0") for kind in classes)]
    lines = (f"bus: {bus}", f"video4linux[0].name: {name}", f"driver: {driver}")
    found = answer(device(f"{bus}-camera", bus, *lines, nodes=nodes, drivers=[driver] if driver else []))
    assert found["category"] == "sensor"
    return set(capabilities(found))


def test_a_picture_is_offered_only_where_the_node_gives_one_as_it_is() -> None:
    both = {"capture_image", "list_camera_formats"}
    assert video("platform", "vivid-000-vid-cap", "video0", "media", driver="vivid") == both
    assert video("virtual", "mmal service 16.1", "video0") == both
    assert video("platform", "unicam-image", "video0", "media", driver="unicam") == {"list_camera_formats"}
    assert video("platform", "soc9-csi capture", "video0", "media") == {"list_camera_formats"}
    assert video("i2c", "imx-demo 10-0010", "v4l-subdev0") == set()
    assert video("platform", "demo", "v4l-subdev1") == set()


def test_counts_are_read_and_pulses_are_left_alone() -> None:
    counter = answer(device("platform-encoder", "platform", "bus: platform", nodes=(("counter", "counter0"),)))
    assert counter["category"] == "sensor" and set(capabilities(counter)) == {"read_counters"}
    pulses = answer(device("platform-pwm", "platform", "bus: platform", nodes=(("pwm", "pwmchip0"),)))
    assert (pulses["category"], pulses["class"], pulses["capabilities"]) == ("infrastructure", "pwm", [])
