"""One invented device of each class: its category, its name, and what may be done with it."""

from typing import Any

import pytest
from unit.builtin_identify.probes import answer, capabilities, device, usb

CAMERA = usb(
    "manufacturer: Kestrel",
    "product: Kestrel HD-40",
    "device_class: ef/02/01",
    "interface 00: class 0e/01/00 driver=uvcvideo",
    "video4linux[0].name: Kestrel HD-40",
    nodes=[("video4linux", "video0"), ("video4linux", "video1")],
)
HEADSET = usb(
    "product: Wren 7 Headset",
    "interface 00: class 01/01/00 driver=snd-usb-audio",
    "interface 03: class 03/00/00 driver=usbhid",
    "input[0].name: Wren 7 Headset",
    "input[0].kinds: buttons",
    "sound[0].id: W7",
    "sound[0].pcm0: playback,capture",
    nodes=[("sound", "card1"), ("sound", "pcmC1D0p"), ("sound", "pcmC1D0c"), ("input", "input3")],
)
SPEAKERS = device(
    "sound-d9", "sound", "class: sound", "sound[0].name: Dove D9", "sound[0].pcm0: playback", nodes=[("sound", "card0")]
)
BOARD_SENSOR = device(
    "platform-ext9",
    "platform",
    "bus: platform",
    "name: ext9",
    "hwmon[0].name: ext9",
    "hwmon[0].temp1: input,max label=Intake",
    "hwmon[0].fan2: input,min",
    "hwmon[0].in0: max",
    "hwmon[0].pwm1: value",
    nodes=[("hwmon", "hwmon2")],
)
MOTION = device(
    "i2c-mot6",
    "i2c",
    "bus: i2c",
    "name: mot6",
    "iio[0].name: mot6",
    "iio[0].in_accel_x: raw,scale",
    "iio[0].in_anglvel_x: raw,scale",
    "iio[0].in_temp: raw,offset,scale",
    nodes=[("iio", "iio:device0")],
)
CONVERTER = device(
    "iio-dac2",
    "iio",
    "class: iio",
    "iio[0].name: dac2688",
    "iio[0].out_voltage0: raw,scale",
    nodes=[("iio", "iio:device0")],
)
TRANSCEIVER = device(
    "iio-rx", "iio", "iio[0].name: rx-phy", "iio[0].out_altvoltage0_LO: raw", "iio[0].in_voltage0: raw",
    nodes=[("iio", "iio:device0")],
)  # fmt: skip
BATTERY = device(
    "acpi-bat",
    "acpi",
    "bus: acpi",
    "power_supply[0].type: Battery",
    "power_supply[0].manufacturer: Reed",
    "power_supply[0].model_name: RC-57",
    "power_supply[0].readings: capacity,status",
    "hwmon[0].name: BAT0",
    "hwmon[0].in0: input",
    nodes=[("power_supply", "BAT0"), ("hwmon", "hwmon4")],
)
BACKLIGHT = device(
    "backlight-x", "backlight", "backlight[0].name: x", "backlight[0].max_brightness: 1500", nodes=[("backlight", "x")]
)
LEDS = device(
    "platform-leds",
    "platform",
    "name: leds",
    "leds[0].name: ACT",
    "leds[0].max_brightness: 255",
    nodes=[("leds", "ACT")],
)
GPIO = device(
    "platform-gpio", "platform", "gpio[0].label: pinctrl-soc9", "gpio[0].ngpio: 54", nodes=[("gpio", "gpiochip0")]
)
DISK = device(
    "scsi-disk", "scsi", "bus: scsi", "vendor: ATA", "model: Granary HD8000", "type: disk", nodes=[("block", "sda")]
)
OPTICAL = device("scsi-cd", "scsi", "vendor: Lathe", "model: DVD-R 9", "type: cdrom", nodes=[("block", "sr0")])
DRIVE_WITH_SENSOR = device(
    "pci-nv",
    "pci",
    "bus: pci",
    "class_code: 0x010802",
    "block[0].model: Reed NV 512",
    "hwmon[0].name: nvme",
    "hwmon[0].temp1: input label=Composite",
    nodes=[("block", "nvme0n1"), ("nvme", "nvme0"), ("hwmon", "hwmon1")],
)
GRAPHICS = device(
    "pci-gpu", "pci", "bus: pci", "class_code: 0x030000", "drm[0].connector: eDP-1", nodes=[("drm", "card0-eDP-1")]
)
CLOCK = device("pnp-rtc", "pnp", "bus: pnp", "rtc[0].name: rtc_cmos", nodes=[("rtc", "rtc0")])
TOUCHPAD = device(
    "serio-1", "serio", "bus: serio", "input[0].name: SynPS/2 Plover TouchPad", "input[0].kinds: touchpad",
    nodes=[("input", "input6")],
)  # fmt: skip


