"""The kinds of devices that a generated host is made of: what the kernel shows of each, and what is true of it.

Truth follows from the construction: the class of an interface, a driver, a channel, or the word that the strings say.
"""

from collections.abc import Callable
from dataclasses import dataclass

from sysfs_tree import Tree

CONTROLLER = "pci0000:00/0000:00:14.0/usb1"


@dataclass(frozen=True)
class Kind:
    """``bus`` is where it hangs; ``noun`` is the word of class in its strings; ``build`` adds the kernel's classes."""

    bus: str
    noun: str
    categories: tuple[str, ...]
    tools: tuple[str, ...]
    build: Callable[[Tree, str, int], None]
    triple: str = "ff0000"
    driver: str = ""
    chip: bool = False
    """What shows is the chip that wires it, so that without strings nothing identifies the product."""
    shown: bool = True
    """Its class or its driver shows what it is; else its own words alone do."""
    model: str = ""
    """The model that the kernel reads from it."""


def _member(kind: str, name: str, attributes: dict[str, str], node: bool = False) -> Callable[[Tree, str, int], None]:
    def build(tree: Tree, path: str, number: int) -> None:
        fields = {"DEVNAME": f"{name}{number}"} if node else {}
        tree.member(f"{path}/{kind}/{name}{number}", kind, attributes, **fields)

    return build


def nothing(_tree: Tree, _path: str, _number: int) -> None:
    """A device to which no driver is bound."""


def _disk(tree: Tree, path: str, number: int) -> None:
    scsi = f"{path}/host{number}/target{number}:0:0/{number}:0:0:0"
    tree.bus(scsi, "scsi", {"vendor": "Bench", "model": "Disk"}, DRIVER="sd")
    name = f"sd{chr(97 + number % 26)}{chr(97 + number // 26 % 26)}"
    tree.member(f"{scsi}/block/{name}", "block", {"size": "2048", "removable": "1", "ro": "0"}, DEVNAME=name)


def _panel(tree: Tree, path: str, _number: int) -> None:
    # Named after its place in the board's description, as the kernel does where firmware has one.
    name = f"panel-{path.rpartition('/')[2].partition('.')[0]}"
    given = {"max_brightness": "100", "brightness": "7", "type": "raw"}
    tree.member(f"{path}/backlight/{name}", "backlight", given)


def _card(tree: Tree, path: str, number: int) -> None:
    tree.member(f"{path}/sound/card{number}", "sound", {"id": "USB", "number": str(number)})
    for end in "pc":
        name = f"pcmC{number}D0{end}"
        tree.member(f"{path}/sound/card{number}/{name}", "sound", {"pcm_class": "generic"}, DEVNAME=f"snd/{name}")


def _input(keys: str) -> Callable[[Tree, str, int], None]:
    def build(tree: Tree, path: str, number: int) -> None:
        hid = f"{path}/0003:1F00:0001.{number:04X}"
        tree.bus(hid, "hid", HID_ID="0003:00001F00:00000001", HID_NAME="input", DRIVER="hid-generic")
        bits = {"name": "input", "capabilities/ev": "100003", "capabilities/key": keys}
        tree.member(f"{hid}/input/input{number}", "input", bits)
        tree.member(f"{hid}/input/input{number}/event{number}", "input", {}, DEVNAME=f"input/event{number}")

    return build


def _iio(channels: dict[str, str]) -> Callable[[Tree, str, int], None]:
    def build(tree: Tree, path: str, number: int) -> None:
        tree.bus(f"{path}/iio:device{number}", "iio", {"name": "sensor", **channels}, DEVNAME=f"iio:device{number}")

    return build