@pytest.mark.parametrize(
    ("entry", "category", "kind", "offered"),
    [
        (CAMERA, "sensor", "camera", {"capture_image", "list_camera_formats"}),
        (HEADSET, "bidirectional", "audio", {"record_audio", "play_audio"}),
        (SPEAKERS, "actuator", "audio_out", {"play_audio"}),
        (BOARD_SENSOR, "sensor", "hwmon", {"read_temperature", "read_fan_speed"}),
        (
            MOTION,
            "sensor",
            "imu",
            {"read_acceleration", "read_angular_velocity", "read_temperature", "read_sensor_channels"},
        ),
        (CONVERTER, "actuator", "dac", {"read_output_channels", "set_output_channel"}),
        (TRANSCEIVER, "bidirectional", "sdr", {"read_sensor_channels"}),
        (BATTERY, "sensor", "battery", {"read_battery", "read_voltage"}),
        (BACKLIGHT, "actuator", "light", {"read_brightness", "set_brightness"}),
        (LEDS, "actuator", "light", {"read_led", "set_led"}),
        (GPIO, "bidirectional", "gpio", {"read_gpio_lines"}),
        (DISK, "infrastructure", "storage", {"read_storage"}),
        (OPTICAL, "infrastructure", "optical", set()),
        (DRIVE_WITH_SENSOR, "infrastructure", "storage", {"read_storage", "read_temperature"}),
        (GRAPHICS, "infrastructure", "gpu", {"read_display"}),
        (CLOCK, "infrastructure", "rtc", {"read_clock"}),
        (TOUCHPAD, "sensor", "touchpad", {"read_input_events", "describe_input"}),
    ],
    ids=lambda value: value["id"] if isinstance(value, dict) else None,
)
def test_a_class_with_a_standard_interface_gets_its_capabilities(
    entry: dict[str, Any], category: str, kind: str, offered: set[str]
) -> None:
    found = answer(entry)
    assert (found["category"], found["class"]) == (category, kind)
    assert set(capabilities(found)) == offered
    assert all(capability["via"] for capability in found["capabilities"])


@pytest.mark.parametrize(
    ("lines", "category", "kind"),
    [
        (["interface 00: class 09/00/00 driver=hub", "device_class: 09/00/01"], "infrastructure", "hub"),
        (["interface 00: class 07/01/02"], "actuator", "printer"),
        (["interface 00: class 0b/00/00"], "infrastructure", "security"),
        (["interface 00: class e0/01/01 driver=btusb"], "infrastructure", "bluetooth"),
        (["interface 00: class 02/06/00 driver=cdc_ether"], "infrastructure", "network"),
        (["interface 00: class 02/0e/00 driver=cdc_mbim"], "infrastructure", "modem"),
        (["interface 00: class 08/06/50 driver=usb-storage"], "infrastructure", "storage"),
        (["interface 00: class 06/01/01"], "infrastructure", "phone"),
        (["interface 00: class 06/01/01", "product: Kestrel Digital Camera"], "sensor", "still_camera"),
        (["interface 00: class fe/03/01"], "bidirectional", "instrument"),
        (["interface 00: class 0f/00/00"], "sensor", "health"),
        (["interface 00: class ef/05/00"], "sensor", "camera"),
        (["interface 00: class 01/01/00", "interface 01: class 01/03/00"], "bidirectional", "midi"),
        (["interface 00: class 11/00/00", "device_class: 11/00/00"], "infrastructure", "billboard"),
        (["interface 00: class 01/01/20", "interface 01: class 01/02/20", "product: Lark Y5"], "actuator", "audio_out"),
        (["interface 00: class 01/01/00", "interface 01: class 01/02/00", "product: Lark Mic"], "sensor", "audio_in"),
        (["interface 00: class 01/01/00", *["interface 01: class 01/02/00"] * 2], "bidirectional", "audio"),
        (
            ["product: Lark 61", *(f"interface 0{at}: class ff/{at:02}/00" for at in (1, 2, 3))],
            "bidirectional",
            "audio",
        ),
        (["interface 00: class ff/00/00", "product: Tern Fingerprint T5"], "sensor", "fingerprint"),
        (["interface 00: class 03/00/00", "hid[0].usages: 0084/0004"], "infrastructure", "ups"),
        (["interface 00: class 03/00/00", "hid[0].usages: f1d0/0001"], "infrastructure", "security"),
        (["interface 00: class ff/00/00", "udev.ID_SOFTWARE_RADIO: 1"], "bidirectional", "sdr"),
        (["interface 00: class 03/01/01 driver=usbhid"], "sensor", "keyboard"),
        (["interface 00: class 03/00/00", "product: Heron LEDCube"], "actuator", "light"),
    ],
)
def test_a_usb_class_without_a_tool_is_annotated_and_offers_nothing(lines: list[str], category: str, kind: str) -> None:
    found = answer(usb(*lines))
    assert (found["category"], found["class"], found["capabilities"]) == (category, kind, [])