KINDS: dict[str, Kind] = {
    "camera": Kind(
        *("usb", "Camera", ("sensor",), ("capture_image",)),
        _member("video4linux", "video", {"name": "UVC", "index": "0"}, node=True),
        *("0e0100", "uvcvideo"),
    ),
    "board with a line": Kind(
        *("usb", "Controller", ("unknown", "sensor", "actuator", "bidirectional"), ()),
        _member("tty", "ttyUSB", {}, node=True),
        *("ff0000", "ch341", True),
    ),
    "disk": Kind("usb", "Flash Disk", ("infrastructure",), ("read_storage",), _disk, "080650", "usb-storage"),
    "keyboard": Kind(
        "usb",
        "Keyboard",
        ("sensor",),
        ("describe_input",),
        _input("1000000000007 ff9f207ac14057ff"),
        "030101",
        "usbhid",
    ),
    "sound": Kind(
        *("usb", "Audio Interface", ("sensor", "actuator", "bidirectional"), ("record_audio", "play_audio")),
        _card,
        *("010100", "snd-usb-audio"),
    ),
    "network": Kind(
        *("usb", "Ethernet Adapter", ("infrastructure", "bidirectional"), ("read_network_interfaces",)),
        _member("net", "eth", {"address": "02:00:00:00:00:01", "operstate": "up", "type": "1"}),
        *("020d00", "cdc_ncm"),
    ),
    "printer": Kind(
        *("usb", "Label Printer", ("actuator", "bidirectional"), ()),
        _member("usbmisc", "lp", {}, node=True),
        *("070102", "usblp"),
    ),
    "thermometer": Kind(
        *("platform", "", ("sensor",), ("read_temperature",)),
        _member("hwmon", "hwmon", {"name": "bench", "temp1_input": "21500", "temp1_label": "board"}),
        driver="bench-temp",
    ),
    "fan controller": Kind(
        *("i2c", "", ("sensor", "bidirectional"), ("read_fan_speed",)),
        _member("hwmon", "hwmon", {"name": "fanboard", "fan1_input": "900", "pwm1": "120", "pwm1_enable": "1"}),
        driver="emc2305",
    ),
    "climate sensor": Kind(
        *("i2c", "", ("sensor",), ("read_humidity", "read_temperature", "read_sensor_channels")),
        _iio({"in_temp_input": "21000", "in_humidityrelative_input": "45000", "in_pressure_input": "100.3"}),
        driver="bme280",
    ),
    "accelerometer": Kind(
        *("acpi", "", ("sensor",), ("read_acceleration",)),
        _iio({"in_accel_x_raw": "10", "in_accel_y_raw": "-4", "in_accel_z_raw": "981", "in_accel_scale": "0.01"}),
        driver="kxcjk1013",
    ),
    "light sensor": Kind(
        *("acpi", "", ("sensor",), ("read_illuminance",)),
        _iio({"in_illuminance_input": "120"}),
        driver="acpi-als",
    ),
    "converter": Kind(
        *("spi", "", ("sensor",), ("read_sensor_channels",)),
        _iio({"in_voltage0_raw": "100", "in_voltage1_raw": "200", "in_voltage_scale": "0.8"}),
        driver="mcp3008",
    ),
    "capacitance": Kind(
        *("i2c", "", ("sensor",), ("read_sensor_channels",)),
        _iio({"in_capacitance0_raw": "77"}),
        driver="ad7746",
    ),
    "outputs": Kind(
        *("spi", "", ("actuator", "bidirectional"), ("set_output_channel", "read_output_channels")),
        _iio({"out_voltage0_raw": "100", "out_voltage1_raw": "200", "out_voltage_scale": "0.8"}),
        driver="ad5064",
    ),
    "lamp": Kind(
        *("platform", "", ("actuator", "bidirectional"), ("set_led", "read_led")),
        _member("leds", "bench:led", {"max_brightness": "255", "brightness": "0"}),
        driver="leds-gpio",
    ),
    "panel": Kind(
        *("platform", "", ("actuator", "bidirectional"), ("set_brightness",)),
        _panel,
        driver="pwm-backlight",
    ),
    "battery": Kind(
        *("acpi", "", ("sensor",), ("read_battery",)),
        _member("power_supply", "BAT", {"type": "Battery", "capacity": "80", "status": "Full", "present": "1"}),
        driver="battery",
    ),
    "clock": Kind(
        *("i2c", "", ("infrastructure",), ("read_clock",)),
        _member("rtc", "rtc", {"name": "rtc-ds1307", "time": "10:00:00", "date": "2026-01-01"}, node=True),
        driver="rtc-ds1307",
    ),
    "solid state disk": Kind(
        *("pci", "Solid State Disk", ("infrastructure",), ("read_storage",)),
        lambda tree, path, number: (
            _member("nvme", "nvme", {"model": "Bench SSD 500"}, node=True)(tree, path, number),
            tree.member(
                f"{path}/nvme/nvme{number}/nvme{number}n1", "block", {"size": "4096"}, DEVNAME=f"nvme{number}n1"
            ),
        )[0],
        *("010802", "nvme"),
        model="Bench SSD 500",
    ),
    "bluetooth": Kind(
        "usb",
        "Bluetooth Adapter",
        ("infrastructure", "bidirectional"),
        (),
        _member("bluetooth", "hci", {"type": "primary"}),
        "e00101",
        "btusb",
    ),
    "reader without a driver": Kind("usb", "Smart Card Reader", ("infrastructure",), (), nothing, "0b0000"),
    "capture device without a driver": Kind("usb", "Video Capture", ("sensor",), (), nothing, "ff0000", shown=False),
    "thermal camera without a driver": Kind("usb", "Thermal Camera", ("sensor",), (), nothing, "ff0000", shown=False),
    "keys without a driver": Kind("usb", "Trackball", ("sensor",), (), nothing, "030102"),
    "sound without a driver": Kind(
        "usb", "MIDI Interface", ("sensor", "actuator", "bidirectional"), (), nothing, "010300"
    ),
}


def _camera(tree: Tree, path: str, number: int) -> None:
    """A USB camera with its picture node and the node that the kernel makes for metadata beside it."""
    for index in range(2):
        name = f"video{500 + 2 * number + index}"
        given = {"name": "UVC: UVC", "index": str(index)}
        tree.member(f"{path}/video4linux/{name}", "video4linux", given, DEVNAME=name)


def _pipeline(tree: Tree, path: str, number: int) -> None:
    """An image processor of a board: many nodes, of which statistics and parameters are no pictures."""
    tree.member(f"{path}/media{number}", "media", {"model": "demoisp"})
    for index, name in enumerate(("demoisp_mainpath", "demoisp_selfpath", "demoisp_stats", "demoisp_params")):
        node = f"video{100 + 4 * number + index}"
        tree.member(f"{path}/video4linux/{node}", "video4linux", {"name": name, "index": "0"}, DEVNAME=node)
    tree.member(f"{path}/video4linux/v4l-subdev{number}", "video4linux", {"name": "demoisp_resizer"})


def _part(name: str) -> Callable[[Tree, str, int], None]:
    """A part of a board's camera, which the kernel shows as a sub-device."""
    return _member("video4linux", "v4l-subdev", {"name": name}, node=True)


def _rdma(tree: Tree, path: str, number: int) -> None:
    _member("net", "ens", {"address": "02:00:00:00:00:01", "type": "1"})(tree, path, number)
    tree.member(f"{path}/infiniband/mlx{number}", "infiniband", {"hca_type": "MT9999"})


def _card_of_board(tree: Tree, path: str, number: int) -> None:
    tree.member(f"{path}/block/mmcblk{number}", "block", {"size": "4096", "ro": "0"}, DEVNAME=f"mmcblk{number}")


def _motor(tree: Tree, path: str, number: int) -> None:
    bits = {"name": "demo-vibrator", "capabilities/ev": "200000", "capabilities/ff": "1 0"}
    tree.member(f"{path}/input/input{number}", "input", bits)
    tree.member(f"{path}/input/input{number}/event{number}", "input", {}, DEVNAME=f"input/event{number}")


def _laptop(tree: Tree, path: str, number: int) -> None:
    """A firmware driver with hot keys, a lamp and a fan."""
    bits = {"name": "Demo Extra Buttons", "capabilities/ev": "3", "capabilities/key": "10000 0 0 0"}
    tree.member(f"{path}/input/input{number}", "input", bits)
    tree.member(f"{path}/leds/demo{number}::kbd_backlight", "leds", {"max_brightness": "2", "brightness": "0"})
    tree.member(f"{path}/hwmon/hwmon{number}", "hwmon", {"name": "demofw", "fan1_input": "2000"})