def test_a_video_processor_is_no_camera() -> None:
    entry = device(
        "platform-vpu",
        "platform",
        "name: soc-vpu",
        "video4linux[0].name: soc9-vpu-enc",
        nodes=[("video4linux", "video0")],
    )
    found = answer(entry)
    assert (found["category"], found["class"]) == ("infrastructure", "codec")
    assert set(capabilities(found)) == {"list_video_codecs"}


@pytest.mark.parametrize("name", ["soc9-isp1_mainpath", "rkisp_selfpath", "soc9 jpegenc", "imx-isi-m2m.0", "wave7-dec"])
def test_an_image_processor_by_its_drivers_word_is_no_camera(name: str) -> None:
    node = [("video4linux", "video0")]
    found = answer(device("platform-ip", "platform", "name: ip", f"video4linux[0].name: {name}", nodes=node))
    assert (found["class"], set(capabilities(found))) == ("codec", {"list_video_codecs"})


def test_a_radio_tuner_is_no_camera() -> None:
    lines = ("product: Heron FM Radio", "interface 02: class 03/00/00", "video4linux[0].name: tuner9")
    found = answer(usb(*lines, nodes=[("video4linux", "radio0")]))
    assert (found["category"], found["class"], found["capabilities"]) == ("bidirectional", "radio", [])


def test_channels_carry_label_unit_and_source() -> None:
    found = capabilities(answer(BOARD_SENSOR))["read_temperature"]["parameters"]["channels"]
    assert found == [{"channel": "temp1", "label": "Intake", "unit": "degC", "source": "hwmon", "name": "ext9"}]


def test_two_kernel_classes_with_the_same_reading_become_one_capability() -> None:
    entry = device(
        "x", "platform", "name: cpu", "hwmon[0].name: cpu_thermal", "hwmon[0].temp1: input", "thermal[0].role: zone",
        "thermal[0].type: cpu-thermal", nodes=[("hwmon", "hwmon0"), ("thermal", "thermal_zone0")],
    )  # fmt: skip
    channels = capabilities(answer(entry))["read_temperature"]["parameters"]["channels"]
    assert [channel["source"] for channel in channels] == ["hwmon", "thermal"]


def test_a_mouse_with_keys_is_a_mouse() -> None:
    entry = usb(
        "product: Vole M5",
        "interface 00: class 03/01/02 driver=usbhid",
        "interface 01: class 03/01/01 driver=usbhid",
        "input[0].name: Vole M5 Keyboard",
        "input[0].kinds: keyboard",
        "input[1].name: Vole M5",
        "input[1].kinds: mouse",
        nodes=[("input", "input1"), ("input", "input2")],
    )
    assert answer(entry)["class"] == "mouse"


def test_the_lights_of_a_network_adapter_are_not_offered() -> None:
    entry = device(
        "pci-wifi", "pci", "bus: pci", "class_code: 0x028000", "leds[0].name: phy0-led", "leds[0].max_brightness: 1",
        nodes=[("net", "wlan0"), ("leds", "phy0-led"), ("ieee80211", "phy0")],
    )  # fmt: skip
    assert set(capabilities(answer(entry))) <= {"read_led", "read_network_interfaces"}