_BOTH = ("sensor", "actuator", "bidirectional")
# Without a driver, by the device's own words: noun, categories, what the interfaces say.
_SPOKEN = (
    *(("Thermal Camera", ("sensor",), "ff0000"), ("Video Capture", ("sensor",), "ff0000")),
    *(("Smartphone", ("bidirectional", "infrastructure"), "ff0000"), ("Touchscreen", ("sensor",), "ff0000")),
    *(("NFC Reader", ("sensor",), "ff0000"), ("Trackball", ("sensor",), "030102")),
    *(("Audio Interface", _BOTH, "ff0000"), ("Drawing Tablet", ("sensor",), "ff0000")),
    *(("Barcode Scanner", ("sensor",), "ff0000"), ("Receipt Printer", ("actuator",), "ff0000")),
    *(("3D Printer", ("actuator", "bidirectional"), "ff0000"), ("Logic Analyzer", ("sensor",), "ff0000")),
    *(("SDR Receiver", ("bidirectional", "sensor"), "ff0000"), ("CMSIS-DAP Probe", ("bidirectional",), "ff0000")),
    *(("UPS", ("infrastructure",), "030000"), ("Postal Scale", ("sensor",), "030000")),
    *(("Power Supply", ("bidirectional",), "ff0000"), ("Oscilloscope", ("sensor",), "fe0301")),
    *(("DMX Interface", ("actuator", "bidirectional"), "ff0000"), ("Fingerprint Reader", ("sensor",), "ff0000")),
    *(("EEG Headset", ("sensor",), "ff0000"), ("CO2 Monitor", ("sensor",), "ff0000")),
    *(("Relay Board", ("actuator",), "ff0000"), ("Data Acquisition", ("bidirectional",), "ff0000")),
)
# Without a driver and whatever the strings say, by the number of the class (USB-IF, Defined Class Codes).
_CODED = (
    *(("billboard", "110000", ("infrastructure",)), ("hub", "090000", ("infrastructure",))),
    *(("still image", "060101", ("infrastructure", "sensor")), ("test instrument", "fe0301", _BOTH)),
    *(("health", "0f0000", ("sensor",)), ("machine vision", "ef0500", ("sensor",))),
    *(("printer", "070102", ("actuator",)), ("video", "0e0100", ("sensor",)), ("MIDI", "010300", _BOTH)),
    *(("Bluetooth", "e00101", ("infrastructure",)), ("RNDIS", "e00103", ("infrastructure",))),
    *(("mass storage", "080650", ("infrastructure",)), ("boot keyboard", "030101", ("sensor",))),
)
# Industrial I/O: channels, the tools of which it has one, and its category.
_CHANNELS = (
    ("gas", {"in_concentration_co2_raw": "4", "in_concentration_scale": "0.1"}, ("read_gas",), "sensor"),
    ("particles", {"in_massconcentration_pm2p5_input": "12"}, ("read_mass_concentration",), "sensor"),
    ("acidity", {"in_ph_raw": "700", "in_ph_scale": "0.01"}, ("read_ph",), "sensor"),
    ("ultraviolet", {"in_uvindex_input": "3"}, ("read_uv_index",), "sensor"),
    ("distance", {"in_distance_raw": "80", "in_distance_scale": "0.001"}, ("read_distance",), "sensor"),
    ("compass", {"in_magn_x_raw": "1", "in_magn_scale": "0.1"}, ("read_magnetic_field",), "sensor"),
    ("gyroscope", {"in_anglvel_x_raw": "1", "in_anglvel_scale": "0.1"}, ("read_angular_velocity",), "sensor"),
    ("barometer", {"in_pressure_input": "101.3"}, ("read_pressure",), "sensor"),
    ("hinge", {"in_angl0_raw": "90", "in_angl_scale": "0.01"}, ("read_angle",), "sensor"),
    ("rotation", {"in_rot_quaternion_raw": "0 0 0 1"}, ("read_orientation",), "sensor"),
    ("tilt", {"in_incli_x_raw": "3"}, ("read_inclination",), "sensor"),
    ("strain gauge", {"in_resistance_raw": "350"}, ("read_resistance",), "sensor"),
    ("nearness", {"in_proximity_raw": "7"}, ("read_proximity",), "sensor"),
    ("conductivity", {"in_electricalconductivity_raw": "7"}, ("read_conductivity",), "sensor"),
    ("steps", {"in_steps_input": "70"}, ("read_steps",), "sensor"),
    ("both ways", {"in_voltage0_raw": "1", "out_voltage1_raw": "2", "in_voltage_scale": "1", "out_voltage_scale": "1"},
     ("set_output_channel",), "bidirectional"),
    ("one bit", {"in_voltage0_raw": "1"}, ("read_voltage",), "sensor"),
    ("potentiometer", {"out_resistance0_raw": "5", "out_resistance_scale": "390"}, ("set_output_channel",), "actuator"),
)  # fmt: skip
KINDS |= {
    **{f"spoken: {noun}": Kind("usb", noun, told, (), nothing, triple, shown=False) for noun, told, triple in _SPOKEN},
    **{f"coded: {name}": Kind("usb", "Gear", told, (), nothing, triple) for name, triple, told in _CODED},
    **{
        f"channels: {name}": Kind("i2c", "", (category,), tools, _iio(channels), driver=f"demo{name.replace(' ', '-')}")
        for name, channels, tools, category in _CHANNELS
    },
    "camera with metadata": Kind("usb", "Camera", ("sensor",), ("capture_image",), _camera, "0e0100", "uvcvideo"),
    "image processor": Kind(
        *("platform", "", ("infrastructure",), ("list_camera_formats", "list_video_codecs")),
        _pipeline,
        driver="demoisp",
    ),
    "image sensor": Kind("i2c", "", ("sensor",), (), _part("imx99 10-0010"), driver="imx99"),
    "lens": Kind("i2c", "", ("actuator",), ("set_focus",), _part("dw9714 10-000c"), driver="dw9714"),
    "RDMA adapter": Kind(
        *("pci", "Network Adapter", ("infrastructure",), ("read_network_interfaces",)), _rdma, "020000", "mlx9_core"
    ),
    "accelerator": Kind("pci", "Accelerator", ("infrastructure",), (), nothing, "120000"),
    "capture card": Kind("pci", "Capture Card", ("sensor",), (), nothing, "040000"),
    "encryption": Kind("pci", "Crypto Engine", ("infrastructure",), (), nothing, "108000"),
    "eMMC": Kind("mmc", "", ("infrastructure",), ("read_storage",), _card_of_board, driver="mmcblk"),
    "CAN": Kind(
        *("spi", "", ("bidirectional",), ("read_network_interfaces",)),
        _member("net", "can", {"type": "280"}),
        driver="mcp251x",
    ),
    "watchdog": Kind(
        *("platform", "", ("infrastructure",), ()), _member("watchdog", "watchdog", {"identity": "Demo"}), driver="wdt"
    ),
    "key store": Kind("spi", "", ("infrastructure",), (), _member("tpm", "tpm", {}), driver="tpm_tis_spi"),
    "pins": Kind(
        *("platform", "", ("bidirectional",), ("read_gpio_lines",)),
        _member("gpio", "gpiochip", {"label": "demo-pins", "ngpio": "32"}),
        driver="pinctrl-demo",
    ),
    "pulses": Kind(
        "i2c", "", ("actuator", "bidirectional"), (), _member("pwm", "pwmchip", {"npwm": "16"}), driver="pca9"
    ),
    "regulator": Kind(
        *("i2c", "", ("infrastructure",), ()), _member("regulator", "regulator.", {"name": "vdd"}), driver="tps6"
    ),
    "NFC": Kind("i2c", "", ("bidirectional", "sensor"), (), _member("nfc", "nfc", {}), driver="nxp-nci_i2c"),
    "memory chip": Kind("i2c", "", ("infrastructure",), (), nothing, driver="at24"),
    "vibration motor": Kind("platform", "", ("actuator",), ("play_rumble",), _motor, driver="gpio-vibrator"),
    "firmware of a laptop": Kind(
        *("platform", "", ("bidirectional",), ("read_fan_speed",)), _laptop, driver="demo_acpi"
    ),
    "1-Wire thermometer": Kind("w1", "", ("sensor",), (), nothing, driver="w1_slave_driver"),
    "zone": Kind(
        *("platform", "", ("sensor",), ("read_temperature",)),
        _member("thermal", "thermal_zone", {"type": "cpu-thermal", "temp": "41000"}),
        driver="demo-tsens",
    ),
}
NATIVE = {
    **{"Receipt Printer": "热敏打印机", "Barcode Scanner": "条码扫描器", "Postal Scale": "Весы электронные"},
    **{"Oscilloscope": "オシロスコープ", "Fingerprint Reader": "指纹识别器", "Thermal Camera": "Тепловая камера"},
    **{"Keyboard": "机械键盘", "Camera": "ウェブカメラ", "UPS": "Источник бесперебойного питания"},
}
"""What a device calls its kind in another language, by the noun."""
